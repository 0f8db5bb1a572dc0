# SPDX-License-Identifier: Apache-2.0
"""How far commands were followed, when that is not to be trusted, and which of two marches is the better one."""

from __future__ import annotations

from dataclasses import dataclass

from gdfe_ros.solver.distance import largest_distance
from gdfe_ros.solver.elements.folding import THRESHOLD
from gdfe_ros.solver.state import State

SAME = 1e-6
"""Energies within this share of each other count as equal."""
NEAR = 100.0
"""Positions within this many tolerances of each other are the same equilibrium."""


@dataclass(frozen=True, eq=False, kw_only=True)
class March:
    """How far the commands were followed, and what was found there.

    Attributes:
        state: where it ended.
        iterations: of all increments.
        increments: that the way was cut into, those that were tried in vain included.
        reached: the commands were reached.
        converged: the state is an equilibrium at the commands.
        message: what is wrong; empty where nothing is.
        skipped: what the last solve left out, by name.
        snapped: it ended in a jump to another equilibrium.
        restarts: 1 where the way from rest was taken instead, or none at all.
        simulated: time [s] that a body in motion went; None for one without dynamics.
    """

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

    @property
    def sound(self) -> bool:
        """Whether it is an equilibrium at the commands without a folded or inverted element."""
        return self.reached and self.converged and self.state.summary.min_det > 0.0

    @property
    def inverted(self) -> bool:
        """Whether an element is folded or inverted, or a position is not a number."""
        return not self.state.summary.min_det > 0.0

    @property
    def flaw(self) -> str:
        """What is wrong with it."""
        if self.inverted:
            return "folded or inverted elements"
        return "another equilibrium, higher in energy" if self.sound else "no equilibrium"

    def differs(self, other: March, reach: float) -> bool:
        """Tell whether a vertex of the two is farther apart than ``reach`` [m]."""
        return not largest_distance(self.state.positions, other.state.positions) <= reach

    def is_better(self, other: March, reach: float, *, gain: float) -> bool:
        """Tell whether this one, from rest, beats the ``other``: sound where that is not, or lower in energy.

        Args:
            other: on the same way, from elsewhere.
            reach: [m] within which two equilibria are one.
            gain: energy and potential of the other beyond those of this one [J].
        """
        if self.sound != other.sound:
            return self.sound
        if not self.sound:
            return other.inverted and not self.inverted
        return self.differs(other, reach) and gain >= -SAME * other.state.summary.energy


def crumpled(state: State) -> bool:
    """Tell whether elements are folded, or kept from it by walls: another equilibrium may be lower in energy."""
    return not state.summary.min_det >= THRESHOLD
