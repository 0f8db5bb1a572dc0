# SPDX-License-Identifier: Apache-2.0
"""Penetration of the body into itself: vertices inside foreign cells, and their depth, independent of contact pairs."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from gdfe_ros.compiled import inlined, internal, kernel
from gdfe_ros.constraints.self_contact import SelfContact
from gdfe_ros.mesh.faces import vertex_pieces
from gdfe_ros.mesh.triples import corner, cross, dot, minus
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.contact.closest import among, closest_on, point_on
from gdfe_ros.solver.contact.own_points import OwnPoints, incidence
from gdfe_ros.solver.contact.own_surface import Topology, flat_boundary

MOST_STEPS = 25
"""Largest number of Newton iterations in one cell."""
EXACT = 1e-9
"""A point counts as inside a cell if its cell coordinates exceed the limits 0 and 1 by less than this."""
SEPARATE = "remedy: return to a sound state and approach in smaller steps, or move the parts away from each other"
MOST_BINS = 4
"""Largest number of bins of the search grid, divided by the number of vertices."""


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
        self._skin = (surface.vertices, quads, touchable[order], starts, *_ragged(around))
        self._cells = (cells, pieces[cells[:, 0]].astype(np.int64), *_ragged(near))

    def depths(self, x: NDArray[np.float64], bound: float) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Return the penetration depth [m] of each surface vertex (k,), and the cell in which it lies (k,).

        Depth and cell are 0 and -1 in three cases: the vertex is in no foreign cell, it is less than ``bound`` [m]
        below the surface, or its nearest face takes no part in self-contact. Contact points count only where cells are:
        a skin that lies beyond its cells may enter another one by this distance.

        Args:
            x: (n + p, 3) [m] positions.
            bound: [m] least depth that is reported.
        """
        count = len(self._skin[0])
        depth, cell = np.zeros(count), np.full(count, -1, dtype=np.int64)
        if np.isfinite(x).all():
            find_inside(x, *self._skin, *self._cells, bound, depth, cell)
        return depth, cell

    def told(self, x: NDArray[np.float64], bound: float) -> tuple[float, str]:
        """Return the largest penetration depth [m], and a sentence with parts, depth and place; 0 and empty if none."""
        depths, cells = self.depths(x, bound)
        deepest = int(depths.argmax())
        if not depths[deepest] > 0.0:
            return 0.0, ""
        vertex, depth = self._skin[0][deepest], float(depths[deepest])
        return depth, self._sentence(vertex, self._cells[0][cells[deepest], 0], x[vertex], depth)

    def told_of(self, x: NDArray[np.float64], ends: NDArray[np.int32], depth: float) -> str:
        """Return the sentence of `told` for two edges with the vertices ``ends`` (2, 2) that have passed each other."""
        return self._sentence(ends[0, 0], ends[1, 0], x[ends].mean(axis=(0, 1)), depth)

    def _sentence(self, vertex: int, within: int, place: NDArray[np.float64], depth: float) -> str:
        """Return a sentence about a vertex that lies inside of the part of another vertex, deepest at ``place`` [m]."""
        own, other = (self._meant.owner(self._points.main[point]) for point in (vertex, within))
        where = ", ".join(f"{value:.4g}" for value in place + self._meant.origin)
        inside = f"{depth:.3g} m inside of {'itself' if own == other else other}"
        return f"{own} lies {inside}, deepest at [{where}] m; {SEPARATE}"


def _whole_surface(body: Body, points: OwnPoints) -> tuple[NDArray[np.int32], sparse.csr_matrix]:
    """Return all faces (q, 4) of a body, and for each cell, the triangles of skins around it, as a matrix (m, q).

    The faces are triangles of contact points, and the boundary faces of other parts.
    """
    quads, _ = flat_boundary(body)
    if body.skin is None:
        return quads, sparse.csr_matrix((len(body.cells), len(quads)))
    quads = quads[~np.isin(quads[:, 0], body.skin.vertices)]
    lined = body.skin.faces[:, [0, 1, 2, 2]] + np.int32(points.count)
    carrying = incidence(points.corners[body.skin.faces].reshape(len(lined), -1), points.count)
    none = sparse.csr_matrix((len(body.cells), len(quads)), dtype=carrying.dtype)
    around = sparse.hstack([none, incidence(body.cells, points.count) @ carrying.T])
    return np.concatenate([quads, lined]), around.tocsc()


