# SPDX-License-Identifier: Apache-2.0
"""Choice of a skin's contact points: for each boundary vertex, the point in which the vertex has the largest weight."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gdfe_ros.mesh.outside import hang
from gdfe_ros.mesh.refinement import refine
from gdfe_ros.mesh.shape import cell_volumes

if TYPE_CHECKING:
    from gdfe_ros.mesh.hexmesh import HexMesh

FINE, SMALL = 0.25, 0.1
"""FINE: longest edge of a refined skin's triangles, divided by a quantile of the sizes of the boundary cells. SMALL:
level of this quantile.
"""
CREASE = np.cos(np.radians(30.0))
"""The common edge of two triangles is a crease if the cosine between their normals is below this. A point without
creases is a tip, as that of a cone, if the cosine between its normal and that of a triangle around it is below this.
"""
FARTHEST = np.array([0.5, 0.75, 1.0])
"""A further point is chosen if its distance to the nearest chosen point, divided by the size of its cell, exceeds this.
The three values are for a corner, for a crease point, and for any other point.
"""
NEAR = 8
"""Number of nearest chosen points among which a point on the same side of a wall is searched."""
ALIKE = -1e-9
"""Two points count as on the same side of a wall if the cosine between their normals exceeds this. The value is
slightly negative, so that points with perpendicular normals are included.
"""
PLACE = 1e-12
"""Tolerance of a skin point's reference coordinates in its cell."""


@dataclass(frozen=True, eq=False)
class SkinPoints:
    """Points of a skin, and the cell that carries each point.

    Attributes:
        places: (k, 3) positions [m].
        normals: (k, 3) unit vectors out of the material.
        triangles: (t, 3) triangles of these points.
        creases: (e, 2) ends of the edges at which neighbouring triangles form a crease.
        kinds: (k,) 0 for a corner, 1 for a crease point, 2 for any other point.
        corners: (k, 8) vertices of the cell that carries each point.
        weights: (k, 8) weights of these vertices.
        sizes: (k,) edge of a cube with the volume of the point's cell [m].
    """

    places: NDArray[np.float64]
    normals: NDArray[np.float64]
    triangles: NDArray[np.int64]
    creases: NDArray[np.int64]
    kinds: NDArray[np.int64]
    corners: NDArray[np.int32]
    weights: NDArray[np.float64]
    sizes: NDArray[np.float64]

    @classmethod
    def of(cls, mesh: HexMesh, points: NDArray[np.float64], triangles: NDArray[np.int64]) -> SkinPoints:
        """Return the points of a closed surface after its refinement.

        ``triangles`` (t, 3) are ids of ``points`` (n, 3) [m], oriented out of the material.
        """
        sizes = np.cbrt(cell_volumes(mesh))
        points, triangles = refine(points, triangles, FINE * float(np.quantile(sizes[mesh.boundary.cells], SMALL)))
        areas = 0.5 * np.cross(*(points[triangles[:, i]] - points[triangles[:, 0]] for i in (1, 2)))
        slopes = np.zeros_like(points)
        for i in range(3):
            np.add.at(slopes, triangles[:, i], areas)
        used, local = np.unique(triangles, return_inverse=True)
        triangles = local.reshape(triangles.shape)
        facing, normals = _unit(areas), _unit(slopes[used])
        creases = _creases(triangles, facing)
        cells, weights = hang(mesh.vertices, mesh.cells, points[used], within=PLACE)
        return cls(
            places=points[used],
            normals=normals,
            triangles=triangles,
            creases=creases,
            kinds=_kinds(creases, _tips(triangles, facing, normals)),
            corners=mesh.cells[cells],
            weights=weights,
            sizes=sizes[cells],
        )

    def touching(self, mesh: HexMesh) -> NDArray[np.intp]:
        """Return the indices (p,) of the contact points among the skin points.

        Each boundary vertex gets a contact point. A vertex without one would be supported by the material of its cells
        only, and a vertex with little material would pull the skin into the obstacle. If the cells are too coarse for
        the surface, points that are far from all contact points are added.
        """
        vertices, normals = _boundary(mesh)
        own = np.full(mesh.n_vertices, -1)
        own[vertices] = np.arange(len(vertices))
        own = own[self.corners]
        alike = np.einsum("kai,ki->ka", normals[own], self.normals) > ALIKE
        point, corner = np.nonzero((own >= 0) & alike)
        vertex, weight = own[point, corner], self.weights[point, corner]
        order = np.lexsort((point, self.kinds[point], -np.round(weight, 9), vertex))
        first = order[np.unique(vertex[order], return_index=True)[1]]
        return self._completed(self._cornered(np.unique(point[first])))

    def _cornered(self, chosen: NDArray[np.intp]) -> NDArray[np.intp]:
        """Return the chosen points; each corner of the skin replaces the nearest chosen point if this point is close.

        A chosen point that is a corner is not replaced.
        """
        tree, found = cKDTree(self.places[chosen]), chosen.copy()
        for corner in np.setdiff1d(np.flatnonzero(self.kinds == 0), chosen):
            limit = FARTHEST[0] * self.sizes[corner]
            away, near = tree.query(self.places[corner], k=min(NEAR, len(chosen)), distance_upper_bound=limit)
            near = np.atleast_1d(near)[np.isfinite(np.atleast_1d(away))]
            alike = self.normals[found[near]] @ self.normals[corner] > ALIKE
            near = near[alike]
            if len(near) and self.kinds[found[near[0]]] > 0:
                found[near[0]] = corner
        return np.unique(found)

    def _completed(self, chosen: NDArray[np.intp]) -> NDArray[np.intp]:
        """Return the chosen points and further points; each skin point is within `FARTHEST` of a returned point."""
        limits = FARTHEST[self.kinds] * self.sizes
        near = cKDTree(self.places[chosen]).query(self.places, k=min(NEAR, len(chosen)))[1]
        near = chosen[near.reshape(len(self.places), -1)]
        away = np.linalg.norm(self.places[near] - self.places[:, None], axis=2)
        alike = np.einsum("kni,ki->kn", self.normals[near], self.normals) > ALIKE
        lost = np.flatnonzero(np.where(alike, away, np.inf).min(axis=1) > limits)
        added: list[int] = []
        for number in lost[np.lexsort((lost, self.kinds[lost]))]:
            others = np.array(added, dtype=np.intp)
            close = np.linalg.norm(self.places[others] - self.places[number], axis=1) <= limits[number]
            if not (close & (self.normals[others] @ self.normals[number] > ALIKE)).any():
                added.append(int(number))
        return np.concatenate([chosen, np.array(added, dtype=np.intp)])


