# SPDX-License-Identifier: Apache-2.0
"""Base class of the contact terms: forces by multipliers, and the accuracy to which they must be known."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.solver.body import Body
from gdfe_ros.solver.terms.term import Term

PENALTY = 1.0
"""Penalty over the constant matrix' diagonal at a vertex: a few updates suffice, and the constant matrix still
preconditions the minimisation."""
FORCE = 1e-2
"""The solver's tolerance over the relative tolerance of contact forces: a tolerance of 1e-4 requires forces to 1 %."""
FAINT = 1e-7
"""Displacement, over the body's size, that counts as zero, as does the penalty force it causes. No minimisation
resolves less.
"""


class ContactTerm(Term):
    """Contact with an obstacle, with a rigid body, or between parts of the body.

    Args:
        name: name of the term.
        body: the discretised body.
        reals, integers: arrays that the compiled kernels read.

    Attributes:
        potential: the compiled energy; `add_forces` computes the forces as its gradient.
        on_body: whether the elastic body touches an obstacle.
        resolution: displacement [m] to which a minimisation must converge so that the forces are known.
        share: force over a step in motion, divided by the multipliers, which are the forces at the end of the step.
        missed: largest error [m] in gap or slip of a self-contact pair at the last update of a solve.
        gives_up: whether hopeless solves end at once, because smaller steps may succeed.
        stocky: whether the minimiser does not certify the distance to the equilibrium. Displacements then measure the
            remaining distance, and updates are extrapolated.
        buried: whether the penetration that `flaw` found is deep, not only above the tolerance.
        hopeless: whether separate parts have penetrated so deeply that the search finds no pair for them any more.
    """

    potential: ClassVar[Callable[..., float]]
    on_body = False

    def __init__(self, name: str, body: Body, reals: NDArray[np.float64], integers: NDArray[np.int32]) -> None:
        super().__init__(name, reals, integers)
        self._body, self.resolution, self.share = body, np.inf, 1.0
        self.missed, self.gives_up, self.stocky, self.hopeless, self.buried = 0.0, False, False, False, False

    def energy(self, positions: NDArray[np.float64]) -> float:
        """Return 0: contact stores no energy."""
        return 0.0

    def stiffen(self, vertices: NDArray[np.int32]) -> None:
        """Raise the penalties of points carried by ``vertices`` (k,) in the next solve; fold barriers act on these."""

    def add_forces(self, positions: NDArray[np.float64], forces: NDArray[np.float64]) -> None:
        """Add the contact forces of a solve that ended at ``positions`` (n, 3) [m] to ``forces`` (n, 3) [N]."""
        slopes = np.zeros_like(forces)
        self.potential(positions, self.reals, self.integers, slopes, np.zeros(1))
        forces -= slopes

    def _expect(self, presses: NDArray[np.float64], penalties: NDArray[np.float64]) -> None:
        """Set the resolution from the normal forces (k,) [N] of the last step and their penalties [N/m]."""
        on = presses > 0.0
        self.resolution = FORCE * presses[on].sum() / penalties[on].sum() if on.any() else np.inf

    def _judge(self, change: float, forces: float, penalties: float) -> float:
        """Set the resolution from the sum of ``forces`` [N], and return their ``change`` [N] as a distance [m].

        The distance is `FORCE` times the body's size times the relative change.
        """
        if not forces > 0.0:
            self.resolution = np.inf
            return 0.0
        known = max(forces, FAINT * self._body.size * penalties)
        self.resolution = FORCE * known / penalties
        return FORCE * self._body.size * (change / known)
