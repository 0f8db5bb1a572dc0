# SPDX-License-Identifier: Apache-2.0
"""Compiled sums over the eight corners: mean deformation gradient, hourglass vectors, corner forces of a block.

On a parallelepiped every operator is a pattern of signs over the corners (VTK order). One fast transform of 24
additions per component then replaces the products with gradients and hourglass vectors; other elements use the
products.
"""

from __future__ import annotations

from gdfe_ros.compiled import inlined
from gdfe_ros.mesh.triples import along, corner
from gdfe_ros.solver.elements.blocks import (
    COORDINATES,
    FORCES,
    GEOMETRY,
    GEOMETRY_ROWS,
    GRADIENT,
    LANES,
    MODES,
    REFERENCE,
    STRESS,
    load3,
    load9,
    load_geometry,
    load_nodes,
    store3,
    store_nodes,
)
from gdfe_ros.solver.elements.hourglass import AMPLITUDE as UNIT


@inlined
def mean_gradient(x, shape, e):
    """Return the volume average F (9,) of the deformation gradient of element ``e`` at positions ``x`` (n, 3) [m]."""
    if shape.cells.shape[1] == 8:
        return gradient_over(x, shape, e, 8)  # a constant, so that the loop is unrolled
    return gradient_over(x, shape, e, shape.cells.shape[1])


@inlined
def gradient_over(x, shape, e, corners):
    """Do `mean_gradient` for elements with this number of ``corners``."""
    p, q, r = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for a in range(corners):
        (x0, x1, x2), g = corner(x, shape.cells[e, a]), corner(shape.gradient[e], a)
        p, q, r = along(1.0, p, x0, g), along(1.0, q, x1, g), along(1.0, r, x2, g)
    return p + q + r


@inlined
def patterns(b, row, lane):
    """Return signed sums of a coordinate over the corners, with seven sign patterns: xi, eta, zeta, and four modes."""
    i = row * LANES + lane
    x0, x1, x2, x3 = b[i], b[i + LANES], b[i + 2 * LANES], b[i + 3 * LANES]
    x4, x5, x6, x7 = b[i + 4 * LANES], b[i + 5 * LANES], b[i + 6 * LANES], b[i + 7 * LANES]
    s01, d01, s32, d32 = x1 + x0, x1 - x0, x2 + x3, x2 - x3
    s45, d45, s76, d76 = x5 + x4, x5 - x4, x6 + x7, x6 - x7
    low, high = s32 - s01, s76 - s45
    low_x, high_x = d01 + d32, d45 + d76
    low_xy, high_xy = d32 - d01, d76 - d45
    return (
        low_x + high_x,
        low + high,
        (s45 + s76) - (s01 + s32),
        high - low,
        high_x - low_x,
        low_xy + high_xy,
        high_xy - low_xy,
    )


@inlined
def spread(b, row, lane, c0, c1, c2, c3, c4, c5, c6):
    """Write the sum of the seven sign patterns with coefficients ``c0`` .. ``c6`` to eight rows."""
    i = row * LANES + lane
    low_x, high_x = c0 - c4, c0 + c4
    low_y, high_y = c1 - c3, c1 + c3
    low_xy, high_xy = c5 - c6, c5 + c6
    a, d = low_x + low_xy, low_x - low_xy
    g, h = high_x + high_xy, high_x - high_xy
    b[i], b[i + LANES] = -d - low_y - c2, d - low_y - c2
    b[i + 2 * LANES], b[i + 3 * LANES] = a + low_y - c2, -a + low_y - c2
    b[i + 4 * LANES], b[i + 5 * LANES] = -h - high_y + c2, h - high_y + c2
    b[i + 6 * LANES], b[i + 7 * LANES] = g + high_y + c2, -g + high_y + c2


@inlined
def gather_parallel(b):
    """Write mean deformation gradients F and hourglass vectors q of a block of parallelepipeds from its corners."""
    for lane in range(LANES):
        i = load9(b, GEOMETRY + REFERENCE, lane)
        for axis in range(3):
            p = patterns(b, COORDINATES + 8 * axis, lane)
            f0 = 0.125 * (p[0] * i[0] + p[1] * i[3] + p[2] * i[6])
            f1 = 0.125 * (p[0] * i[1] + p[1] * i[4] + p[2] * i[7])
            f2 = 0.125 * (p[0] * i[2] + p[1] * i[5] + p[2] * i[8])
            store3(b, GRADIENT + 3 * axis, lane, (f0, f1, f2))
            for mode in range(4):
                b[(MODES + 3 * mode + axis) * LANES + lane] = UNIT * p[3 + mode]


