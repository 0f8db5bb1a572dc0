# SPDX-License-Identifier: Apache-2.0
"""Quadratic programme for one change of the commands; only this module calls the solver of such programmes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.errors import DependencyError

Array = NDArray[np.float64]
ROUNDING = 1e-12
"""Distance from a bound up to which x is set to the bound, if |b| = 1 and the columns of A have norms of at most 1."""


def least_squares(
    rows: Array, goal: Array, low: Array, high: Array, *, least: float, costs: Array | None = None
) -> Array:
    """Return the x (n,) that minimises |A x - b|^2 + least^2 |D x|^2 with low <= x <= high, up to rounding.

    The bounds are satisfied exactly.

    Args:
        rows: A (m, n).
        goal: b (m,).
        low: lower bounds of x (n,); minus infinity for no bound.
        high: upper bounds of x (n,), each at least ``low``; infinity for no bound.
        least: weight of x, above zero, so that the solution is unique.
        costs: D (n,), each at least the norm of A's column; None for these norms.

    Raises:
        DependencyError: quadprog is not installed.
    """
    try:
        import quadprog
    except ImportError as error:
        raise DependencyError("inverse control needs quadprog; remedy: pip install gdfe_ros[control]") from error
    lengths = np.linalg.norm(rows, axis=0) if costs is None else costs
    lengths = np.maximum(lengths, max(float(lengths.max(initial=0.0)) * 1e-9, 1e-300))
    scaled = rows / lengths  # all entries are of the order of one, whatever the units
    size = max(float(np.linalg.norm(goal)), 1e-300)
    hessian = scaled.T @ scaled + least**2 * np.eye(len(lengths))
    bounds = np.concatenate([low * lengths / size, -high * lengths / size])
    sides = np.concatenate([np.eye(len(lengths)), -np.eye(len(lengths))], axis=1)
    real = np.isfinite(bounds)
    given = (sides[:, real], bounds[real]) if real.any() else ()
    found = quadprog.solve_qp(hessian, scaled.T @ (goal / size), *given)[0] * size / lengths
    near = ROUNDING * size / lengths
    return np.where(found <= low + near, low, np.where(found >= high - near, high, found))
