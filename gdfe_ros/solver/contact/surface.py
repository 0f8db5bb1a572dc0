# SPDX-License-Identifier: Apache-2.0
"""The surface of a body, as contact sees it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.actuators.load import GAUSS, corner_areas
from gdfe_ros.constraints.rigid_body import RigidBody
from gdfe_ros.mesh.faces import boundary_faces
from gdfe_ros.solver.body import Body

SIGNS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
SHAPE = np.stack([0.25 * (1.0 + GAUSS * SIGNS * point).prod(axis=1) for point in SIGNS])
"""(4, 4) weights of a face's corners at each of its Gauss points."""

TURNED = 6.0
"""By how much farther a point of a rigid body may move than the vertices that it is, and against another one."""


@dataclass(frozen=True, eq=False)
class Surface:
    """The boundary of a body without the faces that handles drive, or that a skin touches for.

    Attributes:
        carriers: (k, 1) int32 vertices that are not driven, sorted.
        weights: (k, 1) which are one.
        areas: (k,) [m^2] at rest, each one's share of the surface.
        quads: (q, 4) int32 vertices of the faces.
        gauss: (q, 4) [m^2] at rest, the share of each Gauss point.
        spread: (n,) [m^2] at rest, of all the body's vertices.
    """

    carriers: NDArray[np.int32]
    weights: NDArray[np.float64]
    areas: NDArray[np.float64]
    quads: NDArray[np.int32]
    gauss: NDArray[np.float64]
    spread: NDArray[np.float64]

    @classmethod
    def of(cls, body: Body) -> Surface:
        """Return the surface of a body."""
        quads, driven = boundary_faces(body.cells).quads, driven_vertices(body)
        if body.skin is not None:
            quads = quads[~np.isin(quads[:, 0], body.skin.vertices)]
        quads = quads[~driven[quads].all(axis=1)]
        shares = corner_areas(body.rest, quads)
        spread = np.bincount(quads.ravel(), weights=shares.ravel(), minlength=len(body.rest))
        vertices = np.flatnonzero((spread > 0.0) & ~driven).astype(np.int32)
        gauss = np.linalg.solve(SHAPE.T, shares.T).T
        weights = np.ones((len(vertices), 1))
        return Surface(vertices[:, None], weights, spread[vertices], quads.astype(np.int32), gauss, spread)

    @property
    def vertices(self) -> NDArray[np.int32]:
        """The vertex that each point is (k,)."""
        return self.carriers[:, 0]

    @property
    def reach(self) -> float:
        """How much farther a point may move than the vertices that carry it."""
        return 1.0

    def at(self, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return where the points are (k, 3) [m]."""
        return positions[self.carriers[:, 0]]

    def stiffness(self, diagonal: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the constant matrix' diagonal (n,) [N/m] at the points (k,)."""
        return diagonal[self.carriers[:, 0]]

    def about(self, points: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return which faces have one of some points."""
        chosen = np.zeros(len(self.spread), dtype=bool)
        chosen[self.carriers[points, 0]] = True
        return np.flatnonzero(chosen[self.quads].any(axis=1))


def driven_vertices(body: Body) -> NDArray[np.bool_]:
    """Tell which vertices (n,) handles drive in all directions."""
    driven = np.zeros(len(body.rest), dtype=bool)
    for handle in body.handles:
        driven[handle.vertices] = not (handle.free or handle.turning)
    return driven


@dataclass(frozen=True, eq=False)
class Corners:
    """Points that move with a rigid body.

    Attributes:
        carriers: (k, 4) int32 vertices of the body.
        weights: (k, 4) of these at each point.
    """

    carriers: NDArray[np.int32]
    weights: NDArray[np.float64]
    reach = TURNED

    @classmethod
    def of(cls, rigid: RigidBody) -> Corners:
        """Return the corners of a rigid body, which touch obstacles."""
        return cls._at(rigid, rigid.form.corners)

    @classmethod
    def over(cls, rigid: RigidBody) -> Corners:
        """Return points all over a rigid body, which touch other rigid bodies."""
        return cls._at(rigid, rigid.form.skin)

    @classmethod
    def _at(cls, rigid: RigidBody, points: NDArray[np.float64]) -> Corners:
        return cls(np.tile(rigid.vertices, (len(points), 1)), 0.25 + points @ rigid.signs.T)

    def at(self, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return where the points are (k, 3) [m]."""
        return self.weights @ positions[self.carriers[0]]

    def stiffness(self, diagonal: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the constant matrix' diagonal (n,) [N/m] of the whole body, for each point (k,)."""
        return np.full(len(self.carriers), diagonal[self.carriers[0]].sum())

    def about(self, points: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return no faces: corners are what they are."""
        return np.zeros(0, dtype=np.int64)
