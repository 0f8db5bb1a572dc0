# SPDX-License-Identifier: Apache-2.0
"""Penetration of the body into itself: points of its surface inside foreign cells, and their depth, without pairs."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.compiled import inlined, internal, kernel
from gdfe_ros.constraints.obstacle import SelfContact
from gdfe_ros.mesh.cells.faces import vertex_pieces
from gdfe_ros.mesh.cells.tetrahedra import flat_quads
from gdfe_ros.mesh.triples import along, corner, cross, dot, minus, unit
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.contact.contact_surface import BodyPoints
from gdfe_ros.solver.contact.near import KeptPairs, Ragged, boxes_around, find_near, make_ragged
from gdfe_ros.solver.contact.self_contact.closest import EQUAL, area_vector, clamp, closest_on, face_at, to_box
from gdfe_ros.solver.contact.self_contact.own_surface import Topology, flat_boundary

SEPARATE = "remedy: return to a sound state and approach in smaller steps, or move the parts away from each other"
ROUGH = "; without friction, parts that are pressed on each other may slide aside: try self_contact: {friction: 0.1}"
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
        near: for each of m cells, the vertices and contact points of all cells that share a vertex with it. They are
            not tested in this cell.
        quads: (q, 4) int32 all faces, ordered by connected piece: triangles of skins, and faces of other cells.
        touchable: (q,) whether each face takes part in self-contact.
        starts: (p + 1,) index at which the faces of each piece begin.
        lined: (p,) whether each piece has a skin.
        rest, boxes: undeformed positions (n + p, 3) [m] of the points, and boxes (q, 2, 3) [m] around the undeformed
            faces.
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
        u, v, w = clamp(u + u1, 0.5), clamp(v + v1, 0.5), clamp(w + w1, 0.5)
        if abs(u1) + abs(v1) + abs(w1) < 0.1 * EXACT:
            return min(u, v, w) > -EXACT and max(u, v, w) < 1.0 + EXACT, (u, v, w)
    return False, (u, v, w)


@inlined
def has_all(quad, point):
    """Return whether all indices in ``point`` (4,) are corners of a face."""
    count = 0
    for a in range(4):
        count += point[a] in (quad[0], quad[1], quad[2], quad[3])
    return count == 4


@internal
def nearest_of(x, boxes, material, piece, point, p, bound):
    """Return the face of a piece nearest to a point p [m], their distance [m], and the height [m] of p above its plane.

    Faces with all indices in ``point`` (4,) as corners are left out. If several faces are equally near, at an edge or a
    corner, the face whose plane is farthest from p is returned. The search ends at the first face that is nearer than
    ``bound`` [m].
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

    In a piece with a skin, the point is in the material if it is behind the nearest face, in the deformed and in the
    undeformed body. The second condition is needed because folding may move the surface in a cell far from other places
    in this cell.
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
    """Find the points of the surface that are inside of cells, and their depth below the faces of the cells' pieces.

    The depth is 0 if it is below the least reported depth, or if the nearest face takes no part in self-contact.

    Args:
        x: (n + p, 3) [m] positions.
        material: `FilledCells`.
        points: (k, 4) faces whose middles are tested; for a tested vertex or contact point, its index four times.
        places: (k, 3) [m] the tested positions.
        pairs: (2, i) points and cells that may contain them.
        bounds: (k,) [m] least depths that are reported.
        depth: (k,) [m], is written for points inside a cell.
        cell: (k,), is written for points inside a cell.
    """
    boxes, cells = boxes_around(x, material.quads), boxes_around(x, material.cells)
    for pair in range(pairs.shape[1]):
        k, e = pairs[0, pair], pairs[1, pair]
        if to_box(cells, e, corner(places, k)) > 0.0:
            continue
        found = depth_in(x, boxes, material, e, points[k], corner(places, k), bounds[k])
        if found > depth[k]:
            depth[k], cell[k] = found, e


