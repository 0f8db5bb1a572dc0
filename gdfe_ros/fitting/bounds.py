# SPDX-License-Identifier: Apache-2.0
"""Bounds with the wrong unit: what the data ask for lies decades beyond them."""

from __future__ import annotations

import numpy as np

from gdfe_ros.errors import GdfeError
from gdfe_ros.fitting.problem import FitProblem
from gdfe_ros.fitting.solve import Solved
from gdfe_ros.fitting.statistics import Confidence
from gdfe_ros.fitting.trajectory import NotSimulatedError

DECADES = (1, 2, 3)
"""How far beyond a bound is looked, in powers of ten."""
BETTER = 0.25
"""Sum of squares, over that at the bound, from which on the bound is wrong: the misfit halves."""


def require_bounds(problem: FitProblem, solved: Solved, known: Confidence) -> None:
    """Refuse a fit that ends at a bound where powers of ten beyond it are met far better.

    Raises:
        GdfeError: such a value, with the decade that the data ask for.
    """
    for place, (parameter, estimate) in enumerate(zip(problem.parameters, known.estimates, strict=True)):
        if not estimate.bound or not parameter.logarithmic:
            continue
        sign = 1.0 if estimate.bound == "high" else -1.0
        tried = [(_cost(problem, solved, place, estimate.value * 10.0 ** (sign * n)), n) for n in DECADES]
        cost, decade = min(tried)
        if cost < BETTER * solved.cost:
            asked = estimate.value * 10.0 ** (sign * decade)
            raise GdfeError(
                f"{parameter.key} ends at its bound {estimate.value:g}, but the data are fitted best by about "
                f"{asked:.1g}: there the misfit is {np.sqrt(solved.cost / cost):.2g} times smaller; remedy: check the "
                "unit (1 MPa is 1.0e6), or give wider bounds"
            )


def _cost(problem: FitProblem, solved: Solved, place: int, value: float) -> float:
    """Return half the sum of squares with one value changed beyond its bound."""
    values = list(solved.point.values)
    values[place] = value
    trajectories = problem.trajectories(tuple(values))
    if any(isinstance(item, NotSimulatedError) for item in trajectories):
        return np.inf
    residual = problem.stacked(trajectories, solved.point.own)
    return 0.5 * float(residual @ residual)
