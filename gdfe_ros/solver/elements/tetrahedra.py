# SPDX-License-Identifier: Apache-2.0
"""Compiled functions of quadratic tetrahedra: response, tangents, measures and fold barrier (see `cell_kernels`)."""

from __future__ import annotations

import math

import numpy as np

from gdfe_ros.compiled import inlined, internal, kernel
from gdfe_ros.materials.table import SHEAR
from gdfe_ros.materials.tensor import cofactor, determinant
from gdfe_ros.mesh.triples import combine, corner, cross, dot
from gdfe_ros.solver.elements.barrier import NEARLY_FOLDED, THRESHOLD, WEIGHT, corner_room, wall
from gdfe_ros.solver.elements.blocks import LANES, NODES, STORED_ENERGY, TET_ROWS, TOTAL
from gdfe_ros.solver.elements.corners import gradient_over
from gdfe_ros.solver.elements.tangent_rows import SPACING
from gdfe_ros.solver.elements.tet_rows import L, load_geometry, load_nodes, load_shares, point_slopes, respond

CORNER_NODES = np.array(
    [[0, 4, 6, 7], [1, 4, 5, 8], [2, 6, 5, 9], [3, 7, 8, 9]],
    dtype=np.int32,
)
"""Each corner, and the mid-edge nodes of the three edges that meet there (4, 4)."""
OTHERS = np.array([[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]], dtype=np.int32)
"""The other corners (4, 3) of the edges in `CORNER_NODES`."""
ORDER = np.array([1.0, -1.0, 1.0, -1.0])
"""Sign of the triple product of the edges in the order of `CORNER_NODES`."""


@internal
def evaluate_blocks(first, last, x, shape, blocks, material, pressure, scale, table, force, energy):
    """Write node forces (m, 10, 3) [N] and energies (m,) [J] of the blocks from ``first`` up to ``last``.

    ``scale`` is not read, because tetrahedra have no hourglass stiffness.
    """
    b = np.empty(TET_ROWS * LANES)
    for block in range(first, last):
        elements = blocks.element[block]
        load_geometry(b, blocks, block)
        load_nodes(b, x, shape, elements)
        load_shares(b, blocks.law[block], elements, material, table)
        respond(b, blocks.law[block], elements, material, pressure, table)
        for lane in range(blocks.used[block]):
            e = elements[lane]
            energy[e] = b[STORED_ENERGY * LANES + lane]
            for a in range(10):
                for axis in range(3):
                    force[e, a, axis] = b[(TOTAL + 3 * a + axis) * LANES + lane]


@kernel
def element_tangents(x, shape, blocks, material, pressure, scale, table, out):
    """Write d(node force)/d(node position) (m, 30, 30) [N/m] at ``x`` (n, 3) [m], as central differences."""
    b = np.empty(TET_ROWS * LANES)
    for block in range(len(blocks.element)):
        elements = blocks.element[block]
        spacing = SPACING * np.cbrt(shape.volume[elements[0]])
        load_geometry(b, blocks, block)
        load_nodes(b, x, shape, elements)
        load_shares(b, blocks.law[block], elements, material, table)
        for column in range(30):
            row = (NODES + column) * LANES
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
                        part = 0.5 * b[(TOTAL + i) * LANES + lane] / step
                        out[e, column, i] = part if side == 0 else out[e, column, i] + part


@inlined
def mean_gradient(x, shape, e):
    """Return the volume average (9,) of the deformation gradient of element ``e`` at positions ``x`` (n, 3) [m]."""
    return gradient_over(x, shape, e, 10)


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
def corner_edge(x, shape, e, c, k):
    """Return dx/dL_k - dx/dL_c [m] at corner ``c``, along the ``k``-th edge there: 4 x_ck - x_k - 3 x_c."""
    own, middle, end = (
        shape.cells[e, c],
        shape.cells[e, CORNER_NODES[c, k + 1]],
        shape.cells[e, OTHERS[c, k]],
    )
    return (
        4.0 * x[middle, 0] - x[end, 0] - 3.0 * x[own, 0],
        4.0 * x[middle, 1] - x[end, 1] - 3.0 * x[own, 1],
        4.0 * x[middle, 2] - x[end, 2] - 3.0 * x[own, 2],
    )


@internal
def least_corners(x, shape, elements, out):
    """Write the least volume ratio det F over the corners of each of ``elements`` (k,) to ``out`` (m,).

    The value is NaN if one of the ratios is NaN.
    """
    for e in elements:
        least, total = math.inf, 0.0
        for c in range(4):
            p, q, r = corner_edge(x, shape, e, c, 0), corner_edge(x, shape, e, c, 1), corner_edge(x, shape, e, c, 2)
            ratio = ORDER[c] * shape.corner_ratio[e, c] * dot(p, cross(q, r))
            least, total = min(least, ratio), total + ratio
        out[e] = least if math.isfinite(total) else math.nan


@inlined
def room(x, shape, e, scratch):
    """Return the distance [m] that vertices may move before a corner can reach the barrier; 0 if nearly folded.

    The bound is the bound of `watch`, with edges that change by up to 8 d if no vertex moves by more than d.
    """
    found = math.inf
    for c in range(4):
        p, q, r = corner_edge(x, shape, e, c, 0), corner_edge(x, shape, e, c, 1), corner_edge(x, shape, e, c, 2)
        scale = abs(shape.corner_ratio[e, c])
        ratio = ORDER[c] * shape.corner_ratio[e, c] * dot(p, cross(q, r))
        if not ratio >= NEARLY_FOLDED:
            return 0.0
        found = min(found, corner_room(p, q, r, ratio, scale))
    return 0.125 * found


@internal
def add_walls(x, watched, shape, material, table, force, energy):
    """Add the fold barriers of the ``watched`` elements (k,) to node forces (m, 10, 3) [N] and energies (m,) [J]."""
    for e in watched:
        scale = 0.25 * WEIGHT * shape.volume[e] * table.parameters[material[e], SHEAR]
        for c in range(4):
            p, q, r = corner_edge(x, shape, e, c, 0), corner_edge(x, shape, e, c, 1), corner_edge(x, shape, e, c, 2)
            signed = ORDER[c] * shape.corner_ratio[e, c]
            over_p, over_q, over_r = cross(q, r), cross(r, p), cross(p, q)
            ratio = signed * dot(p, over_p)
            if not ratio < THRESHOLD:
                continue
            value, slope = wall(ratio / THRESHOLD)
            energy[e] += scale * value
            slope *= scale * signed / THRESHOLD
            add_edge(force, e, c, 0, slope, over_p)
            add_edge(force, e, c, 1, slope, over_q)
            add_edge(force, e, c, 2, slope, over_r)


@inlined
def add_edge(force, e, c, k, share, derivative):
    """Add ``share`` times the derivative with respect to a corner's ``k``-th edge to the forces on its three nodes."""
    for i in range(3):
        pull = share * derivative[i]
        force[e, CORNER_NODES[c, k + 1], i] += 4.0 * pull
        force[e, OTHERS[c, k], i] -= pull
        force[e, c, i] -= 3.0 * pull
