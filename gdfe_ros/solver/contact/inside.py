# SPDX-License-Identifier: Apache-2.0
"""Penetration of the body into itself: points of its surface in foreign cells, and their depth, whatever touches."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.constraints.obstacle import SelfContact
from gdfe_ros.mesh.faces import vertex_pieces
from gdfe_ros.mesh.tet_faces import flat_quads
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.contact.near import boxes_around, find_near, ragged
from gdfe_ros.solver.contact.own_surface import Topology, flat_boundary
from gdfe_ros.solver.contact.penetration import FilledCells, find_inside
from gdfe_ros.solver.contact.surface import BodyPoints

SEPARATE = "remedy: return to a sound state and approach in smaller steps, or move the parts away from each other"
ROUGH = "; without friction, parts that are pressed on each other may slide aside: try self_contact: {friction: 0.1}"


class Inside:
    """Search for points of the surface that have penetrated into other cells of the body.

    Where a part touches by its skin, contact points and their triangles replace the vertices and faces of its cells.

    Args:
        body: the discretised body.
        points: the vertices and contact points of the body.
        surface: faces that may touch each other, and their vertices.
        meant: the self-contact definition, which gives the names of the parts.
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
        near = ragged(points.around(body.cells, np.repeat(body.cells, len(simple), axis=0)))
        owners, rest = pieces[cells[:, 0]].astype(np.int64), points.at(body.rest)
        self._material = FilledCells(
            cells, owners, near, quads, touchable, starts, lined, rest, boxes_around(rest, quads)
        )
        self._tested = np.concatenate([np.repeat(surface.vertices[:, None], 4, axis=1), quads[touchable]])
        self._count, self._deep = len(surface.vertices), surface.depth

    def depths(self, x: NDArray[np.float64], bound: float) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Return the penetration depth [m] of each surface vertex (k,), and the cell in which it lies (k,).

        Depth and cell are 0 and -1 in three cases: the vertex is in no foreign cell, it is less than ``bound`` [m]
        below the surface, or its nearest face takes no part in self-contact. Contact points count only where cells are:
        a skin that lies beyond its cells may enter another one by this distance.

        Args:
            x: (n + p, 3) [m] positions.
            bound: [m] least depth that is reported.
        """
        depths, cells = self._find(x, bound)
        return depths[: self._count], cells[: self._count]

    def _find(self, x: NDArray[np.float64], bound: float) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Return what `depths` returns, also of the middles of faces that are at least a quarter of an edge deep.

        Two plates of one cell that lie in one plane and overlap have all vertices on the surface of each other. Nothing
        is found if a position is not finite.
        """
        depth, bounds = np.zeros(len(self._tested)), np.full(len(self._tested), bound)
        cell, bounds[self._count :] = np.full(len(depth), -1, dtype=np.int64), self._deep
        if np.isfinite(x).all():
            places, material = 0.25 * np.einsum("kai->ki", x[self._tested]), self._material
            boxes, cells = np.stack([places, places], axis=1), boxes_around(x, material.cells)
            pairs = find_near(boxes, cells, self._tested, material.near, 0.0)
            find_inside(x, material, self._tested, places, pairs, bounds, depth, cell)
        return depth, cell

    def told(self, x: NDArray[np.float64], bound: float) -> tuple[float, str]:
        """Return the largest penetration depth [m], and a sentence with parts, depth and place; 0 and empty if none."""
        depths, cells = self._find(x, bound)
        deepest = int(depths.argmax())
        if not depths[deepest] > 0.0:
            return 0.0, ""
        own, other, depth = self._tested[deepest], self._material.cells[cells[deepest], 0], float(depths[deepest])
        return depth, self.sentence(own[0], other, x[own].mean(axis=0), depth)

    def sentence(self, vertex: int, within: int, place: NDArray[np.float64], depth: float) -> str:
        """Return a sentence about a vertex that lies inside of the part of another vertex, deepest at ``place`` [m]."""
        own, other = (self._meant.owner(self._points.vertices[point]) for point in (vertex, within))
        where = ", ".join(f"{value:.4g}" for value in place + self._meant.origin)
        inside = f"{depth:.3g} m inside of {'itself' if own == other else other}"
        rough = "" if self._meant.friction else ROUGH
        return f"{own} lies {inside}, deepest at [{where}] m; {SEPARATE}{rough}"
