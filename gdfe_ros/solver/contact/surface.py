# SPDX-License-Identifier: Apache-2.0
"""The contact surface of a body, and the contact points of a rigid body."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.actuators.load import GAUSS, corner_areas
from gdfe_ros.constraints.rigid_body import RigidBody
from gdfe_ros.mesh.tet_faces import flat_quads
from gdfe_ros.solver.body import Body

SIGNS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
SHAPE = np.stack([0.25 * (1.0 + GAUSS * SIGNS * point).prod(axis=1) for point in SIGNS])
"""(4, 4) weights of a face's corners at each of its Gauss points."""

TURNED = 6.0
"""Upper bound of the displacement of a rigid body's point, divided by the largest displacement of any vertex. The bound
also holds for the displacement relative to another rigid body.
"""


@dataclass(frozen=True, eq=False)
class ContactSurface:
    """The boundary of a body, without the faces that handles drive and without the faces that a skin represents.

    Attributes:
        carriers: (k, 1) int32 vertices that are not driven, sorted.
        weights: (k, 1) ones.
        areas: (k,) [m^2] undeformed area of the surface that belongs to each vertex.
        quads: (q, 4) int32 faces.
        gauss: (q, 4) [m^2] undeformed area that belongs to each Gauss point.
        spread: (n,) [m^2] undeformed area that belongs to each vertex of the body.
    """

    carriers: NDArray[np.int32]
    weights: NDArray[np.float64]
    areas: NDArray[np.float64]
    quads: NDArray[np.int32]
    gauss: NDArray[np.float64]
    spread: NDArray[np.float64]

    @classmethod
    def of(cls, body: Body) -> ContactSurface:
        """Return the contact surface of a body."""
        quads, driven = body.cell_type.boundary(body.cells).quads, driven_vertices(body)
        if quads.shape[1] == 6:
            return cls._of_nodes(body, quads[~driven[quads].all(axis=1)], driven)
        if body.skin is not None:
            quads = body.skin.without(quads)
        quads = quads[~driven[quads].all(axis=1)]
        shares = corner_areas(body.rest, quads)
        spread = np.bincount(quads.ravel(), weights=shares.ravel(), minlength=len(body.rest))
        vertices = np.flatnonzero((spread > 0.0) & ~driven).astype(np.int32)
        gauss = np.linalg.solve(SHAPE.T, shares.T).T
        weights = np.ones((len(vertices), 1))
        return ContactSurface(vertices[:, None], weights, spread[vertices], quads.astype(np.int32), gauss, spread)

    @classmethod
    def _of_nodes(cls, body: Body, faces: NDArray[np.int32], driven: NDArray[np.bool_]) -> ContactSurface:
        """Return the surface of tetrahedra: all six nodes of each face touch.

        Gaps have no offset, because the faces are curved themselves. In a prototype with offsets, faces
        entered a ball between their nodes by 4 to 9 % of the depth of the ball in the body.
        """
        flat = flat_quads(faces)
        shares = corner_areas(body.rest, flat)
        spread = np.bincount(flat.ravel(), weights=shares.ravel(), minlength=len(body.rest))
        vertices = np.flatnonzero((spread > 0.0) & ~driven).astype(np.int32)
        none = np.zeros((0, 4))
        ones = np.ones((len(vertices), 1))
        return ContactSurface(vertices[:, None], ones, spread[vertices], none.astype(np.int32), none, spread)

    @property
    def vertices(self) -> NDArray[np.int32]:
        """The vertex of each point (k,)."""
        return self.carriers[:, 0]

    @property
    def reach(self) -> float:
        """Upper bound of a point's displacement, divided by its carrier's: 1, because each point is a vertex."""
        return 1.0

    def at(self, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the positions of the points (k, 3) [m]."""
        return positions[self.carriers[:, 0]]

    def stiffness(self, diagonal: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the constant matrix' diagonal (n,) [N/m] at the points (k,)."""
        return diagonal[self.carriers[:, 0]]

    def about(self, points: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the faces that have one of ``points`` as a corner."""
        chosen = np.zeros(len(self.spread), dtype=bool)
        chosen[self.carriers[points, 0]] = True
        return np.flatnonzero(chosen[self.quads].any(axis=1))


def driven_vertices(body: Body) -> NDArray[np.bool_]:
    """Return whether a handle drives each vertex (n,) in all directions."""
    driven = np.zeros(len(body.rest), dtype=bool)
    for handle in body.handles:
        driven[handle.vertices] = not handle.loose
    return driven


@dataclass(frozen=True, eq=False)
class Corners:
    """Contact points that move with a rigid body.

    Attributes:
        carriers: (k, 4) int32 the body's four vertices.
        weights: (k, 4) weights of the four vertices at each point.
        reach: bound of a point's displacement divided by the largest displacement of its carriers.
    """

    carriers: NDArray[np.int32]
    weights: NDArray[np.float64]
    reach = TURNED

    @classmethod
    def of(cls, rigid: RigidBody) -> Corners:
        """Return the corners of a rigid body, for contact with obstacles."""
        return cls._at(rigid, rigid.form.corners)

    @classmethod
    def over(cls, rigid: RigidBody) -> Corners:
        """Return points all over the surface of a rigid body, for contact with other rigid bodies."""
        return cls._at(rigid, rigid.form.skin)

    @classmethod
    def _at(cls, rigid: RigidBody, points: NDArray[np.float64]) -> Corners:
        return cls(np.tile(rigid.vertices, (len(points), 1)), 0.25 + points @ rigid.signs.T)

    def at(self, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the positions of the points (k, 3) [m]."""
        return self.weights @ positions[self.carriers[0]]

    def stiffness(self, diagonal: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the sum of the constant matrix' diagonal (n,) [N/m] over the four vertices, for each point (k,)."""
        return np.full(len(self.carriers), diagonal[self.carriers[0]].sum())

    def about(self, points: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return no faces: the points of a rigid body need no correction for faces."""
        return np.zeros(0, dtype=np.int64)
