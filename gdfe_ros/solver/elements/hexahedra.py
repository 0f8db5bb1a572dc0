# SPDX-License-Identifier: Apache-2.0
"""Compiled response, tangents and measures of hexahedra (see `CellKernels`).

A tangent is K = G^T H G. An element's law depends on its corners through 21 numbers z: its mean deformation gradient F
(9) and its hourglass vectors q (4 x 3). G holds the gradients and hourglass vectors that map the corners to z, and
H = dr/dz is the derivative of the element's generalised forces r = (V P, h). The columns dr/dF are central differences
of the law, in the same manner for every law. The columns dh/dq are exact, because h is linear in q; the rest of H is
the transpose of dh/dF.
"""

from __future__ import annotations

import numpy as np
from numpy import uint64

from gdfe_ros.compiled import inlined, internal, kernel, vector_internal
from gdfe_ros.materials.stress import corotated_stress
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
    """Write a block's hourglass forces [N]. Replace its stress P by V P [N m], its energy density by the energy [J].

    Both then include the hourglass part.
    """
    for lane in range(LANES):
        volume = b[(GEOMETRY + VOLUME) * LANES + lane]
        q = load3(b, MODES, lane), load3(b, MODES + 3, lane), load3(b, MODES + 6, lane), load3(b, MODES + 9, lane)
        f, axes, rates = load9(b, GRADIENT, lane), load9(b, GEOMETRY + AXES, lane), load3(b, GEOMETRY + EDGES, lane)
        coupling, (young, shear, poisson) = b[(GEOMETRY + COUPLING) * LANES + lane], load3(b, YOUNG_ROW, lane)
        energy, h, s = hourglass(f, q, axes, rates, coupling, volume * young, volume * shear, poisson)
        p = load9(b, STRESS, lane)
        store9(b, STRESS, lane, corotated_stress(p, p, 0.0, volume, 1.0, s))
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


SPACING = 1e-5
"""Change of an entry of F in a difference, or displacement divided by the cube root of an element's volume. Truncation
and rounding errors are then both about 1e-10.
"""
NUMBERS, WIDTH = 21, 24
"""Length of z and r; length of a row of H and of a row of K. The last three numbers of a row of H are zero, so that the
rows fill whole registers.
"""
SAVED = ROWS
"""Row with the unchanged value of the entry of F that is varied."""


@inlined
def differences(b, law, elements, material, table, reduced):
    """Add the columns dr/dF of a block to ``reduced`` (LANES, 21, 24)."""
    for column in range(9):
        row = (GRADIENT + column) * LANES
        for lane in range(LANES):
            b[SAVED * LANES + lane] = b[row + lane]
        for side in range(2):
            for lane in range(LANES):
                b[row + lane] = b[SAVED * LANES + lane] + (SPACING if side == 0 else -SPACING)
            stress_rows(b, law, elements, material, table)
            hourglass_rows(b)
            share = 0.5 / SPACING if side == 0 else -0.5 / SPACING
            for i in range(NUMBERS):
                for lane in range(LANES):
                    reduced[lane, column, i] += share * b[(STRESS + i) * LANES + lane]
        for lane in range(LANES):
            b[row + lane] = b[SAVED * LANES + lane]


@inlined
def hourglass_columns(b, reduced):
    """Write the columns dr/dq of a block to ``reduced`` (LANES, 21, 24); the block's rows of q are overwritten."""
    for i in range(12 * LANES):
        b[MODES * LANES + i] = 0.0
    for column in range(12):
        for lane in range(LANES):
            b[(MODES + column) * LANES + lane] = 1.0
        hourglass_rows(b)
        for lane in range(LANES):
            b[(MODES + column) * LANES + lane] = 0.0
            for i in range(12):
                reduced[lane, 9 + column, 9 + i] = b[(STRESS + 9 + i) * LANES + lane]
            for i in range(9):
                reduced[lane, 9 + column, i] = reduced[lane, i, 9 + column]


@vector_internal
def congruence(reduced, operator, half, out):
    """Write G^T H G (24 x 24) of H (21 x 24) and G (7 x 8) to ``out``; ``half`` is scratch.

    ``half`` has 21 x 24 + 24 numbers. All arrays are flat. Loops count in unsigned numbers, because a possibly negative
    index costs a test in each iteration.
    """
    row = half[NUMBERS * WIDTH :]
    for turn in range(2):
        for a in range(8):
            w0, w1, w2 = operator[a], operator[8 + a], operator[16 + a]
            w3, w4, w5, w6 = operator[24 + a], operator[32 + a], operator[40 + a], operator[48 + a]
            for axis in range(3):
                given = reduced if turn == 0 else half
                z0, z1, z2 = given[WIDTH * 3 * axis :], given[WIDTH * (3 * axis + 1) :], given[WIDTH * (3 * axis + 2) :]
                q0, q1 = given[WIDTH * (9 + axis) :], given[WIDTH * (12 + axis) :]
                q2, q3 = given[WIDTH * (15 + axis) :], given[WIDTH * (18 + axis) :]
                found = row if turn == 0 else out[WIDTH * (3 * a + axis) :]
                for j in range(uint64(WIDTH)):
                    total = w0 * z0[j] + w1 * z1[j] + w2 * z2[j]
                    found[j] = total + w3 * q0[j] + w4 * q1[j] + w5 * q2[j] + w6 * q3[j]
                if turn == 0:
                    for i in range(NUMBERS):
                        half[WIDTH * i + 3 * a + axis] = row[i]


@kernel
def element_tangents(x, shape, blocks, material, pressure, scale, table, out):
    """Write d(corner force)/d(corner position) (m, 24, 24) [N/m] of the elements of ``blocks`` at ``x`` (n, 3) [m].

    The other arguments are those of `evaluate`.
    """
    b, operator = np.empty((SAVED + 1) * LANES), np.empty(7 * 8)
    reduced, half = np.empty((LANES, NUMBERS, WIDTH)), np.empty((NUMBERS + 1) * WIDTH)
    for block in range(len(blocks.element)):
        elements = blocks.element[block]
        gather(b, x, shape, blocks, block)
        load_parameters(b, elements, material, pressure, scale, table)
        reduced[...] = 0.0
        differences(b, blocks.law[block], elements, material, table, reduced)
        hourglass_columns(b, reduced)
        for lane in range(blocks.used[block]):
            e = elements[lane]
            for a in range(8):
                for m in range(3):
                    operator[8 * m + a] = shape.gradient[e, a, m]
                for k in range(4):
                    operator[24 + 8 * k + a] = shape.hourglass[e, k, a]
            congruence(reduced[lane].ravel(), operator, half, out[e].ravel())