def _ragged(rows: sparse.csr_matrix) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the offsets (m + 1,) and values of the list of columns in each of m rows."""
    return rows.indptr.astype(np.int64), rows.indices.astype(np.int64)


@inlined
def corner_shape(which, u, v, w):
    """Return a corner's shape function (VTK's order) at u, v, w in [0, 1], and its three derivatives."""
    a = u if which in (1, 2, 5, 6) else 1.0 - u
    b = v if which in (2, 3, 6, 7) else 1.0 - v
    c = w if which >= 4 else 1.0 - w
    da = 1.0 if which in (1, 2, 5, 6) else -1.0
    db = 1.0 if which in (2, 3, 6, 7) else -1.0
    dc = 1.0 if which >= 4 else -1.0
    return a * b * c, da * b * c, a * db * c, a * b * dc


@internal
def within_cell(x, cells, e, px, py, pz):
    """Return whether the point p [m] lies in cell ``e``, by Newton's method for the point's cell coordinates."""
    u, v, w = 0.5, 0.5, 0.5
    for _ in range(MOST_STEPS):
        r0, r1, r2 = px, py, pz
        a00, a01, a02, a10, a11, a12, a20, a21, a22 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for a in range(8):
            q = cells[e, a]
            s, du, dv, dw = corner_shape(a, u, v, w)
            r0, r1, r2 = r0 - s * x[q, 0], r1 - s * x[q, 1], r2 - s * x[q, 2]
            a00, a01, a02 = a00 + du * x[q, 0], a01 + dv * x[q, 0], a02 + dw * x[q, 0]
            a10, a11, a12 = a10 + du * x[q, 1], a11 + dv * x[q, 1], a12 + dw * x[q, 1]
            a20, a21, a22 = a20 + du * x[q, 2], a21 + dv * x[q, 2], a22 + dw * x[q, 2]
        c0, c1, c2 = a11 * a22 - a12 * a21, a12 * a20 - a10 * a22, a10 * a21 - a11 * a20
        det = a00 * c0 + a01 * c1 + a02 * c2
        if det == 0.0:
            return False
        d0, d1 = a02 * a21 - a01 * a22, a00 * a22 - a02 * a20
        e0, e1 = a01 * a12 - a02 * a11, a02 * a10 - a00 * a12
        d2, e2 = a01 * a20 - a00 * a21, a00 * a11 - a01 * a10
        u1 = (c0 * r0 + d0 * r1 + e0 * r2) / det
        v1 = (c1 * r0 + d1 * r1 + e1 * r2) / det
        w1 = (c2 * r0 + d2 * r1 + e2 * r2) / det
        u, v, w = clamp(u + u1), clamp(v + v1), clamp(w + w1)
        if abs(u1) + abs(v1) + abs(w1) < 0.1 * EXACT:
            return min(u, v, w) > -EXACT and max(u, v, w) < 1.0 + EXACT
    return False


@inlined
def clamp(value):
    """Return a cell coordinate clamped to [-0.5, 1.5]."""
    return min(max(value, -0.5), 1.5)


@internal
def depth_below(x, quads, touchable, first, last, vertex, bound):
    """Return the distance [m] from a vertex to the nearest of the faces from ``first`` up to ``last``.

    Faces with this vertex as a corner are left out. The result is 0 if the distance is below ``bound`` [m], or if the
    nearest face takes no part in self-contact.
    """
    px, py, pz = x[vertex, 0], x[vertex, 1], x[vertex, 2]
    least, takes_part = np.inf, False
    for f in range(first, last):
        below, own = 0.0, False
        for axis in range(3):
            p = px if axis == 0 else (py if axis == 1 else pz)
            low, high = np.inf, -np.inf
            for a in range(4):
                own |= quads[f, a] == vertex
                low, high = min(low, x[quads[f, a], axis]), max(high, x[quads[f, a], axis])
            below += max(0.0, low - p, p - high) ** 2
        if own or below >= least * least:
            continue
        u, v = closest_on(x, quads, f, px, py, pz)
        c0, c1, c2 = point_on(x, quads, f, u, v)
        away = math.sqrt((px - c0) ** 2 + (py - c1) ** 2 + (pz - c2) ** 2)
        if away < least:
            least, takes_part = away, touchable[f]
            if least < bound:
                return 0.0
    return least if takes_part else 0.0


@internal
def in_front(x, quads, starts, around, e, px, py, pz):
    """Return whether a point p [m] in cell ``e`` is in front of the skin around this cell, outside of the material.

    The nearest of the triangles ``around`` the cell decides. If several are equally near, at an edge or a corner, it is
    the one whose plane is farthest from the point. A cell without such triangles is full of material.
    """
    least, height = np.inf, 0.0
    for i in range(starts[e], starts[e + 1]):
        f = around[i]
        u, v = closest_on(x, quads, f, px, py, pz)
        c0, c1, c2 = point_on(x, quads, f, u, v)
        away = math.sqrt((px - c0) ** 2 + (py - c1) ** 2 + (pz - c2) ** 2)
        if away >= (1.0 + EXACT) * least:
            continue
        a, b, c = corner(x, quads[f, 0]), corner(x, quads[f, 1]), corner(x, quads[f, 2])
        n = cross(minus(b, a), minus(c, a))
        above = dot(n, (px - c0, py - c1, pz - c2)) / max(math.sqrt(dot(n, n)), 1e-300)
        if away < (1.0 - EXACT) * least or abs(above) > abs(height):
            height = above
        least = min(least, away)
    return height > 0.0


@internal
def sorted_into_bins(x, vertices, low, edge, n0, n1, n2):
    """Return the offset of each bin of the search grid, and the indices of the vertices (k,), sorted by bin."""
    count = len(vertices)
    where, starts, order = np.empty(count, np.int64), np.zeros(n0 * n1 * n2 + 1, np.int64), np.empty(count, np.int64)
    for k in range(count):
        v = vertices[k]
        i = min(int((x[v, 0] - low[0]) / edge), n0 - 1)
        j = min(int((x[v, 1] - low[1]) / edge), n1 - 1)
        where[k] = (i * n1 + j) * n2 + min(int((x[v, 2] - low[2]) / edge), n2 - 1)
        starts[where[k] + 1] += 1
    for b in range(n0 * n1 * n2):
        starts[b + 1] += starts[b]
    place = starts.copy()
    for k in range(count):
        order[place[where[k]]] = k
        place[where[k]] += 1
    return starts, order


@internal
def boxes_of(x, cells):
    """Return the bounds (m, 2, 3) [m] of the cells, and the longest edge [m] of these boxes."""
    boxes, edge = np.empty((len(cells), 2, 3)), 0.0
    for e in range(len(cells)):
        for axis in range(3):
            least, most = np.inf, -np.inf
            for a in range(8):
                least, most = min(least, x[cells[e, a], axis]), max(most, x[cells[e, a], axis])
            boxes[e, 0, axis], boxes[e, 1, axis] = least, most
            edge = max(edge, most - least)
    return boxes, edge


@kernel
def find_inside(
    x,
    vertices,
    quads,
    touchable,
    quad_starts,
    around_starts,
    around,
    cells,
    pieces,
    near_starts,
    near,
    bound,
    depth,
    cell,
):
    """Find the surface vertices inside cells, and their depth below the faces of the cell's connected piece.

    Args:
        x: (n + p, 3) [m] positions, finite.
        vertices: (k,) surface vertices.
        quads: (q, 4) all faces, ordered by piece.
        touchable: (q,) whether each face takes part in self-contact.
        quad_starts: (p + 1,) index at which the faces of each piece begin.
        around_starts: (m + 1,) index into ``around`` at which the list of each cell begins.
        around: triangles of a skin around each cell, as indices of ``quads``.
        cells: (m, 8) corners of the cells.
        pieces: (m,) connected piece of each cell.
        near_starts: (m + 1,) index into ``near`` at which the list of each cell begins.
        near: vertices of the cells that share a vertex with each cell, ascending. They are not tested in this cell.
        bound: [m] least depth that is reported.
        depth: (k,) [m], is written for vertices inside a cell.
        cell: (k,), is written for vertices inside a cell.
    """
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for v in vertices:
        for axis in range(3):
            low[axis], high[axis] = min(low[axis], x[v, axis]), max(high[axis], x[v, axis])
    boxes, edge = boxes_of(x, cells)
    if not edge > 0.0:
        return
    s0, s1, s2 = (high[0] - low[0]) / edge, (high[1] - low[1]) / edge, (high[2] - low[2]) / edge
    crowd = (s0 + 1.0) * (s1 + 1.0) * (s2 + 1.0) / (MOST_BINS * len(vertices))
    coarser = max(1.0, crowd)  # bounds the number of bins of a widely scattered surface
    edge, n0, n1, n2 = edge * coarser, int(s0 / coarser) + 1, int(s1 / coarser) + 1, int(s2 / coarser) + 1
    starts, order = sorted_into_bins(x, vertices, low, edge, n0, n1, n2)
    for e in range(len(cells)):
        i0, i1 = max(0, int((boxes[e, 0, 0] - low[0]) / edge)), min(n0 - 1, int((boxes[e, 1, 0] - low[0]) / edge))
        j0, j1 = max(0, int((boxes[e, 0, 1] - low[1]) / edge)), min(n1 - 1, int((boxes[e, 1, 1] - low[1]) / edge))
        k0, k1 = max(0, int((boxes[e, 0, 2] - low[2]) / edge)), min(n2 - 1, int((boxes[e, 1, 2] - low[2]) / edge))
        for i in range(i0, i1 + 1):
            for j in range(j0, j1 + 1):
                row = (i * n1 + j) * n2
                for at in range(starts[row + k0], starts[row + k1 + 1]):
                    k = order[at]
                    v = vertices[k]
                    p0, p1, p2 = x[v, 0], x[v, 1], x[v, 2]
                    if p0 < boxes[e, 0, 0] or p0 > boxes[e, 1, 0] or p1 < boxes[e, 0, 1] or p1 > boxes[e, 1, 1]:
                        continue
                    if p2 < boxes[e, 0, 2] or p2 > boxes[e, 1, 2] or among(near_starts, near, e, v):
                        continue
                    if not within_cell(x, cells, e, p0, p1, p2):
                        continue
                    if in_front(x, quads, around_starts, around, e, p0, p1, p2):
                        continue
                    first, last = quad_starts[pieces[e]], quad_starts[pieces[e] + 1]
                    found = depth_below(x, quads, touchable, first, last, v, bound)
                    if found > depth[k]:
                        depth[k], cell[k] = found, e
