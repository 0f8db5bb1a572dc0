# SPDX-License-Identifier: Apache-2.0
"""Compiled search for surface vertices inside foreign cells, and their depth."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.compiled import inlined, internal, kernel
from gdfe_ros.mesh.triples import along, corner, cross, dot, minus, solid_angle
from gdfe_ros.solver.contact.cell_place import corner_shape, place_in_cell
from gdfe_ros.solver.contact.closest import EQUAL, among, closest_on, point_on

MOST_BINS = 4
"""Largest number of bins of the search grid, divided by the number of vertices."""


class WholeSurface(NamedTuple):
    """All faces of a body, and the vertices of those faces that may touch.

    Attributes:
        vertices: (k,) int32 vertices that may touch; numbers from n + p on are the middles of the faces, in order.
        quads: (q, 4) int32 all faces, ordered by connected piece.
        touchable: (q,) whether each face takes part in self-contact.
        starts: (p + 1,) index at which the faces of each piece begin.
        around_starts: (m + 1,) index into ``around`` at which the list of each cell begins.
        around: triangles of a skin around each cell, as indices of ``quads``.
        rest: (n + p, 3) [m] positions at rest.
    """

    vertices: NDArray[np.int32]
    quads: NDArray[np.int32]
    touchable: NDArray[np.bool_]
    starts: NDArray[np.int64]
    around_starts: NDArray[np.int64]
    around: NDArray[np.int64]
    rest: NDArray[np.float64]


class InnerCells(NamedTuple):
    """The cells of a body.

    Attributes:
        cells: (m, 8) int32 corners of the cells.
        pieces: (m,) connected piece of each cell.
        near_starts: (m + 1,) index into ``near`` at which the list of each cell begins.
        near: vertices of the cells that share a vertex with each cell, ascending. They are not tested in this cell.
    """

    cells: NDArray[np.int32]
    pieces: NDArray[np.int64]
    near_starts: NDArray[np.int64]
    near: NDArray[np.int64]


@internal
def depth_below(x, quads, touchable, first, last, vertex, middle, bound):
    """Return the distance [m] from a vertex to the nearest of the faces from ``first`` up to ``last``.

    Faces with this vertex as a corner are left out, and the face ``middle``, whose middle the vertex is. The result is
    0 if the distance is below ``bound`` [m], or if the nearest face takes no part in self-contact.
    """
    px, py, pz = x[vertex, 0], x[vertex, 1], x[vertex, 2]
    least, takes_part = np.inf, False
    for f in range(first, last):
        below, own = 0.0, f == middle
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
        if away >= (1.0 + EQUAL) * least:
            continue
        a, b, c = corner(x, quads[f, 0]), corner(x, quads[f, 1]), corner(x, quads[f, 2])
        n = cross(minus(b, a), minus(c, a))
        above = dot(n, (px - c0, py - c1, pz - c2)) / max(math.sqrt(dot(n, n)), 1e-300)
        if away < (1.0 - EQUAL) * least or abs(above) > abs(height):
            height = above
        least = min(least, away)
    return height > 0.0


@internal
def was_outside(rest, quads, first, last, cells, e, place):
    """Return whether a place (three cell coordinates) of cell ``e`` lies outside of the faces of its piece, at rest.

    A body may fold until the surface around a cell is far from a place in it. At rest it is not folded, and the solid
    angle of the whole closed surface decides.
    """
    p = (0.0, 0.0, 0.0)
    for a in range(8):
        p = along(1.0, p, corner_shape(a, *place)[0], corner(rest, cells[e, a]))
    angle = 0.0
    for f in range(first, last):
        a, b = minus(corner(rest, quads[f, 0]), p), minus(corner(rest, quads[f, 1]), p)
        c, d = minus(corner(rest, quads[f, 2]), p), minus(corner(rest, quads[f, 3]), p)
        angle += solid_angle(a, b, c) + solid_angle(a, c, d)
    return angle < 2.0 * math.pi


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


@inlined
def depth_in(x, surface, inner, box, e, v, bound):
    """Return how deep [m] a vertex lies in cell ``e``, whose bounding box is ``box`` (2, 3); 0 if it is outside."""
    p0, p1, p2 = x[v, 0], x[v, 1], x[v, 2]
    if p0 < box[0, 0] or p0 > box[1, 0] or p1 < box[0, 1] or p1 > box[1, 1] or p2 < box[0, 2] or p2 > box[1, 2]:
        return 0.0
    if among(inner.near_starts, inner.near, e, v):
        return 0.0
    within, place = place_in_cell(x, inner.cells, e, p0, p1, p2)
    if not within or in_front(x, surface.quads, surface.around_starts, surface.around, e, p0, p1, p2):
        return 0.0
    first, last = surface.starts[inner.pieces[e]], surface.starts[inner.pieces[e] + 1]
    lined = surface.around_starts[e] < surface.around_starts[e + 1]
    if lined and was_outside(surface.rest, surface.quads, first, last, inner.cells, e, place):
        return 0.0
    return depth_below(x, surface.quads, surface.touchable, first, last, v, v - len(surface.rest), bound)


@inlined
def bins_between(first, last, edge, count):
    """Return the first and the last of ``count`` bins between two distances [m] from the lowest bin's beginning.

    For distances beyond all bins they are 0 and -1: no bin.
    """
    begin, end = max(0, math.floor(first / edge)), min(count - 1, math.floor(last / edge))
    return (begin, end) if begin <= end else (0, -1)


@kernel
def find_inside(x, surface, inner, bound, depth, cell):
    """Find the surface vertices inside cells, and their depth below the faces of the cell's connected piece.

    Args:
        x: (n + p, 3) [m] positions, finite; (n + p + q, 3) with the middles of the faces.
        surface: a `WholeSurface`.
        inner: `InnerCells`.
        bound: [m] least depth that is reported.
        depth: (k,) [m], is written for vertices inside a cell.
        cell: (k,), is written for vertices inside a cell.
    """
    vertices, cells = surface.vertices, inner.cells
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
        i0, i1 = bins_between(boxes[e, 0, 0] - low[0], boxes[e, 1, 0] - low[0], edge, n0)
        j0, j1 = bins_between(boxes[e, 0, 1] - low[1], boxes[e, 1, 1] - low[1], edge, n1)
        k0, k1 = bins_between(boxes[e, 0, 2] - low[2], boxes[e, 1, 2] - low[2], edge, n2)
        for i in range(i0, i1 + 1):
            for j in range(j0, j1 + 1):
                row = (i * n1 + j) * n2
                for at in range(starts[row + k0], starts[row + k1 + 1]):
                    k = order[at]
                    found = depth_in(x, surface, inner, boxes[e], e, vertices[k], bound)
                    if found > depth[k]:
                        depth[k], cell[k] = found, e
