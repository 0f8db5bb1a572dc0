# SPDX-License-Identifier: Apache-2.0
"""Compiled tangents of single elements: K = G^T H G.

An element's law depends on its corners through 21 numbers z: its mean deformation gradient F (9) and its hourglass
vectors q (4 x 3). G holds the gradients and hourglass vectors that map the corners to z, and H = dr/dz is the
derivative of the element's generalised forces r = (V P, h). The columns dr/dF are central differences of the law, in
the same manner for every law. The columns dh/dq are exact, because h is linear in q; the rest of H is the transpose of
dh/dF.
"""

from __future__ import annotations

import numpy as np
from numpy import uint64

from gdfe_ros.compiled import inlined, kernel, vector_internal
from gdfe_ros.solver.elements.blocks import GRADIENT, LANES, MODES, ROWS, STRESS
from gdfe_ros.solver.elements.corners import gather
from gdfe_ros.solver.elements.hexahedra import hourglass_rows, load_parameters
from gdfe_ros.solver.elements.stress_rows import stress_rows

SPACING = 1e-5
"""Change of an entry of F in a difference, or displacement divided by the cube root of an element's volume. Truncation
and rounding errors are then both about 1e-10.
"""
NUMBERS = 21
"""Length of z and r."""
WIDTH = 24
"""Length of a row of H and of K. The last three numbers of a row of H are zero, so that rows fill whole registers."""
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
    """Write G^T H G (24 x 24) of H (21 x 24) and G (7 x 8) to ``out``; ``half`` (21 x 24) and (24,) is scratch.

    All arrays are flat. Loops count in unsigned numbers, because a possibly negative index costs a test in each
    iteration.
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
