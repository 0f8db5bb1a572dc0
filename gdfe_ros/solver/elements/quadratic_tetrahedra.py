# SPDX-License-Identifier: Apache-2.0
"""Compiled response, tangents and measures of quadratic tetrahedra (see `CellKernels`).

They are P2 elements with a split volume term (docs/theory/tetrahedra.md). A material's volume stiffness has two parts:
a local one acts at the four integration points, and the rest acts on the element's mean volume ratio.
`with_local_share` computes both for the table of materials.
"""

from __future__ import annotations

import numpy as np

from gdfe_ros.compiled import inlined, internal, kernel
from gdfe_ros.materials.material import Law
from gdfe_ros.materials.stress import corotated_stress, logarithmic_volume, volumetric
from gdfe_ros.materials.table import LAME, LOCAL, PENALTY, SHEAR
from gdfe_ros.materials.tensor import cofactor, determinant, times
from gdfe_ros.mesh.cells.tetrahedra import POINTS
from gdfe_ros.mesh.triples import combine, corner
from gdfe_ros.solver.elements.blocks import (
    ENERGY,
    GEOMETRY_OF_TET,
    GRADIENT,
    GRADIENTS,
    INVERSE,
    LAME_ROW,
    LANES,
    NODES,
    PENALTY_ROW,
    PRESSURE,
    SHEAR_ROW,
    SLOPE,
    STORED_ENERGY,
    STRESS,
    TET_GEOMETRY_ROWS,
    TET_ROWS,
    TOTAL,
    WEIGHT,
    load3,
    load9,
    load_geometry,
    load_nodes,
    store3,
    store9,
    store_nodes,
)
from gdfe_ros.solver.elements.hexahedra import SPACING
from gdfe_ros.solver.elements.stress_rows import stress_rows

L = tuple(tuple(float(value) for value in point) for point in POINTS)
"""Barycentric coordinates of the integration points, as constants of the kernels."""


@inlined
def load_shares(b, law, elements, material, table):
    """Copy the moduli for the integration points into the rows from which `stress_rows` reads them."""
    for lane in range(LANES):
        k = material[elements[lane]]
        b[PRESSURE * LANES + lane] = 0.0
        b[SHEAR_ROW * LANES + lane] = table.parameters[k, SHEAR]
        b[LAME_ROW * LANES + lane] = table.parameters[k, LOCAL] if law == Law.NEO_HOOKEAN else 0.0
        b[PENALTY_ROW * LANES + lane] = 0.0 if law == Law.NEO_HOOKEAN else table.parameters[k, LOCAL]


@inlined
def point_slopes(place, corners, middles):
    """Return dx/dxi (3) of one coordinate at the point with barycentric coordinates ``place`` (4).

    ``corners`` (4) and ``middles`` (6) are the values of the coordinate at the corner nodes and at the middle nodes.
    """
    l0, l1, l2, l3 = place
    x4, x5, x6, x7, x8, x9 = middles
    g0 = (4.0 * l0 - 1.0) * corners[0] + 4.0 * (l1 * x4 + l2 * x6 + l3 * x7)
    g1 = (4.0 * l1 - 1.0) * corners[1] + 4.0 * (l0 * x4 + l2 * x5 + l3 * x8)
    g2 = (4.0 * l2 - 1.0) * corners[2] + 4.0 * (l0 * x6 + l1 * x5 + l3 * x9)
    g3 = (4.0 * l3 - 1.0) * corners[3] + 4.0 * (l0 * x7 + l1 * x8 + l2 * x9)
    return g1 - g0, g2 - g0, g3 - g0


@inlined
def node(b, a, axis, lane):
    """Return a coordinate of the lane's node ``a``."""
    return b[(NODES + 10 * axis + a) * LANES + lane]


@inlined
def gather_point(b, place, inverse, row):
    """Write F at an integration point to the rows from ``row`` on; ``inverse`` is the first row of dxi/dX there."""
    for lane in range(LANES):
        m = load9(b, inverse, lane)
        for axis in range(3):
            corners = node(b, 0, axis, lane), node(b, 1, axis, lane), node(b, 2, axis, lane), node(b, 3, axis, lane)
            first = node(b, 4, axis, lane), node(b, 5, axis, lane), node(b, 6, axis, lane)
            last = node(b, 7, axis, lane), node(b, 8, axis, lane), node(b, 9, axis, lane)
            d1, d2, d3 = point_slopes(place, corners, first + last)
            store3(b, row + 3 * axis, lane, combine(d1, m[:3], d2, m[3:6], d3, m[6:]))


