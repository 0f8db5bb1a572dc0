# SPDX-License-Identifier: Apache-2.0
"""Base class of the contact terms, and what the complementarity problem needs of their points."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.solver.body import Body
from gdfe_ros.solver.state import State
from gdfe_ros.solver.terms.term import Term

FAINT = 1e-7
"""Displacement, divided by the body's size, that counts as zero."""
MARGIN = 1e-3
"""Points take part in a step's complementarity problem if their gap after the step without new forces, divided by the
body's size, is below this. Others that would enter join in further rounds.
"""


class Stencils(NamedTuple):
    """The contact points, or pairs, that are near.

    Attributes:
        places: (k, 3) [m] gap, and slip along two tangents.
        axes: (k, 3, 3) gradient of the gap, and the tangents.
        held: (k, 3) [N] present forces along these axes.
        soft: (k,) [m/N] compliance of the spring through which the normal force acts.
        ends: (k, c) vertices that move the point relative to what it touches.
        pressing, rubbing: (k, c) weights of these vertices in the displacements that change the gap, and the slip.
    """

    places: NDArray[np.float64]
    axes: NDArray[np.float64]
    held: NDArray[np.float64]
    soft: NDArray[np.float64]
    ends: NDArray[np.int64]
    pressing: NDArray[np.float64]
    rubbing: NDArray[np.float64]

    @classmethod
    def empty(cls, count: int, width: int) -> Self:
        """Return arrays for ``count`` points with ``width`` vertices each, to be written."""
        places, axes, held, soft = (np.empty((count, *shape)) for shape in ((3,), (3, 3), (3,), ()))
        weights = np.empty((2, count, width))
        return cls(places, axes, held, soft, np.empty((count, width), np.int64), *weights)


class ContactTerm(Term):
    """Contact with an obstacle, with a rigid body, or between parts of the body.

    Args:
        name: name of the term.
        body: the discretised body.
        reals, integers: arrays that the compiled kernels read.

    Attributes:
        potential: the compiled energy; `add_forces` computes the forces as its gradient.
        on_body: whether the points of the term belong to the elastic body; False for self-contact.
        restitution: ratio of the normal speeds of a point after and before an impact.
        valid: relative displacement [m] for which the stencils of the points hold.
        changed: whether points that press touch other faces since `follow` was last called.
    """

    potential: ClassVar[Callable[..., float]]
    on_body = False
    _FRICTION: ClassVar[int]
    _HEAD: ClassVar[int]
    _STRIDE: ClassVar[int]
    _PRESS: ClassVar[int]

    def __init__(self, name: str, body: Body, reals: NDArray[np.float64], integers: NDArray[np.int32]) -> None:
        super().__init__(name, reals, integers)
        self._body, self.restitution, self.valid, self.changed = body, 0.0, np.inf, False
        self._chosen = np.zeros(0, dtype=np.int64)

    @property
    def near(self) -> bool:
        """Whether any point or pair is near what it can touch."""
        return len(self._chosen) > 0

    @property
    def count(self) -> int:
        """Number of points or pairs that are near."""
        return len(self._chosen)

    @property
    def friction(self) -> float:
        """Coulomb's coefficient."""
        return float(self.reals[self._FRICTION])

    @property
    def acts(self) -> bool:
        """Whether any point or pair holds a force."""
        return bool(self._rows()[:, self._PRESS].any())

    @property
    def delicate(self) -> bool:
        """Whether friction acts on a point or pair that is near."""
        return self.near and self.friction > 0.0

    def _rows(self) -> NDArray[np.float64]:
        """Return the rows (k, stride) of the near points or pairs, a view."""
        return self.reals[self._HEAD : self._HEAD + self._STRIDE * len(self._chosen)].reshape(-1, self._STRIDE)

    def ends(self) -> NDArray[np.int32]:
        """Return the vertices (k, c) on which the points' forces can act."""
        raise NotImplementedError

    def present_stencils(self, positions: NDArray[np.float64]) -> Stencils:
        """Return the stencils at ``positions`` (n, 3) [m], with friction at the present places."""
        return self.stencils(positions)

    def led(self, positions: NDArray[np.float64], before: State) -> NDArray[np.float64]:
        """Return the displacement (k, 3) [m] of what commanded poses move, at the near points, since ``before``."""
        return np.zeros((self.count, 3))

    def energy(self, positions: NDArray[np.float64]) -> float:
        """Return 0: contact stores no energy."""
        return 0.0

    def add_forces(self, positions: NDArray[np.float64], forces: NDArray[np.float64]) -> None:
        """Add the contact forces at the final ``positions`` (n, 3) [m] of a solve to ``forces`` (n, 3) [N]."""
        slopes = np.zeros_like(forces)
        self.potential(positions, self.reals, self.integers, slopes, np.zeros(1))
        forces -= slopes
