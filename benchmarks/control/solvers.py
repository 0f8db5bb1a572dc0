# SPDX-License-Identifier: Apache-2.0
"""Quadratic programmes of inverse control with four solvers: time, and error relative to the best solution.

``python -m benchmarks.control.solvers`` prints the table; it needs proxsuite, osqp, clarabel and quadprog.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Solve = Callable[[Array, Array, Array, Array], Array]
SIZES, COUNT = (2, 3, 6, 12), 200


def programmes(size: int) -> list[tuple[Array, Array, Array, Array]]:
    """Return random programmes P, q, low, high: least squares with three rows, a small weight of x, and bounds (n,)."""
    random, found = np.random.default_rng(size), []
    for _ in range(COUNT):
        rows = random.standard_normal((3, size)) * 10.0 ** random.uniform(-2, 0, size)
        goal = 2.0 * random.standard_normal(3)
        hessian = rows.T @ rows + 1e-6 * np.trace(rows.T @ rows) * np.eye(size)
        low, high = -random.uniform(0.0, 1.0, size), random.uniform(0.0, 1.0, size)
        found.append((hessian, -rows.T @ goal, low, high))
    return found


def by_quadprog(hessian: Array, linear: Array, low: Array, high: Array) -> Array:
    """Solve by Goldfarb and Idnani's dual active set."""
    import quadprog

    sides = np.concatenate([np.eye(len(low)), -np.eye(len(low))], axis=1)
    return quadprog.solve_qp(hessian, -linear, sides, np.concatenate([low, -high]))[0]


def by_proxsuite(hessian: Array, linear: Array, low: Array, high: Array) -> Array:
    """Solve by ProxQP, an augmented Lagrangian."""
    from proxsuite import proxqp

    none = np.zeros((0, len(low)))
    found = proxqp.dense.solve(
        hessian, linear, none, np.zeros(0), np.eye(len(low)), low, high, eps_abs=1e-9, verbose=False
    )
    return found.x


def by_osqp(hessian: Array, linear: Array, low: Array, high: Array) -> Array:
    """Solve by OSQP's alternating directions, polished."""
    import osqp
    from scipy import sparse

    solver = osqp.OSQP()
    given = {"eps_abs": 1e-9, "eps_rel": 1e-9, "polishing": True, "verbose": False, "max_iter": 20000}
    solver.setup(sparse.triu(hessian).tocsc(), linear, sparse.identity(len(low), format="csc"), low, high, **given)
    return solver.solve(raise_error=False).x


def by_clarabel(hessian: Array, linear: Array, low: Array, high: Array) -> Array:
    """Solve by Clarabel's interior point."""
    import clarabel
    from scipy import sparse

    settings = clarabel.DefaultSettings()
    settings.verbose = False
    one = sparse.identity(len(low), format="csc")
    cones = [clarabel.NonnegativeConeT(2 * len(low))]
    sides = sparse.vstack([one, -one]).tocsc(), np.concatenate([high, -low])
    return np.array(clarabel.DefaultSolver(sparse.triu(hessian).tocsc(), linear, *sides, cones, settings).solve().x)


SOLVERS: dict[str, Solve] = {
    "quadprog": by_quadprog,
    "proxsuite": by_proxsuite,
    "osqp": by_osqp,
    "clarabel": by_clarabel,
}


def main() -> None:
    """Print the table: time [us], and the largest violation of a bound or relative excess over the best objective."""
    print("| actuators | " + " | ".join(f"{name}: us, error" for name in SOLVERS) + " |")
    print("|---" * (len(SOLVERS) + 1) + "|")
    for size in SIZES:
        given, answers, cells = programmes(size), {}, []
        for name, solve in SOLVERS.items():
            times, found = [], []
            for programme in given:
                began = time.perf_counter()
                found.append(np.asarray(solve(*programme)))
                times.append(time.perf_counter() - began)
            answers[name] = (statistics.median(times), found)
        for name in SOLVERS:
            worst = 0.0
            for i, (hessian, linear, low, high) in enumerate(given):
                values = {}
                for other in SOLVERS:
                    x = np.clip(answers[other][1][i], low, high)
                    values[other] = 0.5 * x @ hessian @ x + linear @ x
                scale = max(abs(min(values.values())), 1e-12)
                x = answers[name][1][i]
                outside = float(np.maximum(np.maximum(low - x, x - high), 0.0).max())
                worst = max(worst, outside, (values[name] - min(values.values())) / scale)
            cells.append(f"{1e6 * answers[name][0]:.0f}, {worst:.0e}")
        print(f"| {size} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
