# SPDX-License-Identifier: Apache-2.0
"""Contact points and triangles on a skin: in contact, they replace the boundary faces of the cells."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from gdfe_ros.errors import MeshError, show_point
from gdfe_ros.mesh.cells.filling import trilinear_weights
from gdfe_ros.mesh.mesh import HexMesh
from gdfe_ros.mesh.outside import hang
from gdfe_ros.mesh.quality import cell_volumes
from gdfe_ros.mesh.surfaces.shells import cone_volumes, inside, shell_numbers, shells
from gdfe_ros.mesh.surfaces.surface_edges import edge_counts, number_edges, open_edges, refine
from gdfe_ros.mesh.touching import Touching

FINE, SMALL = 0.25, 0.1
"""The edges of a skin are divided until they are at most FINE times the SMALL quantile of the boundary cells' sizes."""
CREASE = np.cos(np.radians(30.0))
"""The common edge of two triangles is a crease if the cosine between their normals is below this. A point is a tip,
like that of a cone, if the cosine between its normal and the normal of a triangle around it is below this.
"""
POINT_SPACING = np.array([0.5, 0.75, 1.0])
"""Another contact point is added where the distance to the nearest contact point, divided by the size of the point's
cell, exceeds this. The three values are for a corner, for a crease point, and for any other point.
"""
NEAR = 8
"""Number of nearest contact points that are searched for one on the same side of a thin wall."""
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

        Each boundary vertex gets a contact point that can push it back. Without one, a vertex with little material
        would move on and pull the skin into the obstacle. Where the cells are too coarse for the surface, contact
        points are added (`POINT_SPACING`).
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
        return self._complete(self._take_corners(np.unique(point[first])))

    def _take_corners(self, chosen: NDArray[np.intp]) -> NDArray[np.intp]:
        """Return the chosen points, in which each corner of the skin replaces the nearest chosen point if it is close.

        A chosen point that is itself a corner is not replaced.
        """
        tree, found = cKDTree(self.places[chosen]), chosen.copy()
        for corner in np.setdiff1d(np.flatnonzero(self.kinds == 0), chosen):
            limit = POINT_SPACING[0] * self.sizes[corner]
            away, near = tree.query(self.places[corner], k=min(NEAR, len(chosen)), distance_upper_bound=limit)
            near = np.atleast_1d(near)[np.isfinite(np.atleast_1d(away))]
            alike = self.normals[found[near]] @ self.normals[corner] > ALIKE
            near = near[alike]
            if len(near) and self.kinds[found[near[0]]] > 0:
                found[near[0]] = corner
        return np.unique(found)

    def _complete(self, chosen: NDArray[np.intp]) -> NDArray[np.intp]:
        """Add points to the chosen ones until each skin point is within `POINT_SPACING` of one; return all of them."""
        limits = POINT_SPACING[self.kinds] * self.sizes
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
    """Return whether each point is a tip (`CREASE`).

    Points have the normals ``own`` (k, 3), triangles (t, 3) the ``normals`` (t, 3).
    """
    least = np.ones(len(own))
    for i in range(3):
        np.minimum.at(least, triangles[:, i], np.einsum("ti,ti->t", own[triangles[:, i]], normals))
    return least < CREASE


