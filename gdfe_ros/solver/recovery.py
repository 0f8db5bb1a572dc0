# SPDX-License-Identifier: Apache-2.0
"""When a march to new commands is not to be trusted, and which of two marches is the better one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gdfe_ros.solver.outcome import Outcome, State

SAME = 1e-6
"""Energies within this share of each other count as equal."""
NEAR = 100.0
"""Positions within this many tolerances of each other are the same equilibrium."""


@dataclass(frozen=True)
class March:
    """How far the commands were followed, and what was found there.

    Attributes:
        outcome: of the last solve.
        state: of the elements there.
        iterations: of all substeps.
        substeps: increments that the way was cut into.
        reached: the commands were reached.
    """

    outcome: Outcome
    state: State
    iterations: int
    substeps: int
    reached: bool

    @property
    def sound(self) -> bool:
        """Whether it is an equilibrium at the commands without an inverted element."""
        return self.reached and self.outcome.converged and self.state.min_det > 0.0

    @property
    def inverted(self) -> bool:
        """Whether an element is inverted or a position is not a number."""
        return not self.state.min_det > 0.0

    @property
    def flaw(self) -> str:
        """What is wrong with it."""
        if self.inverted:
            return "inverted elements"
        return "another equilibrium, higher in energy" if self.sound else "no equilibrium"

    @property
    def message(self) -> str:
        """Why it is not to be relied on; empty where it is."""
        if not self.state.min_det <= 0.0:
            return self.outcome.message
        return f"{self.outcome.message}; inverted elements, least det F {self.state.min_det:.3g}".lstrip("; ")

    def differs(self, other: March, reach: float) -> bool:
        """Tell whether a vertex of the two is farther apart than ``reach`` [m]."""
        distance = np.linalg.norm(self.outcome.positions - other.outcome.positions, axis=1).max()
        return not distance <= reach


def is_better(again: March, march: March, reach: float) -> bool:
    """Tell whether the march from rest beats the one before it: sound where that was not, or lower in energy."""
    if again.sound != march.sound:
        return again.sound
    if not again.sound:
        return march.inverted and not again.inverted
    return again.differs(march, reach) and again.state.energy <= march.state.energy * (1.0 + SAME)
