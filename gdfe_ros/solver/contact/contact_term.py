# SPDX-License-Identifier: Apache-2.0
"""Base class of the contact terms: contact forces from multipliers, and the required accuracy of these forces.

The penalty of a vertex is the constant matrix' diagonal at the vertex. A few updates of the multipliers then suffice,
and the constant matrix still preconditions the minimisation.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.solver.body import Body
from gdfe_ros.solver.terms.term import Term

FORCE = 1e-2
"""The solver's tolerance divided by the relative tolerance of contact forces. A solver tolerance of 1e-4 thus allows
an error of 1 % in the contact forces."""
FAINT = 1e-7
"""Displacement, divided by the body's size, that counts as zero. The penalty force of this displacement counts as zero,
too. No minimisation resolves less.
"""


class ContactTerm(Term):
    """Contact with an obstacle, with a rigid body, or between parts of the body.

    Args:
        name: name of the term.
        body: the discretised body.
        reals, integers: arrays that the compiled kernels read.

    Attributes:
        potential: the compiled energy; `add_forces` computes the forces as its gradient.
        on_body: whether the points of the term belong to the elastic body; False for self-contact.
        resolution: error [m] of the displacements up to which the contact forces are accurate enough.
        share: effective contact force over a step with dynamics, divided by the multipliers. The multipliers are the
            forces at the end of the step.
        missed: largest error [m] in gap or slip of a self-contact pair at the last update of a solve.
        gives_up: whether the term determines ``hopeless``. A hopeless solve ends at once, because smaller increments
            may succeed.
        buried: whether the penetration that `flaw` found is too deep even for a step that has not converged.
        hopeless: whether vertices have penetrated so deeply that the search finds no face for them any more.
    """

    potential: ClassVar[Callable[..., float]]
    on_body = False

    def __init__(self, name: str, body: Body, reals: NDArray[np.float64], integers: NDArray[np.int32]) -> None:
        super().__init__(name, reals, integers)
        self._body, self.resolution, self.share = body, np.inf, 1.0
        self.missed, self.gives_up, self.hopeless, self.buried = 0.0, False, False, False

    def ends(self) -> NDArray[np.int32]:
        """Return the vertices (k, c) on which each point's force acts; empty for self-contact."""
        return np.zeros((0, 1), np.int32)

    def energy(self, positions: NDArray[np.float64]) -> float:
        """Return 0: contact stores no energy."""
        return 0.0

    def add_forces(self, positions: NDArray[np.float64], forces: NDArray[np.float64]) -> None:
        """Add the contact forces at the final ``positions`` (n, 3) [m] of a solve to ``forces`` (n, 3) [N]."""
        slopes = np.zeros_like(forces)
        self.potential(positions, self.reals, self.integers, slopes, np.zeros(1))
        forces -= slopes

    def _expect(self, presses: NDArray[np.float64], penalties: NDArray[np.float64]) -> None:
        """Set the resolution from the last step's normal forces (k,) [N] and the points' penalties (k,) [N/m]."""
        on = presses > 0.0
        self.resolution = FORCE * presses[on].sum() / penalties[on].sum() if on.any() else np.inf

    def _judge(self, change: float, forces: float, penalties: float) -> float:
        """Set the resolution, and return the ``change`` [N] of the contact forces as a distance [m].

        The distance is `FORCE` times the body's size times the relative change. ``forces`` [N] is the sum of the normal
        forces, and ``penalties`` [N/m] the sum of the pressing points' penalties.
        """
        if not forces > 0.0:
            self.resolution = np.inf
            return 0.0
        known = max(forces, FAINT * self._body.size * penalties)
        self.resolution = FORCE * known / penalties
        return FORCE * self._body.size * (change / known)
