# SPDX-License-Identifier: Apache-2.0
"""Compiled functions of quadratic tetrahedra: response, tangents and measures (see `CellKernels`)."""

from __future__ import annotations

import numpy as np

from gdfe_ros.compiled import inlined, internal, kernel
from gdfe_ros.materials.tensor import cofactor, determinant
from gdfe_ros.mesh.triples import combine, corner
from gdfe_ros.solver.elements.blocks import (
    GEOMETRY_OF_TET,
    LANES,
    NODES,
    STORED_ENERGY,
    TET_GEOMETRY_ROWS,
    TET_ROWS,
    TOTAL,
    load_geometry,
    load_nodes,
    store_nodes,
)
from gdfe_ros.solver.elements.tangent_rows import SPACING
from gdfe_ros.solver.elements.tet_rows import L, load_shares, point_slopes, respond


@inlined
def load_block(b, x, shape, blocks, block, material, table):
    """Write the rows of geometry, node coordinates and moduli of a block at positions ``x`` (n, 3) [m]."""
    load_geometry(b, blocks.geometry, block, GEOMETRY_OF_TET, TET_GEOMETRY_ROWS)
    load_nodes(b, x, shape.cells, blocks.element[block], NODES, 10)
    load_shares(b, blocks.law[block], blocks.element[block], material, table)


@inlined
def place_of(number):
    """Return the row, after the first, of a component of a node: 3 node + axis."""
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
