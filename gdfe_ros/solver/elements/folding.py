# SPDX-License-Identifier: Apache-2.0
"""Compiled fold barrier: an energy of each corner's volume ratio that keeps corners of elements from folding.

An element's energies are those of its mean deformation gradient and its hourglass vectors. Both stay finite when a
corner has no volume left, so that a blow or a press may fold the corner. The barrier adds, for each corner c of each
element,

    E_c = w mu V/8 b(s),   s = J_c / J_0,   b(s) = (1 - s)^3 / s for s < 1, else 0            [J]

with the corner's volume ratio J_c, the element's shear modulus mu [Pa] and volume V [m^3]. Its properties are:

1. J_c = r_c a . (b x c) is trilinear in the corner's three edges a, b, c [m]; r_c [1/m^3] is one over the triple
product at rest. So dJ_c/da = r_c b x c, and cyclically.
2. b, b' and b'' are zero at s = 1. The energy stays twice differentiable, and nothing changes above the threshold.
3. b' = -(1 - s)^2 (1 + 2 s) / s^2 pushes the corner open without bound as s goes to 0.
4. Below s_0 the energy continues as its tangent at s_0, so that it is finite everywhere: a line search that steps
too far sees by how much, and a body that is placed folded is pushed open. (A parabola would push so hard that the
first step of such a body runs away.)

The corners of a cut cell are those of the box that its material fills. Barriers are evaluated only for elements near
folding, see `watch`; other bodies pay nothing for them.
"""

from __future__ import annotations

import numpy as np

from gdfe_ros.compiled import inlined, internal
from gdfe_ros.materials.table import SHEAR
from gdfe_ros.materials.tensor import cross, dot
from gdfe_ros.solver.elements.measures import corner, edge

THRESHOLD = 0.2
"""J_0. With 0.3 the barrier would act in sound scenes: least corners are 0.256 in tensile_curve and 0.241 in
two_material_bar."""
WEIGHT = 3.0
"""w. The height after a bounce changes by at most 1.2 % for w from 1 to 10 and J_0 from 0.1 to 0.4."""
LINE = 0.1
"""s_0."""
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
"""Side of the cell, 0 or 1, on which each corner (8, 3) lies along xi, eta and zeta."""
NONE = np.zeros(0, dtype=np.int32)
"""No watched elements."""


@inlined
def wall(s):
    """Return b(s) and b'(s) for s < 1, with the straight line below `LINE`."""
    t = max(s, LINE)
    rest = 1.0 - t
    value, slope = rest * rest * rest / t, -rest * rest * (1.0 + 2.0 * t) / (t * t)
    value += slope * (s - t)
    return value, slope


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
    """Return the edge [m] of a corner along an axis."""
    return edge(corner(corners, EDGES[c, axis, 0]), corner(corners, EDGES[c, axis, 1]))


@inlined
def add_edge(slopes, c, axis, share, derivative):
    """Add ``share`` times the derivative by an edge of a corner to the derivatives by the edge's ends."""
    first, last = EDGES[c, axis, 0], EDGES[c, axis, 1]
    for i in range(3):
        slopes[last, i] += share * derivative[i]
        slopes[first, i] -= share * derivative[i]


@inlined
def load_corners(x, shape, e, corners):
    """Write the corners (8, 3) [m] of an element, or of the box that fills a cut cell."""
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
    """Add the derivatives (8, 3) [N] by the corners of `load_corners` to the corner forces (m, 8, 3) of an element."""
    for c in range(8):
        for i in range(3):
            if not shape.cut[e]:
                force[e, c, i] += slopes[c, i]
            else:
                for a in range(8):
                    force[e, a, i] += box_weight(shape.box[e], c, a) * slopes[c, i]


@inlined
def box_weight(box, c, cell_corner):
    """Return the trilinear weight of a corner of the cell at a corner of its box (3, 2)."""
    weight = 1.0
    for axis in range(3):
        place = box[axis, SIDES[c, axis]]
        weight *= place if SIDES[cell_corner, axis] else 1.0 - place
    return weight
