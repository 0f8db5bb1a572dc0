# SPDX-License-Identifier: Apache-2.0
"""Intersections of two meshes, and of a surface with itself.

The overlap of two meshes is found with separating axes between pairs of cells, or with the meshes' skins. Cells are
treated as convex.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gdfe_ros.errors import show_point
from gdfe_ros.mesh.cells.faces import corners_of
from gdfe_ros.mesh.cells.tetrahedra import flat_quads
from gdfe_ros.mesh.mesh import Mesh
from gdfe_ros.mesh.surfaces.shells import BoxTree
from gdfe_ros.mesh.touching import outline

TOUCHING = 0.1
"""Two cells touch, and do not overlap, if their penetration depth divided by their shortest edge is at most this. The
hulls of the cells of a ball in a fitting socket overlap by that much. Contact resolves smaller overlaps in the first
step.
"""
RAYS = np.array([[0.36, 0.48, 0.8], [-0.8, 0.36, 0.48], [0.48, -0.8, -0.36]])
"""Directions of three rays from a point. The point is inside a surface if two rays meet the surface from inside. A
single ray may pass exactly through an edge.
"""
_BLOCK = 512
"""Number of pairs of cells that are tested together."""


class Overlap(NamedTuple):
    """Overlap of two meshes: a lower bound of its depth [m], and a nearby point (3,) [m]."""

    depth: float
    point: NDArray[np.float64]


def find_overlap(first: Mesh, second: Mesh) -> Overlap | None:
    """Return the overlap of two meshes; None if they are apart or touch.

    For a mesh with contact on a skin, the skin is tested instead of the cells.

    Args:
        first: a sound mesh.
        second: another sound mesh, in the same frame.
    """
    ours, theirs = (mesh.vertices[mesh.cells[:, : mesh.corners]] for mesh in (first, second))
    low, high = np.maximum(first.bounds[0], second.bounds[0]), np.minimum(first.bounds[1], second.bounds[1])
    if (low > high).any():
        return None
    if first.touching is not None or second.touching is not None:
        depth, point = _deepest_point(first, second)
        shortest = min(float(mesh.edge_lengths.min()) for mesh in (first, second))
        return Overlap(depth, point) if depth > TOUCHING * shortest else None
    ours, theirs = _within(ours, low, high), _within(theirs, low, high)
    for i, j in _blocks(ours, theirs):
        a, b = ours[i], theirs[j]
        edges = first.along_edges(a), second.along_edges(b)
        depths = _depths(a, b, edges, (_normals(a, first), _normals(b, second)))
        shortest = np.minimum(*(np.linalg.norm(each, axis=2).min(axis=1) for each in edges))
        deepest = int(np.argmax(depths / shortest))
        if depths[deepest] > TOUCHING * shortest[deepest]:
            inner = np.maximum(a[deepest].min(axis=0), b[deepest].min(axis=0))
            outer = np.minimum(a[deepest].max(axis=0), b[deepest].max(axis=0))
            return Overlap(float(depths[deepest]), 0.5 * (inner + outer))
    return None


def _within(corners: NDArray[np.float64], low: NDArray[np.float64], high: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the corners (k, c, 3) [m] of those cells whose bounding boxes intersect the box ``low`` .. ``high``."""
    meet = (corners.min(axis=1) <= high).all(axis=1) & (corners.max(axis=1) >= low).all(axis=1)
    return corners[meet]


