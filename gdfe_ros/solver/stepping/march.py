# SPDX-License-Identifier: Apache-2.0
"""Outcome of a step, and the comparison of two outcomes."""

from __future__ import annotations

from dataclasses import dataclass, field

from gdfe_ros.solver.elements.barrier import THRESHOLD
from gdfe_ros.solver.solution import Found
from gdfe_ros.solver.state import State
from gdfe_ros.solver.value import changed
from gdfe_ros.solver.vectors import largest_distance


@dataclass(frozen=True, eq=False, kw_only=True)
class March(Found):
    """Outcome of following a load path.

    Attributes:
        state: state at the end; it has not converged if the commands were not reached.
        reached: whether the commands were reached.
        iterations: number of iterations of all increments.
        increments: number of attempted increments, including failed increments.
        skipped: dict from kind of work to the count that the last solve left out, as in `StepResult`.
        restarts: 1 if the load path from the undeformed body led to the state; otherwise 0.
        simulated: time [s] by which a moving body advanced; None without dynamics.
    """

    NEAR = 100.0
    """Two equilibria count as the same if their distance, divided by the tolerance, is at most this."""
    SAME = 1e-6
    """Two energies count as equal if their relative difference is at most this."""

    reached: bool
    increments: int = 0
    skipped: dict[str, int] = field(default_factory=dict)
    restarts: int = 0
    simulated: float | None = None

    @property
    def sound(self) -> bool:
        """Whether the state is an equilibrium at the commands, without a folded or inverted element."""
        return self.reached and self.converged and self.min_det > 0.0

    @property
    def inverted(self) -> bool:
        """Whether an element is folded or inverted, or a position is NaN."""
        return not self.min_det > 0.0

    @property
    def flaw(self) -> str:
        """Name of the outcome's defect, for messages."""
        if self.inverted:
            return "folded or inverted elements"
        return "another equilibrium, higher in energy" if self.sound else "no equilibrium"

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
        differs = not largest_distance(self.state.positions, other.state.positions) <= reach
        return differs and gain >= -self.SAME * other.state.summary.energy

    def counting(self, other: March) -> March:
        """Return this outcome with the iterations and increments of another one added."""
        iterations, increments = self.iterations + other.iterations, self.increments + other.increments
        return changed(self, iterations=iterations, increments=increments)

    def told(self, message: str, *, converged: bool) -> March:
        """Return this outcome with another message, and whether it has converged."""
        summary = changed(self.state.summary, converged=converged, message=message)
        return changed(self, state=self.state.with_(summary=summary))


def crumpled(state: State) -> bool:
    """Return whether elements are folded, or only fold barriers keep them open: a lower equilibrium may exist."""
    return not state.summary.min_det >= THRESHOLD
