# SPDX-License-Identifier: Apache-2.0
"""Compiled fold barrier of hexahedra (see `barrier`): volume ratios of corners, and the forces that open them."""

from __future__ import annotations

import math

import numpy as np

from gdfe_ros.compiled import inlined, internal
from gdfe_ros.materials.table import SHEAR
from gdfe_ros.mesh.triples import cross, dot
from gdfe_ros.solver.elements.barrier import NEARLY_FOLDED, THRESHOLD, WEIGHT, wall
from gdfe_ros.solver.elements.hexahedra import corner, edge

EDGES = np.array(
    [
        [[0, 1], [0, 3], [0, 4]],
        [[0, 1], [1, 2], [1, 5]],
        [[3, 2], [1, 2], [2, 6]],
        [[3, 2], [0, 3], [3, 7]],
        [[4, 5], [4, 7], [0, 4]],
        [[4, 5], [5, 6], [1, 5]],
        [[7, 6], [5, 6], [2, 6]],
        [[7, 6], [4, 7], [3, 7]],
    ],
    dtype=np.int32,
)
"""First and last corner of the three edges that meet in each corner (8, 3, 2), along xi, eta and zeta."""
SIDES = np.array([[0, 1, 1, 0, 0, 1, 1, 0], [0, 0, 1, 1, 0, 0, 1, 1], [0, 0, 0, 0, 1, 1, 1, 1]], dtype=np.int32).T
"""Coordinates xi, eta and zeta, each 0 or 1, of the corners (8, 3) of a cell."""


@internal
def add_walls(x, watched, shape, material, table, force, energy):
    """Add the fold barriers of the ``watched`` elements (k,) to corner forces (m, 8, 3) [N] and energies (m,) [J]."""
    corners, slopes = np.empty((8, 3)), np.empty((8, 3))
    for e in watched:
        load_corners(x, shape, e, corners)
        slopes[...] = 0.0
        scale = 0.125 * WEIGHT * shape.volume[e] * table.parameters[material[e], SHEAR]
        pressed = False
        for c in range(8):
            a, b, d = edge_at(corners, c, 0), edge_at(corners, c, 1), edge_at(corners, c, 2)
            over_a, over_b, over_d = cross(b, d), cross(d, a), cross(a, b)
            ratio = shape.corner_ratio[e, c] * dot(a, over_a)
            if not ratio < THRESHOLD:
                continue
            pressed = True
            value, slope = wall(ratio / THRESHOLD)
            energy[e] += scale * value
            slope *= scale * shape.corner_ratio[e, c] / THRESHOLD
            add_edge(slopes, c, 0, slope, over_a)
            add_edge(slopes, c, 1, slope, over_b)
            add_edge(slopes, c, 2, slope, over_d)
        if pressed:
            add_slopes(slopes, shape, e, force)


@inlined
def edge_at(corners, c, axis):
    """Return the edge vector (3,) [m] at corner ``c`` along xi, eta or zeta (``axis`` 0, 1 or 2)."""
    return edge(corner(corners, EDGES[c, axis, 0]), corner(corners, EDGES[c, axis, 1]))


@inlined
def add_edge(slopes, c, axis, share, derivative):
    """Add ``share`` times the derivative with respect to an edge to the derivatives at the edge's two corners."""
    first, last = EDGES[c, axis, 0], EDGES[c, axis, 1]
    for i in range(3):
        slopes[last, i] += share * derivative[i]
        slopes[first, i] -= share * derivative[i]


@inlined
def load_corners(x, shape, e, corners):
    """Write the corners (8, 3) [m] of an element, or of the box that the material of a cut cell fills."""
    for c in range(8):
        for i in range(3):
            if not shape.cut[e]:
                corners[c, i] = x[shape.cells[e, c], i]
            else:
                corners[c, i] = 0.0
                for a in range(8):
                    corners[c, i] += box_weight(shape.box[e], c, a) * x[shape.cells[e, a], i]


@inlined
def add_slopes(slopes, shape, e, force):
    """Add the derivatives ``slopes`` (8, 3) [N] of the energy to the corner forces ``force`` (m, 8, 3) [N] of ``e``.

    The derivatives are with respect to the corners that `load_corners` writes.
    """
    for c in range(8):
        for i in range(3):
            if not shape.cut[e]:
                force[e, c, i] += slopes[c, i]
            else:
                for a in range(8):
                    force[e, a, i] += box_weight(shape.box[e], c, a) * slopes[c, i]


@inlined
def box_weight(box, c, cell_corner):
    """Return the trilinear weight of the corner ``cell_corner`` of a cell at the corner ``c`` of its ``box`` (3, 2)."""
    weight = 1.0
    for axis in range(3):
        place = box[axis, SIDES[c, axis]]
        weight *= place if SIDES[cell_corner, axis] else 1.0 - place
    return weight


@inlined
def room(x, shape, e, corners):
    """Return the distance [m] that vertices may move before a corner can reach the barrier; 0 if nearly folded."""
    load_corners(x, shape, e, corners)
    return element_room(corners, shape.corner_ratio[e])


@inlined
def element_room(corners, ratios):
    """Return the result of `room` [m] for an element's corners (8, 3) [m] and its ``ratios`` r_c (8,) [1/m^3]."""
    room = math.inf
    for c in range(8):
        a, b, d = edge_at(corners, c, 0), edge_at(corners, c, 1), edge_at(corners, c, 2)
        ratio = ratios[c] * dot(a, cross(b, d))
        if not ratio >= NEARLY_FOLDED:
            return 0.0
        first, second, third = math.sqrt(dot(a, a)), math.sqrt(dot(b, b)), math.sqrt(dot(d, d))
        share = 3.0 * ratios[c] * (first * second + second * third + third * first)
        room = min(room, min(min(first, second), min(third, (ratio - THRESHOLD) / share)))
    return 0.5 * room
