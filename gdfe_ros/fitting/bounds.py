# SPDX-License-Identifier: Apache-2.0
"""Detection of bounds in a wrong unit: values far beyond such a bound fit much better."""

from __future__ import annotations

import numpy as np

from gdfe_ros.errors import GdfeError
from gdfe_ros.fitting.problem import FitProblem
from gdfe_ros.fitting.solve import Solved
from gdfe_ros.fitting.statistics import Confidence
from gdfe_ros.fitting.trajectory import NotSimulatedError

DECADES = (1, 2, 3)
"""Powers of ten by which an upper bound is multiplied, or a lower bound is divided, to get the tried values."""
BETTER = 0.25
"""A bound counts as wrong if a value beyond it reduces the sum of squares below this fraction of that at the bound."""


def require_bounds(problem: FitProblem, solved: Solved, known: Confidence) -> None:
    """Check that no fitted parameter lies at a bound beyond which the fit is far better.

    The tried values are some powers of ten beyond the bound (`DECADES`). Parameters whose lower bound is not positive
    are not checked.

    Raises:
        GdfeError: a parameter lies at such a bound; the error names the best of the tried values.
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
    """Return half the sum of squares if the parameter at ``place`` has ``value``, which may be beyond its bound."""
    values = list(solved.point.values)
    values[place] = value
    trajectories = problem.trajectories(tuple(values))
    if any(isinstance(item, NotSimulatedError) for item in trajectories):
        return np.inf
    residual = problem.stacked(trajectories, solved.point.own)
    return 0.5 * float(residual @ residual)