class Inside:
    """Search for points of the surface that have penetrated into other cells of the body.

    Where a part touches by its skin, contact points and their triangles replace the vertices and faces of its cells.

    Args:
        body: the discretised body.
        points: the vertices and contact points of the body.
        surface: faces that may touch each other, and their vertices.
        meant: the self-contact of the scene, which has the names of the parts.
    """

    def __init__(self, body: Body, points: BodyPoints, surface: Topology, meant: SelfContact) -> None:
        self._meant, self._points, simple = meant, points, body.cell_type.simple
        quads, _ = flat_boundary(body)
        if body.skin is not None:
            quads = np.concatenate([body.skin.without(quads), flat_quads(body.skin.faces) + np.int32(points.count)])
        pieces = vertex_pieces(body.cells, len(body.rest))
        owners = pieces[points.vertices[quads[:, 0]]]
        quads = np.ascontiguousarray(quads[np.argsort(owners, kind="stable")], dtype=np.int32)
        chosen = {tuple(quad) for quad in surface.quads.tolist()}
        touchable = np.array([tuple(quad) in chosen for quad in quads.tolist()])
        count = int(pieces.max()) + 1
        starts = np.searchsorted(np.sort(owners), np.arange(count + 1)).astype(np.int64)
        lined = np.isin(np.arange(count), pieces[points.vertices[quads[quads[:, 0] >= points.count, 0]]])
        cells = np.ascontiguousarray(body.cells[:, simple].reshape(-1, 8))
        near = make_ragged(points.around(body.cells, np.repeat(body.cells, len(simple), axis=0)))
        owners, rest = pieces[cells[:, 0]].astype(np.int64), points.at(body.rest)
        self._material = FilledCells(
            cells, owners, near, quads, touchable, starts, lined, rest, boxes_around(rest, quads)
        )
        self._tested = np.concatenate([np.repeat(surface.vertices[:, None], 4, axis=1), quads[touchable]])
        self._count, self._deep = len(surface.vertices), surface.depth
        every, none = np.arange(len(rest), dtype=np.int32), np.zeros((2, 0), np.int64)
        self._kept = KeptPairs(self._find_cells, every, surface.depth, none)

    def depths(self, x: NDArray[np.float64], bound: float) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Return the penetration depth [m] of each surface vertex (k,), and the cell in which it lies (k,).

        Depth and cell are 0 and -1 in three cases: the vertex is in no foreign cell, it is less than ``bound`` [m]
        below the surface, or its nearest face takes no part in self-contact. Contact points count only inside of cells:
        where a skin lies outside its cells, another skin may enter it by the distance between skin and cells.

        Args:
            x: (n + p, 3) [m] positions.
            bound: [m] least depth that is reported.
        """
        depths, cells = self._find(x, bound)
        return depths[: self._count], cells[: self._count]

    def _find(self, x: NDArray[np.float64], bound: float) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Do `depths` for the tested points: surface vertices, and middles of faces at least `Topology.depth` inside.

        Middles are needed for two plates, each one cell thick, that overlap in one plane: each of their vertices lies
        on the surface of the other plate. Nothing is found if a position is not finite.
        """
        depth, bounds = np.zeros(len(self._tested)), np.full(len(self._tested), bound)
        cell, bounds[self._count :] = np.full(len(depth), -1, dtype=np.int64), self._deep
        given = self._material, self._tested, self._middles(x), self._kept.within(x, 0.0)
        find_inside(x, *given, bounds, depth, cell)
        return depth, cell

    def _middles(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the positions (k, 3) [m] of the tested points."""
        return 0.25 * np.einsum("kai->ki", x[self._tested])

    def _find_cells(self, x: NDArray[np.float64], within: float) -> NDArray[np.int64]:
        """Return the pairs (2, i) of tested points and cells that are at most ``within`` [m] apart along each axis."""
        places, cells = self._middles(x), boxes_around(x, self._material.cells)
        return find_near(np.stack([places, places], axis=1), cells, self._tested, self._material.near, within)

    def tell(self, x: NDArray[np.float64], bound: float) -> tuple[float, str]:
        """Return the largest penetration depth [m] and a sentence with parts, depth and place; 0 and empty if none."""
        depths, cells = self._find(x, bound)
        deepest = int(depths.argmax())
        if not depths[deepest] > 0.0:
            return 0.0, ""
        own, other, depth = self._tested[deepest], self._material.cells[cells[deepest], 0], float(depths[deepest])
        return depth, self.sentence(own[0], other, x[own].mean(axis=0), depth)

    def sentence(self, vertex: int, within: int, place: NDArray[np.float64], depth: float) -> str:
        """Return a sentence: a vertex is inside of the part of the vertex ``within``, deepest at ``place`` (3,) [m]."""
        own, other = (self._meant.owner(self._points.vertices[point]) for point in (vertex, within))
        where = ", ".join(f"{value:.4g}" for value in place + self._meant.origin)
        inside = f"{depth:.3g} m inside of {'itself' if own == other else other}"
        rough = "" if self._meant.friction else ROUGH
        return f"{own} lies {inside}, deepest at [{where}] m; {SEPARATE}{rough}"
