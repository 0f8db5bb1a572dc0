# SPDX-License-Identifier: Apache-2.0
"""Times of the phases of a step, measured in the running solver.

A minimisation is one compiled call, in which phases cannot be timed. Their numbers are counted in a first run, in which
the minimisation makes one iteration per call, and multiplied by the least time of each phase alone. On a loaded
machine, the time of other processes therefore counts as rest of the loop.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from benchmarks.profile.machine import fastest
from gdfe_ros.simulation import Simulation
from gdfe_ros.solver.descent.arc import follow_arc_once
from gdfe_ros.solver.descent.loop import FOLLOWED, STRAIGHT, Metric
from gdfe_ros.solver.descent.search import advance
from gdfe_ros.solver.descent.workspace import Problem, Workspace, numbers
from gdfe_ros.solver.equilibrium.solve import Solve
from gdfe_ros.solver.equilibrium.stability import Stability
from gdfe_ros.solver.matrix.constant_matrix import ConstantMatrix, apply_inverse
from gdfe_ros.solver.matrix.rotation import vertex_rotations
from gdfe_ros.solver.matrix.substitution import solve_kept
from gdfe_ros.solver.minimise import minimiser
from gdfe_ros.solver.minimise.level import TangentLevel

EVALUATIONS, SOLVES, ROTATIONS, ARCS, LOOP = "evaluations", "solves", "rotations", "arcs", "rest of the loop"
TANGENTS, STABILITY, UPDATES, ENERGIES = "tangents", "stability", "updates", "energies"
REST = "everything else"
_TIMED: tuple[tuple[object, str, str], ...] = (
    (minimiser, "advance", EVALUATIONS),
    (minimiser, "descend", LOOP),
    (ConstantMatrix, "solve", SOLVES),
    (TangentLevel, "solve", SOLVES),
    (TangentLevel, "take", TANGENTS),
    (TangentLevel, "load", TANGENTS),
    (Stability, "look", STABILITY),
    (Stability, "leave", STABILITY),
    (Solve, "_update", UPDATES),
    (Solve, "measure", ENERGIES),
)
"""Owner and name of each timed function, and its phase."""


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

    @classmethod
    def played(cls, simulation: Simulation, steps: int | None) -> Phases:
        """Play a scene's program twice: count in the first run, and return the times of the second run."""
        phases, loop = cls(), Counts()
        with _replaced(minimiser, "descend", loop.counted(minimiser.descend)):
            list(simulation.play(steps))
        simulation.reset()
        with phases._timing():
            started = time.perf_counter()
            results = list(simulation.play(steps))
            whole = time.perf_counter() - started
        for phase, (count, work) in loop.parts().items():
            phases._move(phase, count, work)
        phases.seconds[REST] = whole - sum(phases.seconds.values())
        phases.calls[REST] = len(results)
        return phases

    @contextmanager
    def _timing(self) -> Iterator[None]:
        plain = [(owner, name, vars(owner)[name]) for owner, name, _ in _TIMED]
        for owner, name, phase in _TIMED:
            setattr(owner, name, self._timed(getattr(owner, name), phase))
        try:
            yield
        finally:
            for owner, name, function in plain:
                setattr(owner, name, function)

    def _timed(self, function: Callable[..., Any], phase: str) -> Callable[..., Any]:
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

        return timed

    def _move(self, phase: str, count: int, work: Callable[[], Any]) -> None:
        """Move the time of ``count`` calls of ``work`` from the loop to a phase."""
        share = min(fastest(work) * count, self.seconds[LOOP]) if count else 0.0
        self.seconds[phase] += share
        self.seconds[LOOP] -= share
        self.calls[phase] += count


class Counts:
    """Numbers of evaluations, solves, rotations and arcs in minimisations."""

    def __init__(self) -> None:
        self._counts: Counter[str] = Counter()
        self._last: tuple[Problem, Workspace, Metric] | None = None

    def counted(self, descend: Callable[..., int]) -> Callable[..., int]:
        """Return a function that minimises like ``descend``, one iteration per call, and counts."""

        def counting(
            problem: Problem,
            work: Workspace,
            metric: Metric,
            size: float,
            target: float,
            proven: bool,
            most: int,
            limit: int,
            begins: bool,
        ) -> int:
            status, done, counts = numbers(work), 0, self._counts
            self._last, before = (problem, work, metric), int(status["evaluations"])
            while True:
                kept = len(metric.kept.order) > 0
                turned, evaluations = status["turned"] > FOLLOWED * size, int(status["evaluations"])
                used = descend(problem, work, metric, size, target, proven, most, min(1, limit - done), begins)
                done, begins = done + used, False
                solved = done < limit or used > 0
                counts[SOLVES] += solved
                counts[ROTATIONS] += solved and kept and turned
                counts[ARCS] += status["evaluations"] > evaluations and status["before"] > STRAIGHT * size
                if not used or done >= limit:
                    counts[EVALUATIONS] += int(status["evaluations"]) - before
                    return done

        return counting

    def parts(self) -> dict[str, tuple[int, Callable[[], Any]]]:
        """Return a dict from phase to its number in the minimisations, and a function that does it once."""
        if self._last is None:
            return {}
        problem, work, metric = self._last
        works: dict[str, Callable[[], Any]] = {
            EVALUATIONS: lambda: advance(problem, work, True),
            SOLVES: lambda: _solve(problem, work, metric),
            ROTATIONS: lambda: _rotate(problem, work, metric),
            ARCS: lambda: follow_arc_once(problem, work, metric),
        }
        return {phase: (self._counts[phase], function) for phase, function in works.items()}


def _solve(problem: Problem, work: Workspace, metric: Metric) -> None:
    """Solve with the initial matrix."""
    if len(metric.kept.order):
        solve_kept(metric.kept, work.gradient, work.step)
    else:
        apply_inverse(work.gradient, metric.coupling, work.step, problem.threads)


def _rotate(problem: Problem, work: Workspace, metric: Metric) -> None:
    """Compute the rotations of the vertices."""
    rows = problem.unknowns.free, problem.unknowns.fixed
    given = rows, metric.held, metric.sums, metric.kept.frames
    vertex_rotations(work.x, metric.before, problem.shape, *given)


@contextmanager
def _replaced(owner: object, name: str, function: Callable[..., Any]) -> Iterator[None]:
    """Replace a function inside the ``with`` block."""
    plain = getattr(owner, name)
    setattr(owner, name, function)
    try:
        yield
    finally:
        setattr(owner, name, plain)
