# SPDX-License-Identifier: Apache-2.0
"""Search for the best parameters: scipy's least squares, over growing horizons."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from gdfe_ros.errors import GdfeError
from gdfe_ros.fitting.problem import FitPoint, FitProblem

HORIZONS = (1 / 16, 1 / 4, 1.0)
"""Fractions of a motion's duration that are fitted one after the other. Over the whole motion, an oscillation that is
wrong by a whole period is a local minimum of the misfit. The first oscillation alone has no such minimum.
"""
STEP = 1e-5
"""Relative change of the unknowns, or of the sum of squares, at which a search ends."""
COARSE = 0.01
"""Relative change of the sum of squares at which a search ends, if a search with a longer horizon follows."""
MOST_TRIALS = 60
SILENT = 1e-3
"""Root mean square of d(residual)/du below which a parameter has no influence. At this limit, a factor e on its value
changes the simulated values by a thousandth of the measured values' standard deviation.
"""


@dataclass(frozen=True, eq=False)
class Solved:
    """Solution of a search.

    Attributes:
        unknowns: unknowns found (u,).
        jacobian: d(residual)/d(unknown) at these unknowns, (values, unknowns), weighted by the loss.
        cost: half the sum of squares of the residuals, or of their loss.
        point: simulations at these unknowns.
        message: reason why the search ended.
    """

    unknowns: NDArray[np.float64]
    jacobian: NDArray[np.float64]
    cost: float
    point: FitPoint
    message: str


def solve(
    problem: FitProblem, *, moves: bool, loss: str = "linear", told: Callable[[str], None] | None = None
) -> Solved:
    """Minimise the sum of squares, or of a robust loss, of the residuals.

    Args:
        problem: problem with the residuals.
        moves: whether the scene has dynamics; then the horizon grows from search to search.
        loss: loss of scipy's `least_squares`.
        told: function that is called with a line of text after each search.

    Raises:
        GdfeError: the initial values cannot be simulated, or a parameter has no influence.
    """
    low, high = problem.bounds()
    shares = HORIZONS if moves else (1.0,)
    framed = any(recording.frame for recording in problem.recordings)
    problem.look_to(1.0 if framed else shares[0])
    unknowns = problem.first()
    _require_influence(problem, unknowns)
    for share in shares:
        problem.look_to(share)
        last = share == 1.0
        accuracy = {
            "xtol": STEP,
            "ftol": STEP if last else COARSE,
            "gtol": None,
            "max_nfev": MOST_TRIALS if last else 15,
        }
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
            told(_line(problem, unknowns, share, result.nfev))
    point = problem.point(unknowns)
    return Solved(unknowns, result.jac, float(result.cost), point, result.message)


def _line(problem: FitProblem, unknowns: NDArray[np.float64], share: float, trials: int) -> str:
    pairs = zip(problem.parameters, problem.values(unknowns), strict=True)
    values = ", ".join(f"{parameter.key} = {value:.5g}" for parameter, value in pairs)
    return f"{100.0 * share:.3g} % of the time, {trials} trials: {values}"


def _require_influence(problem: FitProblem, unknowns: NDArray[np.float64]) -> None:
    """Raise GdfeError if a parameter has no influence on the present horizon, and none on the whole recordings."""
    silent = _silent(problem, unknowns)
    if silent:
        problem.look_to(1.0)
        silent = _silent(problem, unknowns)
    if silent:
        raise GdfeError(
            f"{', '.join(silent)}: no influence on the measured values; remedy: leave it out of --vary, or record a "
            "quantity that it changes (damping shows in motion, density under gravity, a modulus where forces act)"
        )


def _silent(problem: FitProblem, unknowns: NDArray[np.float64]) -> list[str]:
    jacobian = problem.jacobian(unknowns)[:, : len(problem.parameters)]
    influence = np.sqrt((jacobian**2).mean(axis=0))
    return [p.key for p, size in zip(problem.parameters, influence, strict=True) if size < SILENT]
