# SPDX-License-Identifier: Apache-2.0
"""What all contacts have in common: forces that come of multipliers, and when these are known well enough."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.solver.body import Body
from gdfe_ros.solver.terms.term import Term

PENALTY = 1.0
"""Penalty at a vertex over the constant matrix' own diagonal there: enough for a few updates, and the matrix still
preconditions the descent."""
FORCE = 1e-2
"""Tolerance over the relative error of contact forces: 1 % at a tolerance of 1e-4."""
FAINT = 1e-7
"""Way over the body's size against the penalty of which a force is nothing: no descent goes as far."""


class ContactTerm(Term):
    """A contact with an obstacle, a rigid body or another part of the body.

    Args:
        name: of the term.
        body: the discretised body.
        reals, integers: of the term.

    Attributes:
        potential: its compiled energy, in which `add_forces` finds the forces.
        on_body: whether it is the elastic body that touches an obstacle.
        resolution: to what distance [m] descents must go for the forces to be known.
        share: of its multipliers, the forces at the end of a step, that is the force over a step in motion.
        missed: by how much [m] pairs of a surface missed their gaps and slips at the last update of a solve.
        gives_up: whether solves end where they are hopeless, since smaller steps may do better.
        stocky: whether nothing but the ways of a body tells how far it has to go, and updates are extrapolated.
        buried: what `flaw` saw lies deep in something, not only beyond the bound.
        hopeless: what was apart has come so deep into each other that it is not found any more.
    """

    potential: ClassVar[Callable[..., float]]
    on_body = False

    def __init__(self, name: str, body: Body, reals: NDArray[np.float64], integers: NDArray[np.int32]) -> None:
        super().__init__(name, reals, integers)
        self._body, self.resolution, self.share = body, np.inf, 1.0
        self.missed, self.gives_up, self.stocky, self.hopeless, self.buried = 0.0, False, False, False, False

    def energy(self, positions: NDArray[np.float64]) -> float:
        """Return nothing: contact stores nothing."""
        return 0.0

    def stiffen(self, vertices: NDArray[np.int32]) -> None:
        """Press harder than usual, in the next solve, on points that these vertices (k,) carry: walls act there."""

    def add_forces(self, positions: NDArray[np.float64], forces: NDArray[np.float64]) -> None:
        """Add the forces of a solve that ended at ``positions`` (n, 3) [m] to those on vertices (n, 3) [N]."""
        slopes = np.zeros_like(forces)
        self.potential(positions, self.reals, self.integers, slopes, np.zeros(1))
        forces -= slopes

    def _expect(self, presses: NDArray[np.float64], penalties: NDArray[np.float64]) -> None:
        """Set the resolution by the forces (k,) [N] of the last step."""
        on = presses > 0.0
        self.resolution = FORCE * presses[on].sum() / penalties[on].sum() if on.any() else np.inf

    def _judge(self, change: float, forces: float, penalties: float) -> float:
        """Set the resolution by the ``forces`` [N] that there are, and count their change as a distance [m].

        A relative change counts as `FORCE` times as much of the body's size.
        """
        if not forces > 0.0:
            self.resolution = np.inf
            return 0.0
        known = max(forces, FAINT * self._body.size * penalties)
        self.resolution = FORCE * known / penalties
        return FORCE * self._body.size * (change / known)
