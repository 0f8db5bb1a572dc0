# SPDX-License-Identifier: Apache-2.0
"""Request and result of a solve, and outcome of a step, with the comparison of two outcomes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from gdfe_ros.constraints import Pose
from gdfe_ros.solver.elements.barrier import THRESHOLD
from gdfe_ros.solver.outcome import Deadline, Outcome
from gdfe_ros.solver.state import State, replace_fields
from gdfe_ros.solver.vectors import Array, largest_distance


@dataclass(frozen=True, eq=False, kw_only=True)
class Increment:
    """Request of a solve: the commands for which it finds an equilibrium, its tolerances and its limits.

    Attributes:
        poses: pose of every handle, relative to its rest pose.
        commands: command of every actuator and load.
        tolerance: allowed distance to the equilibrium, divided by the body's size.
        limit: largest number of iterations.
        deadline: once it has passed, the solve returns its best positions so far; None for no deadline.
        begins: fraction of the load path at which the increment begins.
        divisible: whether a shorter increment may follow. The solve may then end early, at an actuator's limit point.
        keeping: relative tolerance of commanded lengths and of hourglass scales; None stands for ``tolerance``.
        volumes: relative tolerance of the volumes of elements with a pressure; None stands for ``keeping``.
    """

    poses: Mapping[str, Pose]
    commands: Mapping[str, float]
    tolerance: float
    limit: int
    deadline: Deadline | None = None
    begins: float = 0.0
    divisible: bool = False
    keeping: float | None = None
    volumes: float | None = None

    @classmethod
    def at(cls, state: State, *, tolerance: float, limit: int, deadline: Deadline | None = None) -> Increment:
        """Return the request for the equilibrium at the poses and commands of ``state``."""
        return cls(poses=state.poses, commands=state.commands, tolerance=tolerance, limit=limit, deadline=deadline)


@dataclass(frozen=True, eq=False, kw_only=True)
class Found:
    """Base class of the results of solves and steps.

    Attributes:
        state: the state.
        iterations: number of iterations.
    """

    state: State
    iterations: int = 0

    @property
    def converged(self) -> bool:
        """Whether the positions are an equilibrium to the tolerance."""
        return self.state.summary.converged

    @property
    def positions(self) -> Array:
        """Positions (n, 3) [m]."""
        return self.state.positions

    @property
    def error_estimate(self) -> float:
        """Estimated largest distance to the equilibrium, divided by the body's size; infinite if it is unknown."""
        return self.state.summary.error_estimate

    @property
    def message(self) -> str:
        """Description of the defect; empty if there is none."""
        return self.state.summary.message

    @property
    def min_det(self) -> float:
        """Least volume ratio det F at a corner of an element."""
        return self.state.summary.min_det


@dataclass(frozen=True, eq=False, kw_only=True)
class Solution(Found):
    """Result of a solve; the equilibrium solver's `accept` completes its state.

    Attributes:
        state: the final state, still without the motion that `accept` adds.
        ended: how its last minimisation ended; `Outcome.NEAR` if it converged.
        entered: whether surfaces of the body penetrate each other.
        began: (n, 3) positions at the beginning of the solve [m].
    """

    ended: Outcome
    entered: bool = False
    began: Array

    @property
    def cut(self) -> bool:
        """Whether the limit or the deadline ended the solve."""
        return self.ended is Outcome.CUT

    @property
    def diverged(self) -> bool:
        """Whether the energy has no lower bound."""
        return self.ended is Outcome.RUNAWAY

    @property
    def exhausted(self) -> bool:
        """Whether no further descent was possible, because of the energy's rounding or at a kink of the energy."""
        return self.ended in (Outcome.EXHAUSTED, Outcome.NEUTRAL)


@dataclass(frozen=True, eq=False, kw_only=True)
class PathResult(Found):
    """Outcome of following a load path.

    Attributes:
        state: state at the end; it has not converged if the commands were not completed.
        completed: whether the commands were completed.
        iterations: number of iterations of all increments.
        increments: number of attempted increments, including failed increments.
        skipped: dict from kind of work to the count that the last solve left out, as in `StepResult`.
        snapped: whether the load path ended in a jump to another equilibrium.
        restarts: 1 if the state was not found along the load path, but from the undeformed body or after contacts were
            dropped; otherwise 0.
        simulated: time [s] by which a moving body advanced; None without dynamics.
    """

    NEAR = 100.0
    """Two equilibria count as the same if their distance, divided by the tolerance, is at most this."""
    SAME = 1e-6
    """Two energies count as equal if their relative difference is at most this."""

    completed: bool
    increments: int = 0
    skipped: dict[str, int] = field(default_factory=dict)
    snapped: bool = False
    restarts: int = 0
    simulated: float | None = None

    @property
    def sound(self) -> bool:
        """Whether the state is an equilibrium at the commands, without a folded or inverted element."""
        return self.completed and self.converged and self.min_det > 0.0

    @property
    def inverted(self) -> bool:
        """Whether an element is folded or inverted, or a position is NaN."""
        return not self.min_det > 0.0

    @property
    def flaw(self) -> str:
        """Defect of the outcome, in words for a message."""
        if self.inverted:
            return "folded or inverted elements"
        return "another equilibrium, higher in energy" if self.sound else "no equilibrium"

    def is_better(self, other: PathResult, reach: float, *, gain: float) -> bool:
        """Return whether this outcome, which started from the undeformed body, is better than ``other``.

        If only one of the two outcomes is sound, the sound one is better. If neither is sound, this outcome is better
        if only ``other`` has folded or inverted elements. If both are sound, this outcome is better if it is another
        equilibrium of no higher energy.

        Args:
            other: outcome of the same commands from another start.
            reach: distance [m] within which two equilibria count as the same.
            gain: energy plus potential of ``other``, minus energy plus potential of this outcome [J].
        """
        if self.sound != other.sound:
            return self.sound
        if not self.sound:
            return other.inverted and not self.inverted
        differs = not largest_distance(self.state.positions, other.state.positions) <= reach
        return differs and gain >= -self.SAME * other.state.summary.energy

    def counting(self, other: PathResult) -> PathResult:
        """Return this outcome with the iterations and increments of ``other`` added."""
        iterations, increments = self.iterations + other.iterations, self.increments + other.increments
        return replace_fields(self, iterations=iterations, increments=increments)

    def with_message(self, message: str, *, converged: bool) -> PathResult:
        """Return this outcome with another message, and whether it has converged."""
        summary = replace_fields(self.state.summary, converged=converged, message=message)
        return replace_fields(self, state=self.state.with_(summary=summary))


def is_crumpled(state: State) -> bool:
    """Return whether elements are folded or nearly folded; an equilibrium of lower energy may then exist."""
    return not state.summary.min_det >= THRESHOLD
