# SPDX-License-Identifier: Apache-2.0
"""Detection of bounds in the wrong unit: values far beyond the bound then fit much better."""

from __future__ import annotations

import numpy as np

from gdfe_ros.errors import GdfeError
from gdfe_ros.fitting.problem import FitProblem
from gdfe_ros.fitting.solve import Solved
from gdfe_ros.fitting.statistics import Confidence
from gdfe_ros.fitting.trajectory import NotSimulatedError

DECADES = (1, 2, 3)
"""Factors beyond a bound at which values are tried, as powers of ten."""
BETTER = 0.25
"""A bound counts as wrong if the sum of squares falls below this fraction of that at the bound: the misfit halves."""


def require_bounds(problem: FitProblem, solved: Solved, known: Confidence) -> None:
    """Raise an error for a fit that ends at a bound, if values beyond the bound fit far better.

    Values some powers of ten beyond it are tried.

    Raises:
        GdfeError: there is such a parameter; the error names the best decade.
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
                f"{asked:.1g}, where the misfit is {np.sqrt(solved.cost / cost):.2g} times smaller; remedy: check the "
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
