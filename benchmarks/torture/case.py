# SPDX-License-Identifier: Apache-2.0
"""A case of the torture test and what came of it."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum

import numpy as np

from gdfe_ros.errors import GdfeError
from gdfe_ros.solver.result import StepResult
from gdfe_ros.solver.settings import Policy

LARGEST_RISE = 1e-12
"""Rise of the energy inside a descent, over the sum of its terms, that counts as rounding."""


class Group(str, Enum):
    """What a case attacks; numbered as in the table."""

    STARTS = "1 starts"
    COMMANDS = "2 commands"
    CONTRASTS = "3 contrasts"
    SCALES = "4 scales"
    MESHES = "5 meshes"
    LAWS = "6 laws"
    WALKS = "7 walks"
    ACTUATORS = "8 actuators"
    HONESTY = "9 honesty"
    CONTACT = "10 contact"


class Verdict(str, Enum):
    """What came of a case."""

    CONVERGED = "converged"
    REPORTED = "reported"
    REFUSED = "refused"
    FAILED = "failed"


@dataclass(frozen=True)
class Finding:
    """What a run hands to the judge.

    Attributes:
        results: every step that counts; the last one is judged most strictly.
        error: against the untortured solution or a closed form, relative; nan where there is none to compare with.
        rise: largest rise of the energy inside a descent, over the sum of its terms.
        remarks: what was said about the scene beforehand.
        flaws: what else the run found wrong.
        figures: what else was measured.
    """

    results: tuple[StepResult, ...]
    error: float
    rise: float = 0.0
    remarks: tuple[str, ...] = ()
    flaws: tuple[str, ...] = ()
    figures: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Case:
    """One torment.

    Attributes:
        group: what it attacks.
        name: unique within group, policy and law.
        policy: which policy solves.
        law: which material law.
        run: does it.
        bound: largest error allowed; infinite where no solution is unique, and only soundness is asked for.
        refusal: words of the refusal or report that is the right answer; empty where the case is to be solved.
        remark: words that must be said about the scene although it is solved.
        may_report: a step that says why it did not converge is an answer too: the law or the body is unstable there.
            The state that it leaves must be sound all the same.
    """

    group: Group
    name: str
    policy: Policy
    law: str
    run: Callable[[], Finding]
    bound: float
    refusal: str = ""
    remark: str = ""
    may_report: bool = False

    @property
    def id(self) -> str:
        """Name in the table and of the test."""
        return f"{self.group.value}: {self.name}, {self.law}, {self.policy.value}"


@dataclass(frozen=True)
class Outcome:
    """What came of a case.

    Attributes:
        verdict: of the judge; a reported step did not converge, says why and leaves a sound state.
        error: as in `Finding`; nan where there is none.
        bound: that of the case.
        iterations: of all steps.
        restarts: steps that were made again from rest.
        time: processor time [s].
        text: the refusal, the report or the reason of the failure.
        figures: what else was measured.
    """

    verdict: Verdict
    error: float
    bound: float
    iterations: int
    restarts: int
    time: float
    text: str = ""
    figures: Mapping[str, float] = field(default_factory=dict)


def attempt(case: Case) -> Outcome:
    """Run a case and judge it.

    An error of another kind than the package raises on purpose is a failure, not an answer.
    """
    started = time.process_time()
    try:
        finding = case.run()
    except (GdfeError, ValueError) as refusal:
        text = str(refusal)
        verdict = Verdict.REFUSED if case.refusal and case.refusal in text else Verdict.FAILED
        return Outcome(verdict, np.nan, case.bound, 0, 0, time.process_time() - started, text)
    verdict, text = _judge(case, finding)
    iterations = sum(result.iterations for result in finding.results)
    restarts = sum(result.restarts for result in finding.results)
    elapsed = time.process_time() - started
    return Outcome(verdict, finding.error, case.bound, iterations, restarts, elapsed, text, finding.figures)


def _judge(case: Case, finding: Finding) -> tuple[Verdict, str]:
    last = finding.results[-1]
    flaws = [*finding.flaws, *_flaws(finding.results)]
    if finding.rise > LARGEST_RISE:
        flaws.append(f"the energy rises by {finding.rise:.2g} of its terms inside a descent")
    if case.remark and not any(case.remark in remark for remark in finding.remarks):
        flaws.append(f"nothing says {case.remark!r}; said: {finding.remarks}")
    if not last.min_det > 0.0:
        flaws.append(f"least det F {last.min_det:.3g} at the end")
    reported = not last.converged and case.refusal in last.message if case.refusal else case.may_report
    if reported and not flaws and not last.converged:
        return Verdict.REPORTED, last.message
    if case.refusal:
        flaws.append(f"neither refused nor reported with the words {case.refusal!r}; message: {last.message!r}")
    if not last.converged:
        flaws.append(f"not converged: {last.message}")
    if np.isfinite(case.bound) and not finding.error <= case.bound:
        flaws.append(f"error {finding.error:.3g}, bound {case.bound:.3g}")
    return (Verdict.FAILED, "; ".join(flaws)) if flaws else (Verdict.CONVERGED, "; ".join(finding.remarks))


def _flaws(results: tuple[StepResult, ...]) -> list[str]:
    flaws = []
    for i, result in enumerate(results):
        values = [result.energy, result.min_det, *np.concatenate([*result.reactions.values(), [0.0]])]
        # A solve that was cut knows no distance: its residual is infinite, and it has not converged.
        known = np.isfinite(result.error_estimate) or (result.error_estimate == np.inf and not result.converged)
        if not (np.isfinite(result.positions).all() and np.isfinite(values).all() and known):
            flaws.append(f"step {i} is not finite")
        if not result.converged and not result.message:
            flaws.append(f"step {i} did not converge and does not say why")
    return flaws
