# SPDX-License-Identifier: Apache-2.0
"""Penetration of the body into itself: vertices inside foreign cells, and their depth, independent of contact pairs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from gdfe_ros.constraints.obstacle import SelfContact
from gdfe_ros.mesh.faces import vertex_pieces
from gdfe_ros.mesh.tet_faces import flat_quads
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.contact.own_points import OwnPoints, incidence
from gdfe_ros.solver.contact.own_surface import Topology, flat_boundary
from gdfe_ros.solver.contact.penetration import InnerCells, WholeSurface, find_inside

SEPARATE = "remedy: return to a sound state and approach in smaller steps, or move the parts away from each other"
ROUGH = "; without friction, parts that are pressed on each other may slide aside: try self_contact: {friction: 0.1}"


class Inside:
    """Search for surface vertices that have penetrated into other cells of the body.

    Where a part touches by its skin, contact points and their triangles replace the vertices and faces of its cells.

    Args:
        body: the discretised body.
        points: the vertices and contact points of the body.
        surface: faces that may touch each other, and their vertices.
        meant: the self-contact definition, which gives the names of the parts.
    """

    def __init__(self, body: Body, points: OwnPoints, surface: Topology, meant: SelfContact) -> None:
        self._meant, self._points = meant, points
        simple, (faces, around) = body.cell_type.simple, _whole_surface(body, points)
        pieces = vertex_pieces(body.cells, len(body.rest))
        near = points.about(body.cells, np.repeat(body.cells, len(simple), axis=0))
        cells = np.ascontiguousarray(body.cells[:, simple].reshape(-1, 8))
        chosen = {tuple(quad) for quad in surface.quads.tolist()}
        touchable = np.array([tuple(quad) in chosen for quad in faces.tolist()])
        owners = pieces[points.main[faces[:, 0]]]
        order, count = np.argsort(owners, kind="stable"), int(pieces.max()) + 1
        starts = np.searchsorted(owners[order], np.arange(count + 1)).astype(np.int64)
        quads = np.ascontiguousarray(faces[order], dtype=np.int32)
        around = around[:, order].tocsr()[np.repeat(np.arange(len(body.cells)), len(simple))]
        rest = points.at(body.rest)
        self._surface = WholeSurface(surface.vertices, quads, touchable[order], starts, *_ragged(around), rest)
        owners = pieces[cells[:, 0]].astype(np.int64)
        self._inner = InnerCells(cells, owners, *_ragged(near))
        middles = np.flatnonzero(touchable[order]) + len(rest)
        self._middles = self._surface._replace(vertices=middles.astype(np.int32))
        self._about = InnerCells(cells, owners, *_ragged(_whole_faces(near, quads)))
        self._deep = surface.depth

    def depths(self, x: NDArray[np.float64], bound: float) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Return the penetration depth [m] of each surface vertex (k,), and the cell in which it lies (k,).

        Depth and cell are 0 and -1 in three cases: the vertex is in no foreign cell, it is less than ``bound`` [m]
        below the surface, or its nearest face takes no part in self-contact. Contact points count only where cells are:
        a skin that lies beyond its cells may enter another one by this distance.

        Args:
            x: (n + p, 3) [m] positions.
            bound: [m] least depth that is reported.
        """
        return _found(x, self._surface, self._inner, bound)

    def told(self, x: NDArray[np.float64], bound: float) -> tuple[float, str]:
        """Return the largest penetration depth [m], and a sentence with parts, depth and place; 0 and empty if none."""
        depths, cells = self.depths(x, bound)
        deepest, vertices = int(depths.argmax()), self._surface.vertices
        if not depths[deepest] > 0.0:
            depths, cells = self._middle_depths(x)
            deepest, vertices = int(depths.argmax()), self._surface.quads[self._middles.vertices - len(x), 0]
        if not depths[deepest] > 0.0:
            return 0.0, ""
        vertex, depth = vertices[deepest], float(depths[deepest])
        return depth, self._sentence(vertex, self._inner.cells[cells[deepest], 0], x[vertex], depth)

    def _middle_depths(self, x: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Return depths and cells of the middles of the faces, where they are at least a quarter of an edge deep.

        Two plates of one cell that lie in one plane and overlap have all vertices on the surface of each other.
        """
        whole = np.concatenate([x, x[self._surface.quads].mean(axis=1)])
        return _found(whole, self._middles, self._about, self._deep)

    def told_of(self, x: NDArray[np.float64], ends: NDArray[np.int32], depth: float) -> str:
        """Return the sentence of `told` for two edges with the vertices ``ends`` (2, 2) that have passed each other."""
        return self._sentence(ends[0, 0], ends[1, 0], x[ends].mean(axis=(0, 1)), depth)

    def _sentence(self, vertex: int, within: int, place: NDArray[np.float64], depth: float) -> str:
        """Return a sentence about a vertex that lies inside of the part of another vertex, deepest at ``place`` [m]."""
        own, other = (self._meant.owner(self._points.main[point]) for point in (vertex, within))
        where = ", ".join(f"{value:.4g}" for value in place + self._meant.origin)
        inside = f"{depth:.3g} m inside of {'itself' if own == other else other}"
        rough = "" if self._meant.friction else ROUGH
        return f"{own} lies {inside}, deepest at [{where}] m; {SEPARATE}{rough}"


def _found(
    x: NDArray[np.float64], surface: WholeSurface, inner: InnerCells, bound: float
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the result of `find_inside`; nothing is found if a position is not finite."""
    count = len(surface.vertices)
    depth, cell = np.zeros(count), np.full(count, -1, dtype=np.int64)
    if np.isfinite(x).all():
        find_inside(x, surface, inner, bound, depth, cell)
    return depth, cell


def _whole_surface(body: Body, points: OwnPoints) -> tuple[NDArray[np.int32], sparse.csr_matrix]:
    """Return all faces (q, 4) of a body, and for each cell, the triangles of skins around it, as a matrix (m, q).

    The faces are triangles of contact points, and the boundary faces of other parts.
    """
    quads, _ = flat_boundary(body)
    if body.skin is None:
        return quads, sparse.csr_matrix((len(body.cells), len(quads)))
    quads = body.skin.without(quads)
    lined = flat_quads(body.skin.faces) + np.int32(points.count)
    carrying = incidence(points.corners[body.skin.faces].reshape(len(lined), -1), points.count)
    none = sparse.csr_matrix((len(body.cells), len(quads)), dtype=carrying.dtype)
    around = sparse.hstack([none, incidence(body.cells, points.count) @ carrying.T])
    return np.concatenate([quads, lined]), around.tocsc()


def _whole_faces(near: sparse.csr_matrix, quads: NDArray[np.int32]) -> sparse.csr_matrix:
    """Return the faces (m, n + p + q) whose corners are all ``near`` (m, n + p) each cell, as numbers of middles."""
    some = sparse.csr_matrix((np.ones(near.nnz, np.int32), near.indices, near.indptr), shape=near.shape)
    counts = (some @ incidence(quads, near.shape[1]).T).tocsr()  # a triangle counts its last corner twice
    counts.data = (counts.data == quads.shape[1]).astype(np.int32)
    counts.eliminate_zeros()
    counts.sort_indices()
    return sparse.hstack([sparse.csr_matrix(near.shape, dtype=np.int32), counts]).tocsr()


def _ragged(rows: sparse.csr_matrix) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the offsets (m + 1,) and values of the list of columns in each of m rows."""
    return rows.indptr.astype(np.int64), rows.indices.astype(np.int64)
