# SPDX-License-Identifier: Apache-2.0
"""Products with the elements' tangents, and the derivative of hourglass scales with respect to strain.

Minimisations keep the scales constant.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.compiled import internal, kernel, vector_kernel
from gdfe_ros.materials.stress import curve_state
from gdfe_ros.materials.tensor import cofactor, determinant
from gdfe_ros.solver.elements.cell_kernels import mean_gradient
from gdfe_ros.solver.elements.measures import equivalent_strain, softened_scale

SPACING = 1e-6
"""Change of an entry of the deformation gradient in a central difference."""


@internal
def scale_at(f, table, k):
    """Return the hourglass scale of an element of material ``k`` with the mean gradient ``f`` (9,)."""
    g = (f[0], f[1], f[2], f[3], f[4], f[5], f[6], f[7], f[8])
    c = cofactor(g)
    _, _, tangent = curve_state(equivalent_strain(g, c, determinant(g, c), table, k), table, k)
    return softened_scale(tangent, table, k)


@kernel
def scale_slopes(x, elements, shape, material, table, out):
    """Add d(scale)/d(corner position) of ``elements`` at ``x`` (n, 3) [m] to ``out`` (m, 8, 3) [1/m]."""
    f = np.empty(9)
    for e in elements:
        k = material[e]
        g = mean_gradient(x, shape, e)
        for i in range(9):
            f[i] = g[i]
        for i in range(3):
            for j in range(3):
                here = f[3 * i + j]
                f[3 * i + j] = here + SPACING
                above = scale_at(f, table, k)
                f[3 * i + j] = here - SPACING
                slope = (above - scale_at(f, table, k)) / (2.0 * SPACING)
                f[3 * i + j] = here
                for a in range(8):
                    out[e, a, i] += slope * shape.gradient[e, a, j]


def slopes(
    x: NDArray[np.float64], elements: NDArray[np.int32], shape: tuple, material: NDArray[np.int32], table: tuple
) -> NDArray[np.float64]:
    """Return d(scale)/d(corner position) (m, 24) [1/m]; zero except for ``elements``."""
    out = np.zeros((len(material), 8, 3))
    scale_slopes(x, elements, shape, material, table, out)
    return out.reshape(len(material), 24)


@vector_kernel
def add_products(stiffness, softened, slopes, cells, motion, forces):
    """Add (K + f s^T) dx of elements to ``forces`` (n, 3) [N].

    Args:
        stiffness: K (m, 3 c, 3 c) [N/m].
        softened: f (m, 3 c) [N], derivative of the forces with respect to the hourglass scale; empty if it is constant.
        slopes: s (m, 3 c) [1/m], derivative of the scale with respect to the node positions.
        cells: (m, c) nodes of the elements.
        motion: dx (n, 3) [m].
        forces: (n, 3) [N], to which the products are added.
    """
    nodes, soft = cells.shape[1], len(softened) > 0
    local = np.empty(3 * nodes)
    for e in range(len(cells)):
        for a in range(nodes):
            for i in range(3):
                local[3 * a + i] = motion[cells[e, a], i]
        scale = 0.0
        if soft:
            for j in range(3 * nodes):
                scale += slopes[e, j] * local[j]
        for a in range(nodes):
            for i in range(3):
                row, total = stiffness[e, 3 * a + i], 0.0
                for j in range(3 * nodes):
                    total += row[j] * local[j]
                if soft:
                    total += softened[e, 3 * a + i] * scale
                forces[cells[e, a], i] += total
