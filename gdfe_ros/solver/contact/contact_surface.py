# SPDX-License-Identifier: Apache-2.0
"""Points that are weighted sums of vertices: vertices and skin points of a body, and points of rigid bodies."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from gdfe_ros.actuators.load import corner_areas
from gdfe_ros.constraints.rigid_body import RigidBody
from gdfe_ros.mesh.cells.tetrahedra import flat_quads
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.contact.gap import SHAPE
from gdfe_ros.solver.contact.near import incidence
from gdfe_ros.solver.contact.stencil import NO_FACES

TURNED = 6.0
"""Upper bound of the displacement of a point near a rigid body, relative to this body, divided by the largest
displacement of any vertex of this body.
"""
HELD = 0.5
"""A point is driven, and left out of contact, if at least this fraction of its weights is on driven vertices."""


@dataclass(frozen=True, eq=False)
class CarriedPoints:
    """Points that are weighted sums of vertices.

    Attributes:
        carriers: (k, c) int32 vertices of each weighted sum; for a vertex, this vertex c times.
        weights: (k, c) weights of the carriers; for a vertex, the first is one.
    """

    carriers: NDArray[np.int32]
    weights: NDArray[np.float64]

    @classmethod
    def of(cls, rigid: RigidBody, places: NDArray[np.float64]) -> CarriedPoints:
        """Return points of a rigid body at ``places`` (k, 3) [m] in its frame."""
        return CarriedPoints(np.tile(rigid.vertices, (len(places), 1)), 0.25 + places @ rigid.signs.T)

    @cached_property
    def vertices(self) -> NDArray[np.int32]:
        """For each point (k,), its carrier with the largest weight."""
        most = np.abs(self.weights).argmax(axis=1)
        return self.carriers[np.arange(len(most)), most]

    @cached_property
    def reach(self) -> float:
        """Upper bound of a point's displacement, divided by the largest displacement of its carriers.

        It exceeds 1 for points outside their cell.
        """
        return max(1.0, float(np.abs(self.weights).sum(axis=1).max(initial=0.0)))

    def at(self, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the positions (k, 3) [m] of the points for vertices at ``positions`` (n, 3) [m]."""
        return np.einsum("ka,kai->ki", self.weights, positions[self.carriers])

    def compliance(self, body: Body, diagonal: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the compliance (k,) [m/N] of the points, from the constant matrix' diagonal (n,) [N/m].

        A point's compliance is the sum of its free carriers' compliances times their squared weights. Points with
        several carriers divide the stiffness of carriers that they have in common. The compliance is 0 if handles drive
        all carriers.
        """
        squares = np.where(driven_vertices(body)[self.carriers], 0.0, self.weights**2)
        alone = (squares / diagonal[self.carriers]).sum(axis=1)
        asked, shared = np.zeros_like(diagonal), np.count_nonzero(self.weights, axis=1) > 1
        taken = squares / np.where(alone > 0.0, alone, np.inf)[:, None]
        np.add.at(asked, self.carriers[shared], taken[shared])
        crowd = np.where(squares > 0.0, (asked / diagonal)[self.carriers], 0.0).max(axis=1, initial=0.0)
        return alone * np.maximum(crowd, 1.0)


@dataclass(frozen=True, eq=False)
class BodyPoints(CarriedPoints):
    """The n vertices of a body, followed by the p contact points of its skins.

    Attributes:
        count: number n of vertices.
        numbers: (n + p,) int32 number of each contact point; -1 for a vertex.
    """

    count: int
    numbers: NDArray[np.int32]

    @classmethod
    def of(cls, body: Body) -> BodyPoints:
        """Return the points of a body."""
        own, skin = np.arange(len(body.rest), dtype=np.int32)[:, None], body.skin
        if skin is None:
            return cls(own, np.ones(own.shape), len(own), np.full(len(own), -1, np.int32))
        carriers, weights = np.repeat(own, 8, axis=1), np.tile(np.eye(1, 8), (len(own), 1))
        numbers = np.concatenate([np.full(len(own), -1), np.arange(len(skin.corners))]).astype(np.int32)
        whole = np.concatenate([carriers, skin.corners]), np.concatenate([weights, skin.weights])
        return cls(*whole, len(own), numbers)

    def at(self, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return all points (n + p, 3) [m] for vertices at ``positions`` (n, 3) [m]."""
        carriers, weights = self.carriers[self.count :], self.weights[self.count :]
        if not len(carriers):
            return positions
        return np.concatenate([positions, np.einsum("pa,pai->pi", weights, positions[carriers])])

    def around(self, cells: NDArray[np.int32], chosen: NDArray[np.int32]) -> sparse.csr_matrix:
        """Return a sparse matrix (k, n + p) with the points around each of the ``chosen`` cells (k, c).

        These are the points of all cells that share a vertex with the chosen cell.

        ``cells`` (m, c) are the vertices of all cells.
        """
        own, every = incidence(chosen, self.count), incidence(cells, self.count)
        skin = incidence(self.carriers[self.count :], self.count)
        near = sparse.hstack([own @ every.T @ every, own @ skin.T]).tocsr()
        near.sort_indices()
        return near


@dataclass(frozen=True, eq=False)
class ContactSurface(CarriedPoints):
    """The boundary of a body with its skins, without the points and faces that handles drive.

    Attributes:
        areas: (k,) [m^2] undeformed area of faces assigned to each vertex. It is infinite for a skin point, so that
            integrals over faces have no effect on the point.
        points: (k,) int32 index of each point among the mesh's skin points, -1 for a vertex.
        quads: (q, 4) int32 faces that are no part of a skin, whose points get offsets of gaps; none for tetrahedra,
            because their faces are curved. With such offsets, faces of tetrahedra entered a ball by 4 to 9 % of the
            ball's depth.
        gauss: (q, 4) [m^2] undeformed area of each Gauss point.
    """

    areas: NDArray[np.float64]
    points: NDArray[np.int32]
    quads: NDArray[np.int32]
    gauss: NDArray[np.float64]

    @classmethod
    def of(cls, body: Body) -> ContactSurface:
        """Return the contact surface of a body."""
        faces, driven, every = body.cell_type.boundary(body.cells).quads, driven_vertices(body), BodyPoints.of(body)
        if body.skin is not None:
            faces = body.skin.without(faces)
        faces = faces[~driven[faces].all(axis=1)]
        quads = flat_quads(faces).astype(np.int32)
        shares = corner_areas(body.rest, quads)
        areas = np.full(len(every.carriers), np.inf)
        areas[: every.count] = np.bincount(quads.ravel(), weights=shares.ravel(), minlength=every.count)
        size = np.abs(every.weights)
        free = (size * driven[every.carriers]).sum(axis=1) < HELD * size.sum(axis=1)
        chosen = np.flatnonzero((areas > 0.0) & free)
        if faces.shape[1] == 6:
            quads, shares = quads[:0], shares[:0]
        given = every.carriers[chosen], every.weights[chosen], areas[chosen], every.numbers[chosen]
        return cls(*given, quads, np.linalg.solve(SHAPE.T, shares.T).T)

    def about(self, points: NDArray[np.int64]) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
        """Return the faces (f, 4) that have one of ``points`` as a corner, and the areas (f, 4) of their Gauss points.

        Skin points are ignored.
        """
        if not len(points):
            return NO_FACES
        corners = self.carriers[points[np.isfinite(self.areas[points])], 0]
        chosen = np.isin(self.quads, corners).any(axis=1)
        return self.quads[chosen], self.gauss[chosen]


def driven_vertices(body: Body) -> NDArray[np.bool_]:
    """Return whether a handle drives each vertex (n,) in all directions."""
    driven = np.zeros(len(body.rest), dtype=bool)
    for handle in body.handles:
        driven[handle.vertices] = not handle.loose
    return driven
