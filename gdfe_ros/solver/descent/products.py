# SPDX-License-Identifier: Apache-2.0
"""Products of the present tangent with directions, by finite differences of the gradient."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.compiled import kernel
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.descent.minimiser import Task
from gdfe_ros.solver.descent.search import advance
from gdfe_ros.solver.descent.workspace import allocate, numbers
from gdfe_ros.solver.distance import largest

SPACING = 1e-7
"""Largest displacement in a finite difference, divided by the body's size. If a displacement of a tenth of the body's
size changes its stiffness by 100 %, the truncation error is a millionth of the product. The rounding error is smaller.
"""


@kernel
def multiply(problem, u, gradient, beside, direction, spacing, image):
    """Write the product K d (3 r,) [N] of the tangent and ``direction`` to ``image``.

    The product is a finite difference of two gradients: ``gradient`` at the unknowns ``u``, and a second one that is
    evaluated in the workspace ``beside``. The largest displacement between the two points is ``spacing`` [m].
    """
    step, first = spacing / largest(direction), len(u) > 0
    for n in range(len(u)):
        beside.u[n] = u[n] + step * direction[n]
    advance(problem, beside, first)
    for n in range(len(u)):
        image[n] = (beside.gradient[n] - gradient[n]) / step


class TangentProducts:
    """Multiplies the tangent K of all terms by directions, in a workspace of its own.

    Args:
        body: the discretised body.
    """

    def __init__(self, body: Body) -> None:
        self._beside = allocate(body.unknowns.rows, body.rest, body.cells.shape, memory=0)
        self._spacing = SPACING * body.size

    def begin(self, task: Task) -> None:
        """Set the unknowns of ``task`` as the point at which products use the tangent. The task is not modified."""
        work = task.active.workspace
        self._problem, self._u, self._gradient = task.problem, work.u.copy(), work.gradient.copy()
        self._beside.x[...] = work.x

    @property
    def positions(self) -> NDArray[np.float64]:
        """Positions (n, 3) [m] of the last evaluation, overwritten by the next one."""
        return self._beside.x

    def energy(self, step: NDArray[np.float64]) -> float:
        """Return the energy [J] of all terms at the unknowns plus ``step`` (3 r,)."""
        self._beside.u[...] = self._u + step
        advance(self._problem, self._beside, True)
        return float(numbers(self._beside)["energy"])

    def __call__(self, direction: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the product K d (3 r,) [N] of the tangent and a ``direction`` d (3 r,)."""
        image = np.empty_like(direction)
        multiply(self._problem, self._u, self._gradient, self._beside, direction, self._spacing, image)
        return image
