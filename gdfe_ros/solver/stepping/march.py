# SPDX-License-Identifier: Apache-2.0
"""Outcome of a step, and the comparison of two outcomes."""

from __future__ import annotations

from dataclasses import dataclass

from gdfe_ros.solver.elements.barrier import THRESHOLD
from gdfe_ros.solver.state import State
from gdfe_ros.solver.value import changed
from gdfe_ros.solver.vectors import largest_distance


@dataclass(frozen=True, eq=False, kw_only=True)
class March:
    """Outcome of following a load path.

    Attributes:
        state: state at the end.
        iterations: number of iterations of all increments.
        increments: number of attempted increments, including failed increments.
        reached: whether the commands were reached.
        converged: whether the state is an equilibrium at the commands.
        message: description of the defect; empty if there is none.
        skipped: dict from kind of work to the count that the last solve left out, as in `StepResult`.
        snapped: whether the load path ended in a jump to another equilibrium.
        restarts: 1 if the undeformed body, or dropped contacts, led to the state instead of the load path; otherwise 0.
        simulated: time [s] by which a moving body advanced; None without dynamics.
    """

    NEAR = 100.0
    """Two equilibria count as the same if their distance, divided by the tolerance, is at most this."""
    SAME = 1e-6
    """Two energies count as equal if their relative difference is at most this."""

    state: State
    iterations: int
    increments: int
    reached: bool
    converged: bool
    message: str
    skipped: dict[str, int]
    snapped: bool = False
    restarts: int = 0
    simulated: float | None = None

    @classmethod
    def refused(cls, state: State, message: str) -> March:
        """Return the outcome of a step that is refused because a command is impossible."""
        stays = state.with_(summary=changed(state.summary, converged=False, message=message))
        counts = {"iterations": 0, "increments": 0, "skipped": {}}
        return cls(state=stays, reached=False, converged=False, message=message, **counts)

    @property
    def sound(self) -> bool:
        """Whether the state is an equilibrium at the commands, without a folded or inverted element."""
        return self.reached and self.converged and self.state.summary.min_det > 0.0

    @property
    def inverted(self) -> bool:
        """Whether an element is folded or inverted, or a position is NaN."""
        return not self.state.summary.min_det > 0.0

    @property
    def flaw(self) -> str:
        """Name of the outcome's defect, for messages."""
        if self.inverted:
            return "folded or inverted elements"
        return "another equilibrium, higher in energy" if self.sound else "no equilibrium"

    def differs(self, other: March, reach: float) -> bool:
        """Return whether a vertex of the two outcomes differs by more than ``reach`` [m]."""
        return not largest_distance(self.state.positions, other.state.positions) <= reach

    def is_better(self, other: March, reach: float, *, gain: float) -> bool:
        """Return whether this outcome, which started from the undeformed body, is better than ``other``.

        If only one of the two is sound, it is the better one. If neither is sound, this outcome is better if only
        ``other`` has folded or inverted elements. If both are sound, this outcome is better if it is another
        equilibrium of no higher energy.

        Args:
            other: outcome of the same commands from another start.
            reach: distance [m] within which two equilibria count as the same.
            gain: energy and potential of ``other`` minus those of this outcome [J].
        """
        if self.sound != other.sound:
            return self.sound
        if not self.sound:
            return other.inverted and not self.inverted
        return self.differs(other, reach) and gain >= -self.SAME * other.state.summary.energy

    def counting(self, first: March, second: March) -> March:
        """Return this outcome with the iterations and increments of two outcomes, of which it is one."""
        iterations, increments = first.iterations + second.iterations, first.increments + second.increments
        return changed(self, iterations=iterations, increments=increments)

    def marked(self, *, suspect: bool) -> March:
        """Return this outcome with this mark (see `State`) and its message in its state."""
        end = self.state
        if (end.summary.converged, end.summary.message) != (self.converged, self.message):
            end = end.with_(summary=changed(end.summary, converged=self.converged, message=self.message))
        if end.suspect != suspect:
            end = end.with_(suspect=suspect)
        return self if end is self.state else changed(self, state=end)


def crumpled(state: State) -> bool:
    """Return whether elements are folded, or only fold barriers keep them open: a lower equilibrium may exist."""
    return not state.summary.min_det >= THRESHOLD