def _kinds(creases: NDArray[np.int64], tips: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return the kind of each point: 1 on two creases; 2 on no crease, if it is no tip; 0 otherwise."""
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


ALONG = 1.0
"""A skin point belongs to the nearest contact point along the creases if their distance, divided by the size of the
point's cell, is at most this; otherwise to the nearest contact point along all edges.
"""
_NONE = -9999
"""Value of scipy's `dijkstra` for a point that no source reaches."""


def contact_faces(skin: SkinPoints, chosen: NDArray[np.intp]) -> NDArray[np.int32]:
    """Return the triangles (f, 3) int32 between contact points, in the orientation of the skin.

    ``chosen`` (p,) are the indices of the contact points among the skin points. The corners of the triangles are
    indices into ``chosen``.
    """
    owner = _owners(skin, chosen)
    faces = owner[skin.triangles]
    faces = faces[(faces >= 0).all(axis=1)]
    ordered = np.sort(faces, axis=1)
    thick = (ordered[:, 0] < ordered[:, 1]) & (ordered[:, 1] < ordered[:, 2])
    ordered, faces = ordered[thick], faces[thick]
    after = np.take_along_axis(np.roll(faces, -1, axis=1), faces.argmin(axis=1)[:, None], axis=1)[:, 0]
    unique, which = np.unique(ordered, axis=0, return_inverse=True)
    turns = np.bincount(which.reshape(-1), np.where(after == ordered[:, 1], 1, -1), minlength=len(unique))
    forward, backward = unique[turns > 0.0], unique[turns < 0.0][:, ::-1]
    return np.concatenate([forward, backward]).astype(np.int32)


def _owners(skin: SkinPoints, chosen: NDArray[np.intp]) -> NDArray[np.int64]:
    """Return the index (k,) in ``chosen`` of the contact point of each skin point; -1 if edges lead to none."""
    number = np.full(len(skin.places) + 1, -1)
    number[chosen] = np.arange(len(chosen))
    found, _ = _nearest(skin.places, edge_counts(skin.triangles)[0], chosen)
    sharp = chosen[skin.kinds[chosen] < 2]
    if len(sharp):
        along, away = _nearest(skin.places, number_edges(skin.creases)[0], sharp)
        found = np.where(away <= ALONG * skin.sizes, along, found)
    return number[found]


def _nearest(
    places: NDArray[np.float64], edges: NDArray[np.int64], sources: NDArray[np.intp]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the source (k,) that is nearest to each point along ``edges`` (e, 2), and its distance [m].

    A point to which no source is connected has the source -1 and an infinite distance.
    """
    length = np.linalg.norm(places[edges[:, 0]] - places[edges[:, 1]], axis=1)
    length = np.maximum(length, np.finfo(float).tiny)
    graph = sparse.csr_matrix((length, edges.T), shape=(len(places), len(places)))
    away, _, owner = dijkstra(graph, directed=False, indices=sources, min_only=True, return_predecessors=True)
    return np.where(owner == _NONE, -1, owner).astype(np.int64), away


BARE, SHORT = 2.0 * 3.0**0.5, 1.0
"""Largest distance from the centroid of a boundary cell's material to the skin, divided by the cell's edge. A cell with
a larger distance counts as not covered. BARE applies to centroids inside the skin, for example at a hole of the body
that is missing in the skin. SHORT applies to centroids outside the skin.
"""


def touch_by_skin(mesh: HexMesh, points: NDArray[np.float64], triangles: NDArray[np.int64]) -> HexMesh:
    """Return a copy of a mesh whose contact points are points of its skin, not vertices of its cells.

    There is about one contact point for each boundary vertex: the skin point in whose interpolation this vertex has the
    largest weight. The cells cannot resolve more points.

    Args:
        mesh: the mesh with its skin.
        points: points of the skin's surface before its refinement (k, 3) [m].
        triangles: ids of the points of each triangle (t, 3).

    Raises:
        MeshError: the surface is open, or does not cover some boundary cells.
    """
    _require_closed(points, triangles)
    lined = SkinPoints.of(mesh, points, out_of_material(points, triangles))
    _require_covered(mesh, lined, points, triangles)
    some = lined.touching(mesh)
    corners, weights = np.ascontiguousarray(lined.corners[some], dtype=np.int32), lined.weights[some]
    everything = np.arange(mesh.n_vertices, dtype=np.int32)
    return replace(mesh, touching=Touching(corners, weights, contact_faces(lined, some), everything, mesh.skin))


def _require_closed(points: NDArray[np.float64], triangles: NDArray[np.int64]) -> None:
    leaks = open_edges(triangles)
    if len(leaks):
        place = show_point(points[leaks[0]].mean(axis=0))
        text = (
            f"contact needs a closed skin. At {len(leaks)} edges of this skin the second triangle is missing or faces "
            f"the other direction, first at {place} m; remedy: close the holes "
            "(MeshLab: Close Holes, Blender: 3D-Print toolbox), or set contact: false, then the skin is only drawn"
        )
        raise MeshError("skin", [text])


def out_of_material(points: NDArray[np.float64], triangles: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the triangles (t, 3) of nested shells, oriented so that normals point out of the material."""
    number = shell_numbers(len(points), triangles)
    volumes = np.bincount(number, cone_volumes(points, triangles))
    inwards = (volumes < 0.0) != (np.array(shells(points, triangles).depths) % 2 == 1)
    return np.where(inwards[number, None], triangles[:, ::-1], triangles)


def _require_covered(
    mesh: HexMesh, lined: SkinPoints, points: NDArray[np.float64], triangles: NDArray[np.int64]
) -> None:
    """Raise MeshError if a skin does not cover some boundary cells; obstacles would penetrate these cells."""
    cells = np.unique(mesh.boundary.cells)
    corners = mesh.vertices[mesh.cells[cells]]
    centres = mesh.centroids[cells]
    if mesh.filling is not None:
        centres = np.einsum("ca,cai->ci", trilinear_weights(mesh.filling.centre[cells]), corners)
    edges = np.linalg.norm(corners[:, 6] - corners[:, 0], axis=1) / 3.0**0.5
    away = cKDTree(lined.places).query(centres)[0] / edges
    missed = np.flatnonzero(away > SHORT)
    missed = missed[(away[missed] > BARE) | ~inside(centres[missed], points, triangles)]
    if len(missed):
        worst = missed[np.argmax(away[missed])]
        text = (
            f"{len(missed)} cells at the boundary are left outside of the skin, or are far from it, so that contact "
            f"would not see them. The farthest cell, at {show_point(centres[worst])} m, is "
            f"{away[worst] * edges[worst]:.3g} m away; allowed: the length of its edges, {edges[worst]:.3g} m; "
            "remedy: a skin of the whole body (check scale and place of the file), or contact: false, then the "
            "skin is only drawn"
        )
        raise MeshError("skin", [text])
