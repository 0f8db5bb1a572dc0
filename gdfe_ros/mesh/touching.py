# SPDX-License-Identifier: Apache-2.0
"""Points of a skin at which contact acts in the place of the vertices of the cells' faces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gdfe_ros.errors import MeshError
from gdfe_ros.mesh.cavities import open_edges
from gdfe_ros.mesh.outside import Outside, hang
from gdfe_ros.mesh.refinement import refine
from gdfe_ros.mesh.shape import EDGES, cell_volumes
from gdfe_ros.mesh.shells import shell_numbers, shells

if TYPE_CHECKING:
    from gdfe_ros.mesh.hexmesh import HexMesh

FINE, SMALL = 0.25, 0.1
"""Longest edge of the pieces in which a skin is summed up, over the size of cells of which so many are smaller."""
LEAST = 0.3
"""Area of a part of the skin, over that of the faces about the vertex that takes it, below which others take it."""
CREASE = np.cos(np.radians(30.0))
"""Cosine between the normals of neighbours beyond which their common edge is a crease."""
NEAR = 8
"""Vertices about a piece of the skin of which one takes it: the nearest on its side of a wall."""
BARE = 2.0
"""Distance of a cell of the boundary from the points, over the cell's diagonal, beyond which the skin misses it."""


@dataclass(frozen=True, eq=False)
class Touching:
    """What of a body touches by its skin.

    Attributes:
        corners: (p, 8) int32 vertices of the cell that carries each point.
        weights: (p, 8) their weights, which sum to one.
        vertices: (v,) int32 of the meshes that have such a skin: their faces touch nothing.
        surface: these skins.
    """

    corners: NDArray[np.int32]
    weights: NDArray[np.float64]
    vertices: NDArray[np.int32]
    surface: Outside

    @classmethod
    def joined(cls, parts: Sequence[tuple[Touching, int, int]]) -> Touching:
        """Return several as one; each with the numbers of its mesh' first vertex and cell among all."""
        each, vertices, cells = zip(*parts, strict=True)
        return cls(
            np.concatenate([one.corners + np.int32(first) for one, first in zip(each, vertices, strict=True)]),
            np.concatenate([one.weights for one in each]),
            np.concatenate([one.vertices + np.int32(first) for one, first in zip(each, vertices, strict=True)]),
            Outside.joined([one.surface for one in each], vertices, cells),
        )

    def at(self, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return where the points are (p, 3) [m] when the vertices are at ``positions`` (n, 3) [m]."""
        return np.einsum("pa,pai->pi", self.weights, positions[self.corners])


def outline(
    quads: NDArray[np.int32], touching: Touching | None, positions: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Return the surface that touches where vertices are at ``positions`` (n, 3) [m]: points [m], and quads of them.

    ``quads`` (q, 4) are the faces of all cells; a triangle of a skin has its last corner twice.
    """
    if touching is None:
        return positions, quads
    bare = quads[~np.isin(quads[:, 0], touching.vertices)]
    lined = touching.surface.triangles[:, [0, 1, 2, 2]] + len(positions)
    return np.concatenate([positions, touching.surface.at(positions)]), np.concatenate([bare, lined]).astype(np.int32)


def touch_by_skin(mesh: HexMesh, points: NDArray[np.float64], triangles: NDArray[np.int64]) -> HexMesh:
    """Return a mesh with a skin that touches in the place of the faces of its cells.

    There are as many points as the cells can resolve: each vertex of the boundary takes the part of the skin that is
    nearest to it, and the point in the middle of that part touches; where it has a corner or a crease, a point of that:
    what is sharp does not enter.

    Args:
        mesh: with its skin.
        points: of the skin's surface as it was given (k, 3) [m].
        triangles: between these (t, 3).

    Raises:
        MeshError: the surface is open, or cells at the boundary have none of it near them.
    """
    _require_closed(points, triangles)
    faces = mesh.boundary
    size = float(np.quantile(np.cbrt(cell_volumes(mesh)[faces.cells]), SMALL))
    pieces = _Pieces.of(*refine(points, _out_of_material(points, triangles), FINE * size))
    vertices = np.unique(faces.quads)
    normals, around = (each[vertices] for each in _about(mesh.vertices, faces.quads))
    owners = _owners(pieces.middles, pieces.areas, mesh.vertices[vertices], normals)
    shares = np.bincount(owners, np.linalg.norm(pieces.areas, axis=1), len(vertices))
    kept = np.flatnonzero(shares >= LEAST * around)
    places = pieces.represent(mesh.vertices[vertices[kept]], normals[kept])
    _require_covered(mesh, places)
    cells, weights = hang(mesh.vertices, mesh.cells, places)
    corners = np.ascontiguousarray(mesh.cells[cells], dtype=np.int32)
    everything = np.arange(mesh.n_vertices, dtype=np.int32)
    return replace(mesh, touching=Touching(corners, weights, everything, mesh.skin))


def is_closed(triangles: NDArray[np.int64]) -> bool:
    """Tell whether each edge of a surface runs as often one way as the other."""
    return len(open_edges(triangles)) == 0


def _require_closed(points: NDArray[np.float64], triangles: NDArray[np.int64]) -> None:
    leaks = open_edges(triangles)
    if len(leaks):
        x, y, z = points[leaks[0]].mean(axis=0)
        text = (
            f"contact needs a closed skin, and {len(leaks)} edges of this one have no triangle on their other side or "
            f"one that faces the other way, the first at ({x:.4g}, {y:.4g}, {z:.4g}) m; remedy: close the holes "
            "(MeshLab: Close Holes, Blender: 3D-Print toolbox), or contact: false, which only shows it"
        )
        raise MeshError("skin", [text])


def _out_of_material(points: NDArray[np.float64], triangles: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the triangles of nested shells, each shell turned so that it faces out of the material between them."""
    a, b, c = (points[triangles[:, i]] - points.mean(axis=0) for i in range(3))
    number = shell_numbers(len(points), triangles)
    volumes = np.bincount(number, np.einsum("ti,ti->t", a, np.cross(b, c)))
    inwards = (volumes < 0.0) != (np.array(shells(points, triangles).depths) % 2 == 1)
    return np.where(inwards[number, None], triangles[:, ::-1], triangles)


@dataclass(frozen=True, eq=False)
class _Pieces:
    """A surface in small pieces.

    Attributes:
        points: (k, 3) [m] corners of its triangles.
        middles: (t, 3) [m] of these.
        areas: (t, 3) [m^2] vectors of these, outwards.
        sharp: (s, 3) [m] points on its creases.
        slopes: (s, 3) [m^2] sums of the areas about these.
        corner: (s,) bool which of these are corners.
    """

    points: NDArray[np.float64]
    middles: NDArray[np.float64]
    areas: NDArray[np.float64]
    sharp: NDArray[np.float64]
    slopes: NDArray[np.float64]
    corner: NDArray[np.bool_]

    @classmethod
    def of(cls, points: NDArray[np.float64], triangles: NDArray[np.int64]) -> _Pieces:
        """Return the pieces of triangles (t, 3) between points (k, 3) [m]."""
        a, b, c = (points[triangles[:, i]] for i in range(3))
        areas = 0.5 * np.cross(b - a, c - a)
        about = np.zeros_like(points)
        for i in range(3):
            np.add.at(about, triangles[:, i], areas)
        normals = areas / np.maximum(np.linalg.norm(areas, axis=1, keepdims=True), np.finfo(float).tiny)
        edges = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        order = np.lexsort((edges[:, 1], edges[:, 0]))
        edges, owner = edges[order], order // 3
        paired = (edges[:-1] == edges[1:]).all(axis=1)
        bent = np.einsum("ei,ei->e", normals[owner[:-1]], normals[owner[1:]]) < CREASE
        count = np.bincount(edges[:-1][paired & bent].ravel(), minlength=len(points))
        sharp = np.flatnonzero(count)
        return cls(
            points[np.unique(triangles)], (a + b + c) / 3.0, areas, points[sharp], about[sharp], count[sharp] != 2
        )

    def represent(self, vertices: NDArray[np.float64], normals: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return points (p, 3) [m] that touch for what is nearest to each of vertices (v, 3) [m], if anything is."""
        owners, weights = _owners(self.middles, self.areas, vertices, normals), np.linalg.norm(self.areas, axis=1)
        total = np.bincount(owners, weights, len(vertices))
        some = np.flatnonzero(total > 0.0)  # the vertices that took the rest may be nearer to all that one had
        sums = np.stack([np.bincount(owners, weights * x, len(vertices)) for x in self.middles.T], axis=1)
        found = np.full((len(vertices), 3), np.nan)
        found[some] = self.points[cKDTree(self.points).query(sums[some] / total[some, None])[1]]
        if len(self.sharp):
            owners = _owners(self.sharp, self.slopes, vertices, normals)
            away = np.linalg.norm(self.sharp - vertices[owners], axis=1)
            last = np.lexsort((-away, self.corner))  # of each owner the last one stays: a corner, the nearest
            found[owners[last]] = self.sharp[last]
        return found[np.isfinite(found[:, 0])]


def _about(points: NDArray[np.float64], quads: NDArray[np.int32]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a quarter of vectors (k, 3) and sizes (k,) [m^2] of the faces (q, 4) about each of points (k, 3) [m]."""
    corners, vectors, areas = points[quads], np.zeros_like(points), np.zeros(len(points))
    each = 0.125 * np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    for i in range(4):
        np.add.at(vectors, quads[:, i], each)
        np.add.at(areas, quads[:, i], np.linalg.norm(each, axis=1))
    return vectors, areas


def _owners(
    points: NDArray[np.float64],
    slopes: NDArray[np.float64],
    vertices: NDArray[np.float64],
    normals: NDArray[np.float64],
) -> NDArray[np.intp]:
    """Return which vertex (v, 3) [m] is nearest to each point (p, 3) [m] of those that look the same way."""
    near = cKDTree(vertices).query(points, k=min(NEAR, len(vertices)))[1].reshape(len(points), -1)
    alike = np.einsum("pni,pi->pn", normals[near], slopes) > 0.0
    return near[np.arange(len(points)), alike.argmax(axis=1)]


def _require_covered(mesh: HexMesh, points: NDArray[np.float64]) -> None:
    """Refuse a skin that does not come near to all cells at the boundary: what touches these would enter them."""
    cells = np.unique(mesh.boundary.cells)
    corners = mesh.vertices[mesh.cells[cells]]
    diagonals = np.linalg.norm(corners[:, 6] - corners[:, 0], axis=1)
    away = cKDTree(points).query(mesh.centroids[cells])[0] / diagonals
    if away.max() > BARE:
        worst = int(np.argmax(away))
        x, y, z = mesh.centroids[cells[worst]]
        edge = np.linalg.norm(corners[worst, EDGES[0, 1]] - corners[worst, EDGES[0, 0]])
        text = (
            f"{(away > BARE).sum()} cells at the boundary have no part of the skin near them, the farthest at "
            f"({x:.4g}, {y:.4g}, {z:.4g}) m, {away[worst] * diagonals[worst]:.3g} m away, with edges of {edge:.3g} m: "
            "contact would not see them; remedy: a skin of the whole body, or contact: false, which only shows it"
        )
        raise MeshError("skin", [text])
