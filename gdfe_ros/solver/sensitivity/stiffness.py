# SPDX-License-Identifier: Apache-2.0
"""Tangents of a body's elements including viscosity; derivatives need them, minimisations do not."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.solver.body import Body
from gdfe_ros.solver.descent.workspace import Problem
from gdfe_ros.solver.motion.viscosity import Viscosity
from gdfe_ros.solver.tangent.element_stiffness import SPACING, ElementStiffness


class WholeStiffness(ElementStiffness):
    """Evaluates the tangents of a body's elements and of its viscosity.

    Args:
        body: the discretised body.
        viscosity: the term with the body's dashpots and viscous branches; None without viscosity.
    """

    def __init__(self, body: Body, viscosity: Viscosity | None) -> None:
        super().__init__(*body.cells.shape)
        self._viscosity, self._step = viscosity, SPACING * float(np.cbrt(body.shape.volume.min()))

    def at(self, problem: Problem, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the tangents (m, 3 c, 3 c) [N/m] at ``x`` (n, 3) [m]; the attribute ``values`` excludes viscosity."""
        own = super().at(problem, x)
        return own if self._viscosity is None else own + self._viscous(problem, x)

    def _viscous(self, problem: Problem, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the viscous tangents (m, 3 c, 3 c) [N/m]: central differences with separate nodes for each element."""
        cells = problem.shape.cells
        (count, nodes), apart = cells.shape, np.arange(cells.size, dtype=np.int32).reshape(cells.shape)
        out = np.empty((count, 3 * nodes, 3 * nodes))
        for column in range(3 * nodes):
            forces = []
            for step in (self._step, -self._step):
                places = x[cells].reshape(-1, 3)
                places[column // 3 :: nodes, column % 3] += step
                forces.append(self._viscosity.forces(places, apart).reshape(count, -1))
            out[:, :, column] = (forces[0] - forces[1]) / (2.0 * self._step)
        return out
