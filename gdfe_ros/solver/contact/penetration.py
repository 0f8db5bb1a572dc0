# SPDX-License-Identifier: Apache-2.0
"""Compiled depth of points of the surface inside cells."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.compiled import inlined, internal, kernel
from gdfe_ros.mesh.triples import along, corner, cross, dot, minus, unit
from gdfe_ros.solver.contact.closest import EQUAL, area_vector, clamped, closest_on, face_at, to_box
from gdfe_ros.solver.contact.near import Ragged, boxes_around

MOST_STEPS = 25
"""Largest number of Newton iterations in one cell."""
EXACT = 1e-9
"""A point counts as inside a cell if its cell coordinates exceed the limits 0 and 1 by less than this."""


NO_POINT = np.full(4, -1, np.int32)
"""Stands for no point of the surface."""


class FilledCells(NamedTuple):
    """The cells of a body, and the surface of its material.

    Attributes:
        cells: (m, 8) int32 corners of the cells.
        pieces: (m,) connected piece of each cell.
        near: vertices and contact points of the cells that share a vertex with each of m cells. They are not tested in
            this cell.
        quads: (q, 4) int32 all faces, ordered by connected piece: triangles of skins, and faces of other cells.
        touchable: (q,) whether each face takes part in self-contact.
        starts: (p + 1,) index at which the faces of each piece begin.
        lined: (p,) whether each piece has a skin.
        rest, boxes: (n + p, 3) and (q, 2, 3) [m] positions, and boxes around the faces, at rest.
    """

    cells: NDArray[np.int32]
    pieces: NDArray[np.int64]
    near: Ragged
    quads: NDArray[np.int32]
    touchable: NDArray[np.bool_]
    starts: NDArray[np.int64]
    lined: NDArray[np.bool_]
    rest: NDArray[np.float64]
    boxes: NDArray[np.float64]


@inlined
def point_in_cell(x, cell, u, v, w):
    """Return the point (3,) [m] of a cell at the coordinates u, v, w from 0 to 1, and its three derivatives."""
    low, high = face_at(x, cell[:4], u, v), face_at(x, cell[4:], u, v)
    place, du = along(1.0 - w, low[0], w, high[0]), along(1.0 - w, low[1], w, high[1])
    return place, du, along(1.0 - w, low[2], w, high[2]), minus(high[0], low[0])


@internal
def place_in_cell(x, cell, p):
    """Return whether the point p [m] lies in a cell, and its cell coordinates (3,), by Newton's method."""
    u, v, w = 0.5, 0.5, 0.5
    for _ in range(MOST_STEPS):
        place, du, dv, dw = point_in_cell(x, cell, u, v, w)
        r, n = minus(p, place), cross(dv, dw)
        det = dot(du, n)
        if det == 0.0:
            break
        u1, v1, w1 = dot(r, n) / det, dot(r, cross(dw, du)) / det, dot(r, cross(du, dv)) / det
        u, v, w = clamped(u + u1, 0.5), clamped(v + v1, 0.5), clamped(w + w1, 0.5)
        if abs(u1) + abs(v1) + abs(w1) < 0.1 * EXACT:
            return min(u, v, w) > -EXACT and max(u, v, w) < 1.0 + EXACT, (u, v, w)
    return False, (u, v, w)


@inlined
def has_all(quad, point):
    """Return whether all numbers of ``point`` (4,) are corners of a face."""
    count = 0
    for a in range(4):
        count += point[a] in (quad[0], quad[1], quad[2], quad[3])
    return count == 4


@internal
def nearest_of(x, boxes, material, piece, point, p, bound):
    """Return the nearest face of a piece to a point p [m], their distance [m], and the height [m] of p above its plane.

    Faces with all of ``point`` (4,) as corners are left out. If several are equally near, at an edge or a corner, it is
    the one whose plane is farthest from p. The search ends with a face that is nearer than ``bound`` [m].
    """
    nearest, least, height = -1, np.inf, 0.0
    for f in range(material.starts[piece], material.starts[piece + 1]):
        quad = material.quads[f]
        if to_box(boxes, f, p) >= (1.0 + EQUAL) * least or has_all(quad, point):
            continue
        _, d, away = closest_on(x, quad, p)
        if away >= (1.0 + EQUAL) * least:
            continue
        n = area_vector(x, quad)
        above = dot(unit(n), d)
        if away < (1.0 - EQUAL) * least or abs(above) > abs(height):
            nearest, height = f, above
        least = min(least, away)
        if least < bound:
            break
    return nearest, least, height


@internal
def depth_in(x, boxes, material, e, point, p, bound):
    """Return the depth [m] of a point p [m] in cell ``e``, below the faces of the piece; see `find_inside`.

    In a piece with a skin, the point is in the material if it is behind the nearest triangle, and if its place at rest
    is so, too: a body may fold until the surface of a cell is far from a place in it.
    """
    piece, (within, place) = material.pieces[e], place_in_cell(x, material.cells[e], p)
    if not within:
        return 0.0
    face, least, height = nearest_of(x, boxes, material, piece, point, p, bound)
    if face < 0 or least < bound or not material.touchable[face]:
        return 0.0
    if material.lined[piece]:
        rest, around = point_in_cell(material.rest, material.cells[e], *place)[0], material.boxes
        height = max(height, nearest_of(material.rest, around, material, piece, NO_POINT, rest, 0.0)[2])
    return 0.0 if material.lined[piece] and height > 0.0 else least


@kernel
def find_inside(x, material, points, places, pairs, bounds, depth, cell):
    """Find which points of the surface are inside of cells, and their depth below the faces of the cells' pieces.

    The depth is 0 if it is below the bound, or if the nearest face takes no part in self-contact.

    Args:
        x: (n + p, 3) [m] positions.
        material: `FilledCells`.
        points: (k, 4) faces whose middles are tested; four times the same number for a vertex or contact point.
        places: (k, 3) [m] their positions.
        pairs: (2, i) points and cells that may contain them.
        bounds: (k,) [m] least depths that are reported.
        depth: (k,) [m], is written for points inside a cell.
        cell: (k,), is written for points inside a cell.
    """
    boxes = boxes_around(x, material.quads)
    for pair in range(pairs.shape[1]):
        k, e = pairs[0, pair], pairs[1, pair]
        found = depth_in(x, boxes, material, e, points[k], corner(places, k), bounds[k])
        if found > depth[k]:
            depth[k], cell[k] = found, e