def _creases(triangles: NDArray[np.int64], normals: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the edges (e, 2) at which two triangles (t, 3) with unit ``normals`` (t, 3) form a crease."""
    edges = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    order = np.lexsort((edges[:, 1], edges[:, 0]))
    edges, owner = edges[order], order // 3
    paired = (edges[:-1] == edges[1:]).all(axis=1)
    bent = np.einsum("ei,ei->e", normals[owner[:-1]], normals[owner[1:]]) < CREASE
    return edges[:-1][paired & bent]


def _tips(triangles: NDArray[np.int64], normals: NDArray[np.float64], own: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which points, with the normals ``own`` (k, 3), are tips between triangles with ``normals`` (t, 3)."""
    least = np.ones(len(own))
    for i in range(3):
        np.minimum.at(least, triangles[:, i], np.einsum("ti,ti->t", own[triangles[:, i]], normals))
    return least < CREASE


def _kinds(creases: NDArray[np.int64], tips: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return the kind of each point: 1, a crease point with two creases; 0, a corner or a tip; 2, any other point."""
    creases = np.bincount(creases.ravel(), minlength=len(tips))
    return np.where((creases == 0) & ~tips, 2, np.where(creases == 2, 1, 0))


def _boundary(mesh: HexMesh) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Return the boundary vertices (v,) of a mesh and their outward unit normals (v, 3).

    A normal is zero if the area vectors of the faces at the vertex cancel.
    """
    quads, vectors = mesh.boundary.quads, np.zeros_like(mesh.vertices)
    corners = mesh.vertices[quads]
    each = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    for i in range(4):
        np.add.at(vectors, quads[:, i], each)
    vertices = np.unique(quads)
    return vertices, _unit(vectors[vertices])


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    return vectors / np.maximum(lengths, np.finfo(float).tiny)
