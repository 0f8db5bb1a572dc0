# SPDX-License-Identifier: Apache-2.0
"""The tangent of the undeformed body, which preconditions every solve until it is renewed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.solver.descent.active_set import ActiveSet
from gdfe_ros.solver.equilibrium.solve import Model, Solve
from gdfe_ros.solver.matrix.constant_matrix import ConstantMatrix
from gdfe_ros.solver.matrix.coupling import SINGULAR
from gdfe_ros.solver.state import State

INVERSE_ITERATIONS = 6
"""Number of inverse iterations with the tangent's factor; they determine the softness to within a tenth."""


def take_rest(model: Model, whole: ActiveSet, matrix: ConstantMatrix, rest: State) -> None:
    """Give the minimiser the tangent of the undeformed body, unless the body is a mechanism.

    The first multiple of the constant matrix that is added to an indefinite tangent becomes the softness of the body:
    the least eigenvalue of its tangent relative to the constant matrix.

    Args:
        model: the body, its terms and its minimiser.
        whole: the active set of the whole body.
        matrix: the constant matrix.
        rest: the undeformed state.
    """
    count, minimiser = len(whole.unknowns.free), model.minimiser
    if count == 0:
        return
    task, work = Solve.at(model, rest).evaluate(whole, threads=None), whole.workspace
    tangent = minimiser.level.take(task.problem, work.u, work.x)
    if tangent.shift > 0.0:
        return
    load = np.random.default_rng(0).standard_normal(3 * whole.unknowns.rows)
    load[whole.unknowns.fixed] = 0.0
    for _ in range(INVERSE_ITERATIONS):
        found = np.empty_like(load)
        minimiser.level.solve(load, found)
        least = float(found @ load) / float(found @ _weighed(matrix, found, count))
        load = _weighed(matrix, found / np.abs(found).max(), count)
    if least >= SINGULAR:  # else the handles let the body turn or move as a whole
        minimiser.level.first_shift, minimiser.rest = least, tangent
        minimiser.level.keep(tangent)


def _weighed(matrix: ConstantMatrix, field: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Return the constant matrix times a field (3 r,) of the unknowns; rows of handles are zero."""
    rows = field.reshape(-1, 3)
    return np.concatenate([matrix.multiply(rows[:count]).ravel(), np.zeros(3 * (len(rows) - count))])
