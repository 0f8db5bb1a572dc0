# SPDX-License-Identifier: Apache-2.0
"""Compiled response, measures and fold barrier of hexahedra (see `cell_kernels`, and `barrier` for the barrier)."""

from __future__ import annotations

import math

import numpy as np

from gdfe_ros.compiled import inlined, internal
from gdfe_ros.materials.stress import corotated
from gdfe_ros.materials.table import LAME, PENALTY, POISSON, SHEAR, YOUNG
from gdfe_ros.materials.tensor import cofactor, determinant
from gdfe_ros.mesh.triples import corner, cross, dot, minus
from gdfe_ros.solver.elements.barrier import NEARLY_FOLDED, THRESHOLD, WEIGHT, corner_room, wall
from gdfe_ros.solver.elements.blocks import (
    AXES,
    COUPLING,
    EDGES,
    ENERGY,
    FORCES,
    GEOMETRY,
    GRADIENT,
    LAME_ROW,
    LANES,
    MODES,
    PENALTY_ROW,
    POISSON_ROW,
    PRESSURE,
    ROWS,
    SCALED_SHEAR,
    SHEAR_ROW,
    STRESS,
    VOLUME,
    YOUNG_ROW,
    load3,
    load9,
    store3,
    store9,
)
from gdfe_ros.solver.elements.corners import gather, gradient_over, scatter
from gdfe_ros.solver.elements.hourglass import hourglass
from gdfe_ros.solver.elements.stress_rows import stress_rows

