# SPDX-License-Identifier: Apache-2.0
"""Tangent stiffness of single elements: central differences of the element kernel where cells share no vertex."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.compiled import kernel
from gdfe_ros.solver.descent.workspace import Problem
from gdfe_ros.solver.elements.response import evaluate

SPACING = 1e-5
"""Of the cube root of an element's volume: truncation and rounding of a central difference are alike there, 1e-10."""


@kernel
def element_stiffness(x, cells, spacing, shape, blocks, material, pressure, scale, table, work, force, energy, out):
    """Write d(corner force)/d(corner position) (m, 24, 24) [N/m] of the elements of ``blocks`` at ``x`` (n, 3) [m].

    ``shape`` is that of a mesh whose cells share no vertex; ``spacing`` (m,) [m], ``work`` (8 m, 3), ``force``
    (2, m, 8, 3) and ``energy`` (m,) are scratch, of which ``force`` is zero for the elements that are left out.
    """
    count = len(cells)
    for corner in range(7):
        for axis in range(3):
            for side in range(2):
                for e in range(count):
                    for a in range(8):
                        for b in range(3):
                            work[8 * e + a, b] = x[cells[e, a], b]
                    work[8 * e + corner, axis] += spacing[e] if side == 0 else -spacing[e]
                evaluate(work, shape, blocks, material, pressure, scale, table, force[side], energy, None)
            for e in range(count):
                share = 0.5 / spacing[e]
                for a in range(8):
                    for b in range(3):
                        out[e, 3 * corner + axis, 3 * a + b] = share * (force[0, e, a, b] - force[1, e, a, b])
    # The eighth corner's rows follow from the others: a translation costs nothing.
    for e in range(count):
        for axis in range(3):
            for j in range(24):
                total = 0.0
                for corner in range(7):
                    total += out[e, 3 * corner + axis, j]
                out[e, 21 + axis, j] = -total


class ElementStiffness:
    """Evaluates the tangents of a body's elements.

    Args:
        cells: (m, 8) corners of the elements.
        volume: (m,) at rest [m^3].
    """

    def __init__(self, cells: NDArray[np.int32], volume: NDArray[np.float64]) -> None:
        count = len(cells)
        self._cells, self._spacing = cells, SPACING * np.cbrt(volume)
        self._apart = np.arange(8 * count, dtype=np.int32).reshape(count, 8)
        self._work, self._energy = np.zeros((8 * count, 3)), np.zeros(count)
        self._force, self._values = np.zeros((2, count, 8, 3)), np.zeros((count, 24, 24))

    def at(self, problem: Problem, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the tangents (m, 24, 24) [N/m] at ``x`` (n, 3) [m], in an array that the next call overwrites."""
        element_stiffness(
            x,
            self._cells,
            self._spacing,
            problem.shape._replace(cells=self._apart),
            problem.blocks,
            problem.material,
            problem.pressure,
            problem.scale,
            problem.table,
            self._work,
            self._force,
            self._energy,
            self._values,
        )
        return self._values


def without_negative(stiffness: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return tangents (m, 24, 24) without their negative eigenvalues: the nearest that are nowhere indefinite.

    A sum of such tangents is none either, and where an element is stable it stays as it is (Teran et al. 2005).
    """
    symmetric = 0.5 * (stiffness + stiffness.transpose(0, 2, 1))
    values, vectors = np.linalg.eigh(symmetric)
    return np.einsum("eik,ek,ejk->eij", vectors, np.maximum(values, 0.0), vectors, optimize=True)