@inlined
def scatter_parallel(b):
    """Write the corner forces of a block of parallelepipeds from volume times stress V P and the hourglass forces."""
    for lane in range(LANES):
        i = load9(b, GEOMETRY + REFERENCE, lane)
        for axis in range(3):
            s = load3(b, STRESS + 3 * axis, lane)
            h0, h1 = b[(FORCES + axis) * LANES + lane], b[(FORCES + 3 + axis) * LANES + lane]
            h2, h3 = b[(FORCES + 6 + axis) * LANES + lane], b[(FORCES + 9 + axis) * LANES + lane]
            c0 = 0.125 * (s[0] * i[0] + s[1] * i[1] + s[2] * i[2])
            c1 = 0.125 * (s[0] * i[3] + s[1] * i[4] + s[2] * i[5])
            c2 = 0.125 * (s[0] * i[6] + s[1] * i[7] + s[2] * i[8])
            spread(b, COORDINATES + 8 * axis, lane, c0, c1, c2, UNIT * h0, UNIT * h1, UNIT * h2, UNIT * h3)


@inlined
def gather_general(b, shape, elements):
    """Write mean deformation gradients F and hourglass vectors q of a block of general hexahedra from its corners."""
    for lane in range(LANES):
        e = elements[lane]
        for axis in range(3):
            f0, f1, f2, q0, q1, q2, q3 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            for a in range(8):
                x = b[(COORDINATES + 8 * axis + a) * LANES + lane]
                f0 += x * shape.gradient[e, a, 0]
                f1 += x * shape.gradient[e, a, 1]
                f2 += x * shape.gradient[e, a, 2]
                q0 += x * shape.hourglass[e, 0, a]
                q1 += x * shape.hourglass[e, 1, a]
                q2 += x * shape.hourglass[e, 2, a]
                q3 += x * shape.hourglass[e, 3, a]
            store3(b, GRADIENT + 3 * axis, lane, (f0, f1, f2))
            b[(MODES + axis) * LANES + lane], b[(MODES + 3 + axis) * LANES + lane] = q0, q1
            b[(MODES + 6 + axis) * LANES + lane], b[(MODES + 9 + axis) * LANES + lane] = q2, q3


@inlined
def scatter_general(b, shape, elements):
    """Write the corner forces of a block of general hexahedra from volume times stress V P and the hourglass forces."""
    for lane in range(LANES):
        e = elements[lane]
        for axis in range(3):
            s = load3(b, STRESS + 3 * axis, lane)
            h0, h1 = b[(FORCES + axis) * LANES + lane], b[(FORCES + 3 + axis) * LANES + lane]
            h2, h3 = b[(FORCES + 6 + axis) * LANES + lane], b[(FORCES + 9 + axis) * LANES + lane]
            for a in range(8):
                b[(COORDINATES + 8 * axis + a) * LANES + lane] = (
                    s[0] * shape.gradient[e, a, 0]
                    + s[1] * shape.gradient[e, a, 1]
                    + s[2] * shape.gradient[e, a, 2]
                    + h0 * shape.hourglass[e, 0, a]
                    + h1 * shape.hourglass[e, 1, a]
                    + h2 * shape.hourglass[e, 2, a]
                    + h3 * shape.hourglass[e, 3, a]
                )


@inlined
def gather(b, x, shape, blocks, block):
    """Write the rows of F (9), hourglass vectors q (4 x 3) [m] and geometry of a block at positions ``x`` (n, 3)."""
    load_geometry(b, blocks.geometry, block, GEOMETRY, GEOMETRY_ROWS)
    load_nodes(b, x, shape.cells, blocks.element[block], COORDINATES, 8)
    if blocks.parallel[block]:
        gather_parallel(b)
    else:
        gather_general(b, shape, blocks.element[block])


@inlined
def scatter(b, force, shape, blocks, block):
    """Write the corner forces of a block from its rows of V P (9) [N m] and hourglass forces (4 x 3) [N]."""
    if blocks.parallel[block]:
        scatter_parallel(b)
    else:
        scatter_general(b, shape, blocks.element[block])
    store_nodes(b, force, blocks.element[block], blocks.used[block], COORDINATES, 8)