def _blocks(
    ours: NDArray[np.float64], theirs: NDArray[np.float64]
) -> Iterator[tuple[NDArray[np.intp], NDArray[np.intp]]]:
    """Yield the indices of pairs of cells whose bounding boxes intersect, at most `_BLOCK` pairs at a time."""
    if not len(ours) or not len(theirs):
        return
    centre, radius = ours.mean(axis=1), np.linalg.norm(ours - ours.mean(axis=1, keepdims=True), axis=2).max()
    low, high = ours.min(axis=1), ours.max(axis=1)
    tree = cKDTree(centre)
    for start in range(0, len(theirs), _BLOCK):
        block = theirs[start : start + _BLOCK]
        middle = block.mean(axis=1)
        reach = radius + np.linalg.norm(block - middle[:, None], axis=2).max(axis=1)
        near = tree.query_ball_point(middle, reach, return_sorted=True)
        i = np.concatenate([np.asarray(found, dtype=np.intp) for found in near])
        j = np.repeat(np.arange(len(block)), [len(found) for found in near])
        meet = (low[i] <= block[j].max(axis=1)).all(axis=1) & (high[i] >= block[j].min(axis=1)).all(axis=1)
        i, j = i[meet], j[meet] + start
        for part in range(0, len(i), _BLOCK):
            yield i[part : part + _BLOCK], j[part : part + _BLOCK]


Both = tuple[NDArray[np.float64], NDArray[np.float64]]


def _depths(a: NDArray[np.float64], b: NDArray[np.float64], edges: Both, normals: Both) -> NDArray[np.float64]:
    """Return the penetration depth (k,) [m] of pairs of cells with corners (k, 8 or 4, 3); it is negative for a gap.

    The depth is the least overlap of the projections of both cells on all candidate axes (Gottschalk 1996). The axes
    are the ``normals`` (k, f, 3) of the faces of both cells, and the vector products of an edge of one cell with an
    edge of the other (``edges``, (k, e, 3) of each cell).
    """
    across = np.cross(edges[0][:, :, None], edges[1][:, None]).reshape(len(a), -1, 3)
    axes = np.concatenate([*normals, across], axis=1)
    length = np.linalg.norm(axes, axis=2)
    parallel = length <= 1e-6 * length.max(axis=1, keepdims=True)
    axes = axes / np.where(parallel, 1.0, length)[..., None]
    ours, theirs = np.einsum("kai,kci->kac", axes, a), np.einsum("kai,kci->kac", axes, b)
    depth = np.minimum(ours.max(axis=2) - theirs.min(axis=2), theirs.max(axis=2) - ours.min(axis=2))
    return np.where(parallel, np.inf, depth).min(axis=1)


def _normals(corners: NDArray[np.float64], mesh: Mesh) -> NDArray[np.float64]:
    """Return twice the area vectors (k, f, 3) [m^2] of the faces of a mesh's cells with corners (k, 8 or 4, 3) [m]."""
    faces = corners[:, corners_of(mesh.faces)]
    return np.cross(faces[:, :, 2] - faces[:, :, 0], faces[:, :, -1] - faces[:, :, 1])


