# SPDX-License-Identifier: Apache-2.0
"""A case of the torture test, and its outcome."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import numpy as np

from gdfe_ros.errors import GdfeError
from gdfe_ros.results.step_result import StepResult
from gdfe_ros.solver.settings import Policy

LARGEST_RISE = 1e-12
"""Increase of the energy within a descent, divided by the magnitude of its terms, that counts as rounding."""


class Group(str, Enum):
    """Property that a case tests; numbered as in the table."""

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
    """Verdict on a case."""

    CONVERGED = "converged"
    REPORTED = "reported"
    REFUSED = "refused"
    FAILED = "failed"


@dataclass(frozen=True)
class Finding:
    """Result of running a case, from which the verdict follows.

    Attributes:
        results: results of the steps that are checked; the last one has to meet more conditions.
        error: relative error against an ordinary solution or a closed form; nan if there is none.
        rise: largest increase of the energy within a descent, divided by the magnitude of its terms.
        remarks: remarks on the scene, made before the solve.
        flaws: other defects that the run found.
    """

    results: tuple[StepResult, ...]
    error: float
    rise: float = 0.0
    remarks: tuple[str, ...] = ()
    flaws: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Case:
    """A case of the torture test.

    Attributes:
        group: property that it tests.
        name: name that is unique within group, policy and law.
        policy: policy of the solver.
        law: name of the material law.
        run: function that runs the case.
        bound: largest allowed error. It is infinite if the solution is not unique; then only soundness is required:
            finite numbers, no inverted elements, and no increase of the energy.
        refusal: words of the expected refusal or report; empty if the case must be solved.
        remark: words that must occur in the remarks on the scene, although the case is solved.
        may_report: whether a step may report why it did not converge, because the law or the body is unstable. Its
            final state must nevertheless be sound.
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
        """Name of the case in the table and of its test."""
        return f"{self.group.value}: {self.name}, {self.law}, {self.policy.value}"


@dataclass(frozen=True)
class Outcome:
    """Outcome of a case.

    Attributes:
        verdict: verdict on the case. In a reported case, the last step did not converge, gives a reason and has a sound
            state.
        error: error as in `Finding`; nan if there is none.
        bound: bound of the case.
        iterations: number of iterations of all steps.
        restarts: number of solves that were repeated from the undeformed shape.
        time: processor time [s].
        text: text of the refusal or report, or the reason of the failure.
    """

    verdict: Verdict
    error: float
    bound: float
    iterations: int
    restarts: int
    time: float
    text: str = ""


def attempt(case: Case) -> Outcome:
    """Run a case and return its outcome.

    An error that the package does not raise on purpose is passed on and counts as a failure.
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
    return Outcome(verdict, finding.error, case.bound, iterations, restarts, elapsed, text)


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
        # A solve that was cut has no error estimate: it is infinite, and the step has not converged.
        known = np.isfinite(result.error_estimate) or (result.error_estimate == np.inf and not result.converged)
        if not (np.isfinite(result.positions).all() and np.isfinite(values).all() and known):
            flaws.append(f"step {i} is not finite")
        if not result.converged and not result.message:
            flaws.append(f"step {i} did not converge and does not say why")
    return flaws
