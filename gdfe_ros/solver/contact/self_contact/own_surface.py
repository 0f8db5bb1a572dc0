# SPDX-License-Identifier: Apache-2.0
"""The surface for self-contact: vertices, faces and sharp edges, and the pairs of them that can never touch."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.mesh.cells.tetrahedra import flat_quads
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.contact.contact_surface import BodyPoints
from gdfe_ros.solver.contact.near import Ragged, incidence, make_ragged
from gdfe_ros.solver.contact.self_contact.closest import face_areas

CREASE = 0.7
"""The surface counts as smooth at an edge if the cosine between the rest normals of its two faces exceeds this."""
DEPTH, RIM = 0.25, 0.05
"""Two distances divided by the shortest edge. A vertex up to `DEPTH` behind a face touches this face even if the vertex
was never in front of the face. A vertex up to `RIM` beside a face still counts as above it.
"""


class Topology(NamedTuple):
    """Neighbourhoods of the undeformed surface.

    A vertex here is a vertex of the body, or a contact point of a skin (`BodyPoints`). The edges are the convex edges
    at which the surface is not smooth: elsewhere, vertices and faces carry all contact.

    Attributes:
        vertices: (k,) int32 vertices of the faces, sorted.
        quads: (q, 4) int32 faces.
        about: faces around each of n + p vertices.
        smooth: for each of the 4 q corners of faces, the faces over which the normal is averaged.
        near: for each of q faces, the vertices that can never touch it: those of all cells that share a vertex with the
            face's own cell.
        ends: (e, 2) int32 vertices at the ends of each edge.
        sides: (e, 2) int64 the two faces of each edge.
        beside: for each of e edges, the vertices that can never touch either of its faces.
        shortest: [m] shortest edge of a cell. Two edges that have passed each other by less than this touch even if
            they were never apart, because no part of a body is thinner than a cell.
        depth: [m] depth behind a face up to which a vertex touches the face even if it was never in front of it.
        rim: [m] distance beside a face that still counts as above it.
    """

    vertices: NDArray[np.int32]
    quads: NDArray[np.int32]
    about: Ragged
    smooth: Ragged
    near: Ragged
    ends: NDArray[np.int32]
    sides: NDArray[np.int64]
    beside: Ragged
    shortest: float
    depth: float
    rim: float

    @classmethod
    def of(cls, body: Body, points: BodyPoints, quads: NDArray[np.int32]) -> Topology:
        """Return the neighbourhoods of faces of a body.

        Args:
            body: the discretised body.
            points: the vertices and contact points of the body.
            quads: (q, 4) int32 boundary faces, and triangles of contact points; triangles repeat their last corner.
        """
        rest, quads = points.at(body.rest), np.ascontiguousarray(quads, dtype=np.int32)
        areas = face_areas(rest, quads)
        normals = areas / np.linalg.norm(areas, axis=1)[:, None]
        about = incidence(quads, len(rest)).T.tocsr()
        smooth = about[quads.ravel()]
        own = np.repeat(np.arange(smooth.shape[0]) // 4, np.diff(smooth.indptr))
        smooth.data = (np.einsum("ij,ij->i", normals[own], normals[smooth.indices]) > CREASE).astype(np.int32)
        smooth.eliminate_zeros()
        near = points.around(body.cells, _cells_of(body, points, quads))
        ends, sides = _sharp_edges(rest, quads, normals)
        beside = near[sides[:, 0]] + near[sides[:, 1]]
        beside.sort_indices()
        edges = body.rest[body.cells]
        shortest = min(float(np.linalg.norm(edges[:, a] - edges[:, b], axis=1).min()) for a, b in body.cell_type.edges)
        lists = make_ragged(about), make_ragged(smooth), make_ragged(near), ends, sides, make_ragged(beside)
        return cls(np.unique(quads), quads, *lists, shortest, DEPTH * shortest, RIM * shortest)


def _sharp_edges(
    rest: NDArray[np.float64], quads: NDArray[np.int32], normals: NDArray[np.float64]
) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """Return the vertices (e, 2) of edges at which the surface is sharp and convex, and the faces (e, 2) of each."""
    sides = np.sort(np.stack([quads, np.roll(quads, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    whole = sides[:, 0] != sides[:, 1]  # a triangle repeats its last corner
    sides, owner = sides[whole], np.repeat(np.arange(len(quads)), 4)[whole]
    ends, first, count = np.unique(sides, axis=0, return_index=True, return_counts=True)
    last = len(sides) - 1 - np.unique(sides[::-1], axis=0, return_index=True)[1]
    ends, one, other = ends[count == 2], owner[first[count == 2]], owner[last[count == 2]]
    beyond = rest[quads[other]].mean(axis=1) - rest[ends].mean(axis=1)
    cosines, heights = (np.einsum("ij,ij->i", normals[one], each) for each in (normals[other], beyond))
    sharp = (cosines <= CREASE) & (heights < 0.0)
    return ends[sharp].astype(np.int32), np.stack([one, other], axis=1)[sharp]


def _cells_of(body: Body, points: BodyPoints, quads: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the vertices (q, 3 c) of the cells of each face; a triangle of contact points has three cells."""
    faces, cells = flat_boundary(body)
    owner = {tuple(quad): cell for quad, cell in zip(faces.tolist(), cells.tolist(), strict=True)}
    lined, found = quads[:, 0] >= points.count, np.empty((len(quads), 3 * body.cells.shape[1]), dtype=np.int32)
    found[~lined] = np.tile(body.cells[[owner[tuple(quad)] for quad in quads[~lined].tolist()]], 3)
    if lined.any():
        found[lined] = points.carriers[quads[lined, :3]].reshape(-1, found.shape[1])
    return found


def flat_boundary(body: Body) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Return the boundary faces of a body as quads (q, 4), see `flat_quads`, and the cell (q,) of each face."""
    boundary = body.cell_type.boundary(body.cells)
    quads = flat_quads(boundary.quads)
    return quads, np.repeat(boundary.cells, len(quads) // max(len(boundary.quads), 1))