CORNER_EDGES = np.array(
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


@inlined
def mean_gradient(x, shape, e):
    """Return the mean deformation gradient (9,) of element ``e`` at positions ``x`` (n, 3) [m]."""
    return gradient_over(x, shape, e, 8)


@inlined
def volume_ratio(x, shape, e):
    """Return the determinant of the mean deformation gradient of element ``e``."""
    f = mean_gradient(x, shape, e)
    return determinant(f, cofactor(f))


@internal
def least_corners(x, shape, elements, out):
    """Write the least volume ratio det F over the corners of each of ``elements`` (k,) to ``out`` (m,).

    The value is NaN if one of the ratios is NaN. The mean gradient does not show a folded corner, because hourglass
    patterns do not contribute to it. The corners of a cut cell are the corners of the box that its material fills; the
    empty part of the cell may fold. Cut cells have a loop of their own: numba would count references to all arrays of
    ``shape`` in each pass of a loop with both cases, which takes ten times as long.
    """
    for e in elements:
        if not shape.cut[e]:
            out[e] = least_ratio(x, shape.cells[e], shape.corner_ratio[e])
    corners, own = np.empty((8, 3)), np.arange(8)
    for e in elements:
        if shape.cut[e]:
            load_corners(x, shape, e, corners)
            out[e] = least_ratio(corners, own, shape.corner_ratio[e])


@inlined
def least_ratio(x, cell, r):
    """Return the least of the volume ratios at the vertices ``cell`` (8,) with ``r`` (8,) [1/m^3]; NaN if one is NaN.

    The sums are written out: a loop over `CORNER_EDGES` takes twice as long.
    """
    x0, x1, x2, x3 = corner(x, cell[0]), corner(x, cell[1]), corner(x, cell[2]), corner(x, cell[3])
    x4, x5, x6, x7 = corner(x, cell[4]), corner(x, cell[5]), corner(x, cell[6]), corner(x, cell[7])
    a01, a32, a45, a76 = minus(x1, x0), minus(x2, x3), minus(x5, x4), minus(x6, x7)
    b03, b12, b47, b56 = minus(x3, x0), minus(x2, x1), minus(x7, x4), minus(x6, x5)
    c04, c15, c26, c37 = minus(x4, x0), minus(x5, x1), minus(x6, x2), minus(x7, x3)
    d0, d1 = r[0] * dot(a01, cross(b03, c04)), r[1] * dot(a01, cross(b12, c15))
    d2, d3 = r[2] * dot(a32, cross(b12, c26)), r[3] * dot(a32, cross(b03, c37))
    d4, d5 = r[4] * dot(a45, cross(b47, c04)), r[5] * dot(a45, cross(b56, c15))
    d6, d7 = r[6] * dot(a76, cross(b56, c26)), r[7] * dot(a76, cross(b47, c37))
    total = d0 + d1 + d2 + d3 + d4 + d5 + d6 + d7
    if not math.isfinite(total):
        return math.nan
    return min(min(min(d0, d1), min(d2, d3)), min(min(d4, d5), min(d6, d7)))


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
    return minus(corner(corners, CORNER_EDGES[c, axis, 1]), corner(corners, CORNER_EDGES[c, axis, 0]))


@inlined
def add_edge(slopes, c, axis, share, derivative):
    """Add ``share`` times the derivative with respect to an edge to the derivatives at the edge's two corners."""
    first, last = CORNER_EDGES[c, axis, 0], CORNER_EDGES[c, axis, 1]
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
    found = math.inf
    for c in range(8):
        a, b, d = edge_at(corners, c, 0), edge_at(corners, c, 1), edge_at(corners, c, 2)
        ratio = shape.corner_ratio[e, c] * dot(a, cross(b, d))
        if not ratio >= NEARLY_FOLDED:
            return 0.0
        found = min(found, corner_room(a, b, d, ratio, shape.corner_ratio[e, c]))
    return 0.5 * found


@inlined
def load_parameters(b, elements, material, pressure, scale, table):
    """Copy the parameters of the lanes' materials into their rows."""
    for lane in range(LANES):
        e = elements[lane]
        k = material[e]
        b[PRESSURE * LANES + lane] = pressure[e]
        b[SHEAR_ROW * LANES + lane] = table.parameters[k, SHEAR]
        b[LAME_ROW * LANES + lane] = table.parameters[k, LAME]
        b[PENALTY_ROW * LANES + lane] = table.parameters[k, PENALTY]
        b[YOUNG_ROW * LANES + lane] = scale[e] * table.parameters[k, YOUNG]
        b[SCALED_SHEAR * LANES + lane] = scale[e] * table.parameters[k, SHEAR]
        b[POISSON_ROW * LANES + lane] = table.parameters[k, POISSON]


@inlined
def hourglass_rows(b):
    """Write a block's hourglass forces [N]. Turn its rows of stress P and energy density into V P [N m] and energy [J].

    Both include the hourglass part.
    """
    for lane in range(LANES):
        volume = b[(GEOMETRY + VOLUME) * LANES + lane]
        q = (
            load3(b, MODES, lane),
            load3(b, MODES + 3, lane),
            load3(b, MODES + 6, lane),
            load3(b, MODES + 9, lane),
        )
        energy, h, s = hourglass(
            load9(b, GRADIENT, lane),
            q,
            load9(b, GEOMETRY + AXES, lane),
            load3(b, GEOMETRY + EDGES, lane),
            b[(GEOMETRY + COUPLING) * LANES + lane],
            volume * b[YOUNG_ROW * LANES + lane],
            volume * b[SCALED_SHEAR * LANES + lane],
            b[POISSON_ROW * LANES + lane],
        )
        p = load9(b, STRESS, lane)
        store9(b, STRESS, lane, corotated(p, p, 0.0, volume, 1.0, s))
        for mode in range(4):
            store3(b, FORCES + 3 * mode, lane, h[mode])
        b[ENERGY * LANES + lane] = volume * b[ENERGY * LANES + lane] + energy


@internal
def evaluate_blocks(first, last, x, shape, blocks, material, pressure, scale, table, force, energy):
    """Write corner forces (m, 8, 3) [N] and energies (m,) [J] of the blocks from ``first`` up to ``last``."""
    b = np.empty(ROWS * LANES)
    for block in range(first, last):
        elements = blocks.element[block]
        gather(b, x, shape, blocks, block)
        load_parameters(b, elements, material, pressure, scale, table)
        stress_rows(b, blocks.law[block], elements, material, table)
        hourglass_rows(b)
        scatter(b, force, shape, blocks, block)
        for lane in range(blocks.used[block]):
            energy[elements[lane]] = b[ENERGY * LANES + lane]
