# SPDX-License-Identifier: Apache-2.0
"""Compiled response and measures of hexahedra (see `CellKernels`)."""

from __future__ import annotations

import numpy as np

from gdfe_ros.compiled import inlined, internal
from gdfe_ros.materials.stress import corotated
from gdfe_ros.materials.table import LAME, PENALTY, POISSON, SHEAR, YOUNG
from gdfe_ros.materials.tensor import cofactor, determinant
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
from gdfe_ros.solver.elements.corners import gather, mean_gradient, scatter
from gdfe_ros.solver.elements.hourglass import hourglass
from gdfe_ros.solver.elements.stress_rows import stress_rows

SIDES = np.array([[0, 1, 1, 0, 0, 1, 1, 0], [0, 0, 1, 1, 0, 0, 1, 1], [0, 0, 0, 0, 1, 1, 1, 1]], dtype=np.int32).T
"""Coordinates xi, eta and zeta, each 0 or 1, of the corners (8, 3) of a cell."""


@inlined
def volume_ratio(x, shape, e):
    """Return the determinant of the mean deformation gradient of element ``e``."""
    f = mean_gradient(x, shape, e)
    return determinant(f, cofactor(f))


@inlined
def load_points(x, shape, e, corners):
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

    The derivatives are with respect to the corners that `load_points` writes.
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
        q = load3(b, MODES, lane), load3(b, MODES + 3, lane), load3(b, MODES + 6, lane), load3(b, MODES + 9, lane)
        f, axes, rates = load9(b, GRADIENT, lane), load9(b, GEOMETRY + AXES, lane), load3(b, GEOMETRY + EDGES, lane)
        coupling, (young, shear, poisson) = b[(GEOMETRY + COUPLING) * LANES + lane], load3(b, YOUNG_ROW, lane)
        energy, h, s = hourglass(f, q, axes, rates, coupling, volume * young, volume * shear, poisson)
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
