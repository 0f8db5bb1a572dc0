# SPDX-License-Identifier: Apache-2.0
"""Products of a displacement with the tangents of elements whose hourglass scales depend on the strain."""

from __future__ import annotations

import numpy as np

from gdfe_ros.compiled import vector_kernel


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