@inlined
def add(b, row, lane, value):
    """Add ``value`` to the entry of ``row`` and ``lane``."""
    b[row * LANES + lane] += value


@inlined
def scatter_point(b, place, inverse):
    """Add the node forces of one integration point; the rows of the stress must contain the point's weight times P."""
    l0, l1, l2, l3 = place
    for lane in range(LANES):
        m = load9(b, inverse, lane)
        for axis in range(3):
            s, i = load3(b, STRESS + 3 * axis, lane), TOTAL + 10 * axis
            g1, g2, g3 = times(m, s)
            g0 = -(g1 + g2 + g3)
            add(b, i, lane, (4.0 * l0 - 1.0) * g0)
            add(b, i + 1, lane, (4.0 * l1 - 1.0) * g1)
            add(b, i + 2, lane, (4.0 * l2 - 1.0) * g2)
            add(b, i + 3, lane, (4.0 * l3 - 1.0) * g3)
            add(b, i + 4, lane, 4.0 * (l1 * g0 + l0 * g1))
            add(b, i + 5, lane, 4.0 * (l2 * g1 + l1 * g2))
            add(b, i + 6, lane, 4.0 * (l2 * g0 + l0 * g2))
            add(b, i + 7, lane, 4.0 * (l3 * g0 + l0 * g3))
            add(b, i + 8, lane, 4.0 * (l3 * g1 + l1 * g3))
            add(b, i + 9, lane, 4.0 * (l3 * g2 + l2 * g3))


@inlined
def mean_volume_rows(b, elements, material, pressure, table):
    """Write pressure [Pa] and energy [J] of the part of the volume term that acts on the mean volume ratio."""
    for lane in range(LANES):
        b[SLOPE * LANES + lane], b[STORED_ENERGY * LANES + lane] = 0.0, 0.0
    for g in range(4):
        for lane in range(LANES):
            f, w = load9(b, GRADIENTS + 9 * g, lane), b[(GEOMETRY_OF_TET + WEIGHT + g) * LANES + lane]
            add(b, SLOPE, lane, w * determinant(f, cofactor(f)))
            add(b, STORED_ENERGY, lane, w)
    for lane in range(LANES):
        e = elements[lane]
        k, volume = material[e], b[STORED_ENERGY * LANES + lane]
        ratio = b[SLOPE * LANES + lane] / volume
        energy, slope = volumetric(ratio, pressure[e], table.parameters[k, PENALTY])
        if table.parameters[k, LAME] != 0.0:
            more, steeper = logarithmic_volume(ratio, table.parameters[k, LAME])
            energy, slope = energy + more, slope + steeper
        b[SLOPE * LANES + lane], b[STORED_ENERGY * LANES + lane] = slope, volume * energy


@inlined
def add_mean_stress(b, weight):
    """Add the stress of the mean volume's term to P at an integration point; multiply P and energy by the weight."""
    for lane in range(LANES):
        c, w = cofactor(load9(b, GRADIENT, lane)), b[weight * LANES + lane]
        p, s = load9(b, STRESS, lane), b[SLOPE * LANES + lane]
        store9(b, STRESS, lane, corotated_stress(p, c, -s, w, 0.0, c))  # w (P + s cof F)
        add(b, STORED_ENERGY, lane, w * b[ENERGY * LANES + lane])


@inlined
def respond(b, law, elements, material, pressure, table):
    """Write node forces [N] and energy [J] of a block from its rows of node coordinates, geometry and moduli."""
    for g in range(4):
        gather_point(b, L[g], GEOMETRY_OF_TET + INVERSE + 9 * g, GRADIENTS + 9 * g)
    mean_volume_rows(b, elements, material, pressure, table)
    for i in range(30 * LANES):
        b[TOTAL * LANES + i] = 0.0
    for g in range(4):
        for i in range(9 * LANES):
            b[GRADIENT * LANES + i] = b[(GRADIENTS + 9 * g) * LANES + i]
        stress_rows(b, law, elements, material, table)
        add_mean_stress(b, GEOMETRY_OF_TET + WEIGHT + g)
        scatter_point(b, L[g], GEOMETRY_OF_TET + INVERSE + 9 * g)


