# SPDX-License-Identifier: Apache-2.0
"""Times of the phases of a step, measured in the running solver."""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from benchmarks.profile.machine import fastest
from gdfe_ros.simulation import Simulation
from gdfe_ros.solver.descent import minimiser, newton, pairs, quasi_newton
from gdfe_ros.solver.descent.workspace import Workspace, numbers
from gdfe_ros.solver.equilibrium.solve import Solve
from gdfe_ros.solver.matrix.constant_matrix import ConstantMatrix, apply_inverse
from gdfe_ros.solver.tangent.level import TangentLevel
from gdfe_ros.solver.tangent.substitution import solve_kept

EVALUATIONS, SOLVES, HISTORY = "evaluations", "solves", "history"
TANGENTS, NEWTON, UPDATES, ENERGIES = "tangents", "Newton steps", "updates", "energies"
REST = "everything else"
_TIMED: tuple[tuple[object, str, str], ...] = (
    (quasi_newton, "advance", EVALUATIONS),
    (pairs, "remember", HISTORY),
    (pairs, "take_products", HISTORY),
    (quasi_newton, "descend", HISTORY),
    (quasi_newton, "descend_kept", HISTORY),
    (ConstantMatrix, "solve", SOLVES),
    (minimiser, "close_coupling", SOLVES),
    (TangentLevel, "solve", SOLVES),
    (TangentLevel, "take", TANGENTS),
    (TangentLevel, "load", TANGENTS),
    (newton, "iterate", NEWTON),
    (newton, "solve_newton", NEWTON),
    (Solve, "_update", UPDATES),
    (Solve, "measure", ENERGIES),
)
"""Owner and name of each timed function, and its phase."""

_APPLY: dict[str, Callable[[Any, Any, Workspace], None]] = {
    "descend": lambda problem, coupling, work: apply_inverse(work.gradient, coupling, work.step, problem.threads),
    "descend_kept": lambda problem, kept, work: solve_kept(kept, work.gradient, work.step),
}
"""Dict from descent to its linear solve; a descent is one compiled call, inside which solves cannot be timed."""


class Phases:
    """Times of the phases while a simulation is played.

    Attributes:
        seconds: dict from phase to its time [s], without the times of other phases inside it.
        calls: dict from phase to its number of calls.
    """

    def __init__(self) -> None:
        self.seconds: Counter[str] = Counter()
        self.calls: Counter[str] = Counter()
        self._inside: list[float] = []
        self._last: tuple[Any, ...] = ()
        self._directions = 0
        self._inner = {"descend": Descents(), "descend_kept": Descents()}

    @classmethod
    def played(cls, simulation: Simulation, steps: int | None) -> Phases:
        """Play a scene's program twice, and return the times of the second run."""
        phases = cls()
        list(simulation.play(steps))
        simulation.reset()
        with phases._timing():
            started = time.perf_counter()
            results = list(simulation.play(steps))
            whole = time.perf_counter() - started
        phases._split_directions()
        phases._split_descents()
        phases.seconds[REST] = whole - sum(phases.seconds.values())
        phases.calls[REST] = len(results)
        return phases

    @contextmanager
    def _timing(self) -> Iterator[None]:
        plain = [(owner, name, vars(owner)[name]) for owner, name, _ in _TIMED]
        for owner, name, phase in _TIMED:
            setattr(owner, name, self._timed(name, getattr(owner, name), phase))
        try:
            yield
        finally:
            for owner, name, function in plain:
                setattr(owner, name, function)

    def _timed(self, name: str, function: Callable[..., Any], phase: str) -> Callable[..., Any]:
        if name in self._inner:
            function = self._inner[name].counted(function)

        def timed(*arguments: Any, **options: Any) -> Any:
            self._inside.append(0.0)
            started = time.perf_counter()
            try:
                return function(*arguments, **options)
            finally:
                taken = time.perf_counter() - started
                self.seconds[phase] += taken - self._inside.pop()
                self._inside[-1:] = [inside + taken for inside in self._inside[-1:]]
                self.calls[phase] += 1
                if phase == EVALUATIONS:
                    self._last = arguments
                    self._directions += not arguments[-1]

        return timed

    def _split_directions(self) -> None:
        """Move from evaluations to history the time of the evaluations that compute only a descent direction."""
        if not self._directions:
            return
        problem, work, *_ = self._last
        share = fastest(lambda: quasi_newton.advance(problem, work, math.inf, False)) * self._directions
        self.seconds[EVALUATIONS] -= share
        self.seconds[HISTORY] += share

    def _split_descents(self) -> None:
        """Move the times of evaluations and solves out of compiled descents; the remaining time is the history's."""
        for name, inner in self._inner.items():
            if inner.last:
                problem, work, given, *_ = inner.last
                self._move(
                    EVALUATIONS, inner.evaluations, lambda p=problem, w=work: quasi_newton.advance(p, w, 0.0, True)
                )
                apply = _APPLY[name]
                self._move(SOLVES, inner.solves, lambda a=apply, w=work, g=given, p=problem: a(p, g, w))

    def _move(self, phase: str, count: int, work: Callable[[], Any]) -> None:
        share = min(fastest(work) * count, self.seconds[HISTORY])
        self.seconds[phase] += share
        self.seconds[HISTORY] -= share
        self.calls[phase] += count


class Descents:
    """Counts of evaluations and solves inside descents that are one compiled call.

    Attributes:
        evaluations, solves: numbers in all descents.
        last: arguments of the last descent; empty before the first one.
    """

    def __init__(self) -> None:
        self.evaluations = self.solves = 0
        self.last: tuple[Any, ...] = ()

    def counted(self, descend: Callable[..., int]) -> Callable[..., int]:
        """Return a function that calls ``descend`` and counts its evaluations and solves."""

        def counting(problem: Any, work: Workspace, *given: Any) -> int:
            before = int(numbers(work)["evaluations"])
            iterations = descend(problem, work, *given)
            self.evaluations += int(numbers(work)["evaluations"]) - before
            self.solves += iterations + (descend.__name__ == "descend")
            self.last = problem, work, *given
            return iterations

        return counting