def _deepest_point(first: Mesh, second: Mesh) -> tuple[float, NDArray[np.float64]]:
    """Return the depth [m] and the position (3,) [m] of the surface point of one mesh that is deepest in the other.

    Only contact points of skins and vertices of faces are tested; a crossing between these points is not found.
    """
    from gdfe_ros.mesh.surfaces.triangle_kernels import nearest_distances  # loads numba

    depths, places = [np.zeros(1)], [np.zeros((1, 3))]
    for own, other in ((first, second), (second, first)):
        points, (vertices, quads) = _points_of(own), _surface_of(other)
        within = ((points >= vertices.min(axis=0)) & (points <= vertices.max(axis=0))).all(axis=1)
        triangles = quads[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
        tree = BoxTree.of(vertices, triangles)
        inner = points[within][_inside(points[within], tree)]
        away = np.empty(len(inner))
        nearest_distances(inner, tree.corners, tree.boxes, away)
        depths.append(away)
        places.append(inner)
    depth, place = np.concatenate(depths), np.concatenate(places)
    deepest = int(depth.argmax())
    return float(depth[deepest]), place[deepest]


def _points_of(mesh: Mesh) -> NDArray[np.float64]:
    """Return the contact points (k, 3) [m] of a mesh: those of its skin, or the vertices of its boundary."""
    if mesh.touching is not None:
        return mesh.touching.at(mesh.vertices)
    return mesh.vertices[np.unique(mesh.boundary.quads)]


def _surface_of(mesh: Mesh) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Return the contact surface of a mesh: its points (k, 3) [m], and quads (q, 4) of their indices."""
    points, quads = outline(flat_quads(mesh.boundary.quads), mesh.touching, mesh.vertices)
    used, local = np.unique(quads, return_inverse=True)
    return points[used], local.reshape(quads.shape).astype(np.int32)


def _inside(points: NDArray[np.float64], tree: BoxTree) -> NDArray[np.bool_]:
    """Return whether each of ``points`` (k, 3) [m] is inside a closed surface with normals out of the material."""
    from gdfe_ros.mesh.surfaces.triangle_kernels import first_hits  # loads numba

    votes = np.zeros(len(points), dtype=np.int64)
    for ray in RAYS:
        lengths, hits = np.empty(len(points)), np.empty(len(points), dtype=np.int64)
        first_hits(points, np.tile(ray, (len(points), 1)), tree.corners, tree.boxes, 0.0, lengths, hits)
        votes += (hits >= 0) & (tree.normals[hits] @ ray > 0.0)
    return votes >= 2


TOUCH = 1e-6
"""Triangles that overlap by up to this length, divided by the diagonal of the surface, touch and do not cut each other.
The single precision of STL files moves vertices by 1e-7."""
LISTED = 3
"""Largest number of places that a message names."""


@dataclass(frozen=True, eq=False)
class SelfCuts:
    """The self-intersections of a surface.

    Attributes:
        pairs: number of pairs of triangles that cut each other, or overlap in one plane.
        cut: (t,) bool, whether another triangle cuts the triangle.
        places: (k, 3) [m], a point on an intersection of each of the k cut triangles, in the order of the triangles.
    """

    pairs: int
    cut: NDArray[np.bool_]
    places: NDArray[np.float64]

    @property
    def defects(self) -> list[str]:
        """A list with the text of the defect; empty if there are no self-intersections."""
        if self.pairs == 0:
            return []
        some = self.places[_far_apart(self.places, LISTED)]
        where = ", ".join(map(show_point, some))
        return [
            f"the surface cuts itself: {self.pairs} pairs of its triangles cut each other or lie on each other, e.g. "
            f"near {where} m; remedy: unite overlapping parts in the CAD program (Boolean union; Blender: 3D-Print "
            "toolbox, Make Manifold). `mesh: {tets: ...}` accepts the surface and fills what it winds around"
        ]


def find_self_cuts(vertices: NDArray[np.float64], triangles: NDArray[np.integer], *, touch: float = TOUCH) -> SelfCuts:
    """Return the self-intersections of a surface.

    Two triangles cut each other if their common line is longer than ``touch`` times the diagonal and runs through the
    interior of at least one of them. Two triangles in one plane overlap if no edge separates them. Triangles that only
    share a corner or an edge do neither.

    Args:
        vertices: positions [m], shape (n, 3).
        triangles: vertex ids, shape (t, 3).
        touch: length up to which triangles touch, divided by the diagonal of the surface.
    """
    from gdfe_ros.mesh.surfaces.triangle_kernels import count_cuts  # loads numba

    tolerance = touch * float(np.linalg.norm(np.ptp(vertices, axis=0)))
    tree = BoxTree.of(vertices, triangles, flat=touch)
    counts, places = np.empty(len(tree.order), dtype=np.int64), np.zeros((len(tree.order), 3))
    count_cuts(tree.corners, tree.normals, tree.boxes, tolerance, counts, places)
    cut, ranked = np.zeros(len(triangles), dtype=bool), np.argsort(tree.order)
    cut[tree.order] = counts > 0
    return SelfCuts(int(counts.sum()) // 2, cut, places[ranked][counts[ranked] > 0])


def _far_apart(points: NDArray[np.float64], count: int) -> list[int]:
    """Return the indices of up to ``count`` points; each is the farthest one from the points before it."""
    chosen = [0]
    away = np.linalg.norm(points - points[0], axis=1)
    while len(chosen) < count and away.max() > 0.0:
        chosen.append(int(np.argmax(away)))
        away = np.minimum(away, np.linalg.norm(points - points[chosen[-1]], axis=1))
    return chosen
