# SPDX-License-Identifier: Apache-2.0
"""The cube in FElupe: hexahedra with a mean dilatation, linear or triquadratic.

FElupe (GPL-3) is imported inside the functions, because this package needs it only for its benchmark.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import scipy.sparse as sparse

from benchmarks.elasticity import law
from benchmarks.elasticity.newton import Cholesky
from benchmarks.elasticity.problem import DECREMENT, Array, Problem, run
from benchmarks.grids import Grid
from benchmarks.peers.felupe_model import Model, build_boundaries, build_mesh
from benchmarks.peers.felupe_peer import run_newton

STEPS = (1, 2, 4, 8)
"""Numbers of load steps that are tried; the time of the first that converges counts, without the failures before."""


def local_part(problem: Problem) -> float:
    """Return the part [Pa] of lambda that triquadratic cells keep at their integration points.

    The rest acts on the cell's own J. Without a local part, deformations with a volume change that the cell's J does
    not see are unstable: the law without lambda has no minimum at a free J. As in our tetrahedra, it is 1.5 shear
    moduli.
    """
    return min(problem.lame, 1.5 * problem.law.shear0)


def material(felupe: Any, problem: Problem, local: float) -> Any:
    """Return the law with ``local`` [Pa] instead of lambda; FElupe adds the rest for the J of a cell."""

    def rows(f: Array) -> Array:
        return np.moveaxis(f.reshape(9, *f.shape[2:]), 0, -1)

    def stress(x: list[Array]) -> list[Any]:
        found = law.stress(rows(x[0]), problem.mu, local)
        return [np.ascontiguousarray(np.moveaxis(found, -1, 0)).reshape(x[0].shape), x[-1]]

    def elasticity(x: list[Array]) -> list[Array]:
        found = np.moveaxis(law.tangent(rows(x[0]), problem.mu, local)[1], (-2, -1), (0, 1))
        return [np.ascontiguousarray(found).reshape(3, 3, *x[0].shape)]

    return felupe.Material(stress, elasticity)


def solve(problem: Problem, n: int, order: int) -> dict[str, Any]:
    """Return the run of n^3 hexahedra (`problem.run`), linear or triquadratic, with one J and pressure in each cell."""
    import felupe

    cholesky, spent, message = Cholesky(definite=False), 0.0, ""
    for steps in STEPS:
        cholesky.count, began = 0, time.process_time()
        grid = Grid(size=(1.0, 1.0, 1.0), cells=(n, n, n), order=order)
        field = felupe.FieldContainer([felupe.Field(build_mesh(grid, felupe, unit=1.0), dim=3)])
        sides = build_boundaries(grid, field[0], felupe)
        local = local_part(problem) if order == 2 else 0.0
        umat = material(felupe, problem, local)
        body = felupe.SolidBodyNearlyIncompressible(umat, field, bulk=problem.lame - local)
        try:
            model = Model(felupe=felupe, grid=grid, field=field, items=[body], boundaries=sides, slides=False)
            found = newton(problem, model, steps, cholesky)
        except (felupe.NewtonConvergenceError, ArithmeticError, ValueError) as error:
            message = f"{steps} steps: {error}"
            continue
        spent = time.process_time() - began
        break
    else:
        cholesky.close()
        return {"problem": problem.name, "unknowns": 3 * len(grid.points()), "steps": steps, "message": message}
    cholesky.close()
    u = found.pop("x")[0].values
    forces = body.results.force.toarray().reshape(u.shape)
    return run(problem, grid.points(), u, forces, time=spent, steps=steps, message="", **found)


def newton(problem: Problem, model: Model, steps: int, cholesky: Cholesky) -> dict[str, Any]:
    """Apply the motion in equal load steps with FElupe's Newton method; return the last field and its iterations.

    A step ends by the Newton decrement, and intermediate ones, which are only starting points, by 1e-2 instead.
    """
    far, failure = model.grid.points()[model.grid.face(right=True)], model.felupe.NewtonConvergenceError
    first, limit, decrement = True, DECREMENT, np.inf

    def move(load: float) -> None:
        nonlocal first, limit
        first, limit = True, DECREMENT if load == 1.0 else 1e-2
        model.boundaries["right"].update(problem.moved(far, load).ravel())

    def linear(matrix: Any, right: Array) -> Array:
        nonlocal decrement
        step = cholesky.solve(sparse.triu(matrix, format="csr"), np.asarray(right).ravel())
        if step is None:
            raise failure("the matrix has no factor")
        decrement = float(np.asarray(right).ravel() @ step) / problem.mu
        return step

    def check(dx: Array, x: Any, f: Array, **_: Any) -> tuple[float, float, bool]:
        nonlocal first
        done, first = not first and abs(decrement) < limit, False
        if not np.isfinite(f).all():
            raise failure("not finite")
        return float(np.abs(dx).max()), decrement, done

    result, iterations = run_newton(model, move, steps=steps, solver=linear, check=check)
    return {"x": result.x, "iterations": iterations, "solves": cholesky.count, "decrement": decrement}