@inlined
def load_block(b, x, shape, blocks, block, material, table):
    """Write the rows of geometry, node coordinates and moduli of a block at positions ``x`` (n, 3) [m]."""
    load_geometry(b, blocks.geometry, block, GEOMETRY_OF_TET, TET_GEOMETRY_ROWS)
    load_nodes(b, x, shape.cells, blocks.element[block], NODES, 10)
    load_shares(b, blocks.law[block], blocks.element[block], material, table)


@inlined
def place_of(number):
    """Return the offset of the row for component ``number`` = 3 node + axis; rows are sorted by axis, then node."""
    return 10 * (number % 3) + number // 3


@internal
def evaluate_blocks(first, last, x, shape, blocks, material, pressure, scale, table, force, energy):
    """Write node forces (m, 10, 3) [N] and energies (m,) [J] of the blocks from ``first`` up to ``last``.

    ``scale`` is not read, because tetrahedra have no hourglass stiffness.
    """
    b = np.empty(TET_ROWS * LANES)
    for block in range(first, last):
        elements = blocks.element[block]
        load_block(b, x, shape, blocks, block, material, table)
        respond(b, blocks.law[block], elements, material, pressure, table)
        for lane in range(blocks.used[block]):
            energy[elements[lane]] = b[STORED_ENERGY * LANES + lane]
        store_nodes(b, force, elements, blocks.used[block], TOTAL, 10)


@kernel
def element_tangents(x, shape, blocks, material, pressure, scale, table, out):
    """Write d(node force)/d(node position) (m, 30, 30) [N/m] at ``x`` (n, 3) [m], as central differences."""
    b = np.empty(TET_ROWS * LANES)
    for block in range(len(blocks.element)):
        elements = blocks.element[block]
        spacing = SPACING * np.cbrt(shape.volume[elements[0]])
        load_block(b, x, shape, blocks, block, material, table)
        for column in range(30):
            row = (NODES + place_of(column)) * LANES
            for side in range(2):
                step = spacing if side == 0 else -spacing
                for lane in range(LANES):
                    b[row + lane] += step
                respond(b, blocks.law[block], elements, material, pressure, table)
                for lane in range(LANES):
                    b[row + lane] -= step
                for lane in range(blocks.used[block]):
                    e = elements[lane]
                    for i in range(30):
                        part = 0.5 * b[(TOTAL + place_of(i)) * LANES + lane] / step
                        out[e, column, i] = part if side == 0 else out[e, column, i] + part


@inlined
def gradient_row(x, shape, e, g, i):
    """Return row ``i`` of the deformation gradient of element ``e`` at its integration point ``g``."""
    v, m = shape.cells[e], shape.inverse[e, g]
    corners = x[v[0], i], x[v[1], i], x[v[2], i], x[v[3], i]
    middles = x[v[4], i], x[v[5], i], x[v[6], i], x[v[7], i], x[v[8], i], x[v[9], i]
    d1, d2, d3 = point_slopes(L[g], corners, middles)
    return combine(d1, corner(m, 0), d2, corner(m, 1), d3, corner(m, 2))


@inlined
def volume_ratio(x, shape, e):
    """Return the mean volume ratio of element ``e`` over its integration points."""
    total = 0.0
    for g in range(4):
        f = gradient_row(x, shape, e, g, 0) + gradient_row(x, shape, e, g, 1) + gradient_row(x, shape, e, g, 2)
        total += shape.weight[e, g] * determinant(f, cofactor(f))
    return total / shape.volume[e]


@inlined
def load_points(x, shape, e, nodes):
    """Write the nodes (10, 3) [m] of an element."""
    for a in range(10):
        for i in range(3):
            nodes[a, i] = x[shape.cells[e, a], i]


@inlined
def add_slopes(slopes, shape, e, force):
    """Add the derivatives ``slopes`` (10, 3) [N] of an energy to the node forces ``force`` (m, 10, 3) [N] of ``e``."""
    for a in range(10):
        for i in range(3):
            force[e, a, i] += slopes[a, i]
