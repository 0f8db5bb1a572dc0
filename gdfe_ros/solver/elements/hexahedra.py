# SPDX-License-Identifier: Apache-2.0
"""Compiled measures of hexahedra: mean gradient, volume ratio, least corner (see `cell_kernels`)."""

from __future__ import annotations

import math

from gdfe_ros.compiled import inlined, internal
from gdfe_ros.materials.tensor import cofactor, determinant
from gdfe_ros.mesh.triples import cross, dot


@inlined
def mean_gradient(x, shape, e):
    """Return the mean deformation gradient (9,) of element ``e`` at positions ``x`` (n, 3) [m]."""
    f0, f1, f2, f3, f4, f5, f6, f7, f8 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for a in range(8):
        v = shape.cells[e, a]
        x0, x1, x2 = x[v, 0], x[v, 1], x[v, 2]
        g0, g1, g2 = shape.gradient[e, a, 0], shape.gradient[e, a, 1], shape.gradient[e, a, 2]
        f0 += x0 * g0
        f1 += x0 * g1
        f2 += x0 * g2
        f3 += x1 * g0
        f4 += x1 * g1
        f5 += x1 * g2
        f6 += x2 * g0
        f7 += x2 * g1
        f8 += x2 * g2
    return f0, f1, f2, f3, f4, f5, f6, f7, f8


@inlined
def corner(x, v):
    """Return the position (3,) [m] of vertex ``v``."""
    return x[v, 0], x[v, 1], x[v, 2]


@inlined
def edge(a, b):
    """Return the vector b - a."""
    return b[0] - a[0], b[1] - a[1], b[2] - a[2]


@inlined
def between(a, b, share):
    """Return the point at the fraction ``share`` from a to b."""
    return a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]), a[2] + share * (b[2] - a[2])


@inlined
def part(a, b, sides):
    """Return the two points at the fractions ``sides`` from a to b."""
    return between(a, b, sides[0]), between(a, b, sides[1])


@inlined
def box_corners(x0, x1, x2, x3, x4, x5, x6, x7, box):
    """Return the corners of the box (3, 2) of a cut cell from the cell's corners, by trilinear weights."""
    x0, x1 = part(x0, x1, box[0])
    x3, x2 = part(x3, x2, box[0])
    x4, x5 = part(x4, x5, box[0])
    x7, x6 = part(x7, x6, box[0])
    x0, x3 = part(x0, x3, box[1])
    x1, x2 = part(x1, x2, box[1])
    x4, x7 = part(x4, x7, box[1])
    x5, x6 = part(x5, x6, box[1])
    x0, x4 = part(x0, x4, box[2])
    x1, x5 = part(x1, x5, box[2])
    x2, x6 = part(x2, x6, box[2])
    x3, x7 = part(x3, x7, box[2])
    return x0, x1, x2, x3, x4, x5, x6, x7


@inlined
def corners_of(x, cell):
    """Return the eight positions (3,) [m] of the vertices ``cell`` (8,)."""
    x0, x1, x2, x3 = corner(x, cell[0]), corner(x, cell[1]), corner(x, cell[2]), corner(x, cell[3])
    return x0, x1, x2, x3, corner(x, cell[4]), corner(x, cell[5]), corner(x, cell[6]), corner(x, cell[7])


@inlined
def least_ratio(x0, x1, x2, x3, x4, x5, x6, x7, r):
    """Return the least of the volume ratios at corners ``x0`` .. ``x7`` with ``r`` (8,) [1/m^3]; NaN if one is NaN."""
    a01, a32, a45, a76 = edge(x0, x1), edge(x3, x2), edge(x4, x5), edge(x7, x6)
    b03, b12, b47, b56 = edge(x0, x3), edge(x1, x2), edge(x4, x7), edge(x5, x6)
    c04, c15, c26, c37 = edge(x0, x4), edge(x1, x5), edge(x2, x6), edge(x3, x7)
    d0, d1 = r[0] * dot(a01, cross(b03, c04)), r[1] * dot(a01, cross(b12, c15))
    d2, d3 = r[2] * dot(a32, cross(b12, c26)), r[3] * dot(a32, cross(b03, c37))
    d4, d5 = r[4] * dot(a45, cross(b47, c04)), r[5] * dot(a45, cross(b56, c15))
    d6, d7 = r[6] * dot(a76, cross(b56, c26)), r[7] * dot(a76, cross(b47, c37))
    total = d0 + d1 + d2 + d3 + d4 + d5 + d6 + d7
    if not math.isfinite(total):
        return math.nan
    return min(min(min(d0, d1), min(d2, d3)), min(min(d4, d5), min(d6, d7)))


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
            x0, x1, x2, x3, x4, x5, x6, x7 = corners_of(x, shape.cells[e])
            out[e] = least_ratio(x0, x1, x2, x3, x4, x5, x6, x7, shape.corner_ratio[e])
    for e in elements:
        if shape.cut[e]:
            x0, x1, x2, x3, x4, x5, x6, x7 = corners_of(x, shape.cells[e])
            x0, x1, x2, x3, x4, x5, x6, x7 = box_corners(x0, x1, x2, x3, x4, x5, x6, x7, shape.box[e])
            out[e] = least_ratio(x0, x1, x2, x3, x4, x5, x6, x7, shape.corner_ratio[e])


@inlined
def volume_ratio(x, shape, e):
    """Return the determinant of the mean deformation gradient of element ``e``."""
    f = mean_gradient(x, shape, e)
    return determinant(f, cofactor(f))
