# SPDX-License-Identifier: Apache-2.0
"""The surface for self-contact: its topology, and the search for each vertex' nearest face."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gdfe_ros.mesh.tet_faces import flat_quads
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.contact.closest import corner_normals, face_areas, may_touch, nearest_faces
from gdfe_ros.solver.contact.own_points import OwnPoints

CREASE = 0.7
"""The surface counts as smooth at an edge if the cosine between the rest normals of its two faces exceeds this."""
DEPTH, RIM = 0.25, 0.05
"""Two distances divided by the shortest edge. A vertex up to `DEPTH` behind a face touches this face even if it was
never in front of it. A vertex up to `RIM` beside a face still counts as above it.
"""


class Topology(NamedTuple):
    """Neighbourhoods of the undeformed surface; lists of different lengths are stored as offsets and values.

    A vertex is a vertex of the body, or a contact point of a skin (`OwnPoints`).

    Attributes:
        vertices: (k,) int32 vertices of the faces, sorted.
        quads: (q, 4) int32 faces.
        about_starts, about: (n + p + 1,) faces around each vertex.
        smooth_starts, smooth: (4 q + 1,) faces over which the normal at each face corner is averaged.
        near_starts, near: (q + 1,) vertices that can never touch each face, ascending: the vertices of all cells that
            share a vertex with the face's own cell.
        depth: [m] depth behind a face up to which a vertex touches it even if it was never in front of it.
        rim: [m] distance beside a face that still counts as above it.
    """

    vertices: NDArray[np.int32]
    quads: NDArray[np.int32]
    about_starts: NDArray[np.int64]
    about: NDArray[np.int64]
    smooth_starts: NDArray[np.int64]
    smooth: NDArray[np.int64]
    near_starts: NDArray[np.int64]
    near: NDArray[np.int64]
    depth: float
    rim: float


@dataclass(frozen=True, eq=False)
class Nearest:
    """The nearest face that each surface vertex can touch.

    Attributes:
        face: (k,) int64 nearest face; -1 if no face is within reach.
        weights: (k, 4) weights of the face's corners at the closest point.
        normal: (k, 3) unit normal of the plane that the vertex must stay in front of.
        gap: (k,) [m] signed distance to that plane; infinite if no face is within reach.
        support: (k,) fraction of the contact force that the face carries, as in `nearest_faces`.
    """

    face: NDArray[np.int64]
    weights: NDArray[np.float64]
    normal: NDArray[np.float64]
    gap: NDArray[np.float64]
    support: NDArray[np.float64]

    def of(self, chosen: NDArray[np.int64]) -> Nearest:
        """Return the entries of the ``chosen`` vertices only."""
        whole = self.face, self.weights, self.normal, self.gap, self.support
        return Nearest(*(values[chosen] for values in whole))


class OwnSurface:
    """The faces of a body that may touch each other.

    Args:
        body: the discretised body.
        points: the vertices and contact points of the body.
        quads: (q, 4) int32 boundary faces, and triangles of contact points; triangles repeat their last corner.

    Attributes:
        topology: neighbourhoods of the undeformed surface.
    """

    def __init__(self, body: Body, points: OwnPoints, quads: NDArray[np.int32]) -> None:
        whole = points.at(body.rest)
        count, corners = len(whole), quads.ravel().astype(np.int64)
        faces = np.repeat(np.arange(len(quads), dtype=np.int64), 4)
        once = np.ones(quads.shape, dtype=bool)
        once[:, 3] = quads[:, 3] != quads[:, 2]  # a triangle repeats its last corner
        own = np.flatnonzero(once)
        order = own[np.argsort(corners[own], kind="stable")]
        about, about_starts = faces[order], _starts(np.bincount(corners[own], minlength=count))
        rest = np.empty((len(quads), 3))
        face_areas(whole, quads, rest)
        normals = rest / np.linalg.norm(rest, axis=1)[:, None]
        shared = np.diff(about_starts)[corners]
        owner, other = np.repeat(np.arange(4 * len(quads)), shared), np.concatenate(
            [about[about_starts[v] : about_starts[v + 1]] for v in corners]
        )  # fmt: skip
        on = np.einsum("ij,ij->i", normals[faces[owner]], normals[other]) > CREASE
        near = points.about(body.cells, _cells_of(body, points, quads))
        edges = body.rest[body.cells]
        shortest = min(float(np.linalg.norm(edges[:, a] - edges[:, b], axis=1).min()) for a, b in body.cell_type.edges)
        self.topology = Topology(
            vertices=np.unique(quads).astype(np.int32),
            quads=np.ascontiguousarray(quads, dtype=np.int32),
            about_starts=about_starts,
            about=about,
            smooth_starts=_starts(np.bincount(owner[on], minlength=4 * len(quads))),
            smooth=other[on],
            near_starts=near.indptr.astype(np.int64),
            near=near.indices.astype(np.int64),
            depth=DEPTH * shortest,
            rim=RIM * shortest,
        )

    def search(self, x: NDArray[np.float64], within: float) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return the vertices and faces (p,) that come within a distance [m] at the positions ``x`` (n + p, 3) [m].

        Vertices are indices into the surface's vertices.
        """
        corners = x[self.topology.quads]
        centres = corners.mean(axis=1)
        radius = float(np.sqrt(np.square(corners - centres[:, None]).sum(axis=2).max(initial=0.0)))
        tree, found = cKDTree(x[self.topology.vertices]), cKDTree(centres)
        near = tree.sparse_distance_matrix(found, within + radius, output_type="ndarray")
        pairs, faces = np.ascontiguousarray(near["i"]), np.ascontiguousarray(near["j"])
        may = np.empty(len(near), dtype=np.bool_)
        may_touch(x, pairs, faces, self.topology, within, may)
        return pairs[may], faces[may]

    def nearest(
        self,
        x: NDArray[np.float64],
        last: NDArray[np.float64],
        pairs: NDArray[np.int64],
        faces: NDArray[np.int64],
        reach: float,
        sunk: NDArray[np.bool_],
    ) -> Nearest:
        """Return, for each surface vertex, the nearest of the candidate faces that it can touch.

        A vertex deep behind a face touches this face only if it was in front of it at ``last``. Vertices on the far
        side of a wall are thus excluded.

        Args:
            x: (n + p, 3) [m] positions.
            last: (n + p, 3) [m] positions of the last accepted state.
            pairs: (p,) vertex of each candidate pair, as an index into the surface's vertices.
            faces: (p,) face of each candidate pair.
            reach: [m] search distance.
            sunk: (k,) whether each surface vertex already penetrated at ``last``.
        """
        surface, count = self.topology, len(self.topology.vertices)
        areas, normals = np.empty((len(surface.quads), 3)), np.empty((len(surface.quads), 4, 3))
        face_areas(x, surface.quads, areas)
        corner_normals(areas, surface.smooth_starts, surface.smooth, normals)
        distance, face = np.full(count, np.inf), np.full(count, -1, dtype=np.int64)
        weights, normal, gap = np.zeros((count, 4)), np.zeros((count, 3)), np.full(count, np.inf)
        support = np.zeros(count)
        found = (distance, face, weights, normal, gap, support)
        nearest_faces(x, last, sunk, pairs, faces, surface, areas, normals, reach, *found)
        return Nearest(face, weights, normal, gap, support)


def _starts(counts: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)


def _cells_of(body: Body, points: OwnPoints, quads: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the vertices (q, 3 c) of the cells of each face, which are three for a triangle of contact points."""
    faces, cells = flat_boundary(body)
    owner = {tuple(quad): cell for quad, cell in zip(faces.tolist(), cells.tolist(), strict=True)}
    lined, found = quads[:, 0] >= points.count, np.empty((len(quads), 3 * body.cells.shape[1]), dtype=np.int32)
    found[~lined] = np.tile(body.cells[[owner[tuple(quad)] for quad in quads[~lined].tolist()]], 3)
    if lined.any():
        found[lined] = points.corners[quads[lined, :3] - points.count].reshape(-1, found.shape[1])
    return found


def flat_boundary(body: Body) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Return the boundary faces of a body as quads (q, 4), as `flat_quads` does, and the cell of each one (q,)."""
    boundary = body.cell_type.boundary(body.cells)
    quads = flat_quads(boundary.quads)
    return quads, np.repeat(boundary.cells, len(quads) // max(len(boundary.quads), 1))
