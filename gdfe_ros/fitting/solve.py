# SPDX-License-Identifier: Apache-2.0
"""The search: scipy's least squares over horizons that double."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from gdfe_ros.errors import GdfeError
from gdfe_ros.fitting.problem import Point, Problem

HORIZONS = (1 / 16, 1 / 8, 1 / 4, 1 / 2, 1.0)
"""Shares of a motion that are fitted one after the other: a swing that is off by a period has another best fit, and a
first swing cannot be."""
STEP = 1e-5
"""Relative change of the unknowns, and of the sum of squares, that ends a search."""
MOST_TRIALS = 60
SILENT = 1e-6
"""Change of the residuals, over their scale, with a whole parameter's coordinate below which it has no influence."""


@dataclass(frozen=True, eq=False)
class Solved:
    """Where a search ended.

    Attributes:
        unknowns: found (u,).
        jacobian: there (values, unknowns), weighted by the loss.
        cost: half the sum of squares, or of the loss.
        point: the problem there.
        message: why it ended.
        first_cost: at the start.
    """

    unknowns: NDArray[np.float64]
    jacobian: NDArray[np.float64]
    cost: float
    point: Point
    message: str
    first_cost: float


def solve(problem: Problem, *, moves: bool, loss: str = "linear", told: Callable[[str], None] | None = None) -> Solved:
    """Minimise the sum of squares, or of a robust loss, of the residuals.

    Args:
        problem: of which.
        moves: the scene has dynamics; then the horizon doubles from search to search.
        loss: of scipy's `least_squares`.
        told: takes a line about each search.

    Raises:
        GdfeError: the start cannot be simulated, or a parameter has no influence.
    """
    low, high = problem.bounds()
    problem.look_to(1.0)
    unknowns = problem.first()
    first = problem.residuals(unknowns)
    _require_influence(problem, unknowns)
    for share in HORIZONS if moves else (1.0,):
        problem.look_to(share)
        last = share == 1.0
        accuracy = {"xtol": STEP, "ftol": STEP if last else 1e-3, "gtol": None, "max_nfev": MOST_TRIALS if last else 15}
        result = least_squares(
            problem.residuals,
            np.clip(unknowns, low, high),
            problem.jacobian,
            bounds=(low, high),
            x_scale="jac",
            loss=loss,
            **accuracy,
        )
        unknowns = result.x
        if told is not None:
            values = ", ".join(f"{p.key} = {v:.5g}" for p, v in zip(problem.parameters, problem.values(unknowns), strict=True))
            told(f"{100.0 * share:.3g} % of the time: {values}, {result.nfev} trials" if moves else f"{values}, {result.nfev} trials")
    point = problem.point(unknowns)
    return Solved(unknowns, result.jac, float(result.cost), point, result.message, 0.5 * float(first @ first))


def _require_influence(problem: Problem, unknowns: NDArray[np.float64]) -> None:
    """Refuse parameters that change nothing."""
    jacobian = problem.jacobian(unknowns)[:, : len(problem.parameters)]
    influence = np.sqrt((jacobian**2).mean(axis=0))
    silent = [p.key for p, size in zip(problem.parameters, influence, strict=True) if size < SILENT]
    if silent:
        raise GdfeError(
            f"{', '.join(silent)}: no influence on anything that was measured; remedy: leave it out of --vary, or record "
            "what it changes (damping shows in motion, density under gravity, a modulus where forces act)"
        )
