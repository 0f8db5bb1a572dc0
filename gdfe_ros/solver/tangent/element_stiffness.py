# SPDX-License-Identifier: Apache-2.0
"""Tangent stiffness of a body's elements."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.compiled import kernel
from gdfe_ros.solver.cell_type import cell_type_with
from gdfe_ros.solver.descent.workspace import Problem
from gdfe_ros.solver.elements.cell_kernels import add_walls
from gdfe_ros.solver.elements.tangent_rows import SPACING


@kernel
def add_wall_tangents(x, watched, shape, material, table, force, energy, out):
    """Add the tangents of the fold barriers of the ``watched`` elements (k,) to ``out`` (m, 3 c, 3 c) [N/m].

    They are central differences of `add_walls`. ``x`` (n, 3) is changed and restored; ``force`` (m, c, 3) and
    ``energy`` (m,) are scratch.
    """
    for k in range(len(watched)):
        e = watched[k]
        spacing = SPACING * np.cbrt(shape.volume[e])
        for column in range(3 * shape.cells.shape[1]):
            vertex, axis = shape.cells[e, column // 3], column % 3
            here = x[vertex, axis]
            for side in range(2):
                step = spacing if side == 0 else -spacing
                x[vertex, axis] = here + step
                force[e] = 0.0
                add_walls(x, watched[k : k + 1], shape, material, table, force, energy)
                for a in range(shape.cells.shape[1]):
                    for i in range(3):
                        out[e, column, 3 * a + i] += 0.5 * force[e, a, i] / step
            x[vertex, axis] = here


class ElementStiffness:
    """Evaluates the tangents of a body's elements, in an array that is reused.

    Args:
        count: number of elements m.
        corners: number c of corners of each element.

    Attributes:
        values: (m, 3 c, 3 c) [N/m] the last result of `at`.
        memory: size of these values [bytes].
    """

    def __init__(self, count: int, corners: int = 8) -> None:
        self._shape, self.memory = (count, 3 * corners, 3 * corners), 8 * count * (3 * corners) ** 2
        self.values = np.zeros((0, 3 * corners, 3 * corners))
        self._force, self._energy = np.zeros((count, corners, 3)), np.zeros(count)
        self._tangents = cell_type_with(corners).tangents

    def at(self, problem: Problem, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the tangents (m, 3 c, 3 c) [N/m] at ``x`` (n, 3) [m], in an array that the next call overwrites."""
        if len(self.values) != self._shape[0]:
            self.values = np.zeros(self._shape)
        shape, material, table = problem.shape, problem.material, problem.table
        self._tangents(x, shape, problem.blocks, material, problem.pressure, problem.scale, table, self.values)
        scratch = self._force, self._energy
        add_wall_tangents(x, problem.watch.watched, shape, material, table, *scratch, self.values)
        return self.values
