# SPDX-License-Identifier: Apache-2.0
"""The cube in FElupe: hexahedra with a mean dilatation, and the reference, triquadratic hexahedra on a graded mesh.

FElupe (GPL-3) is imported inside the functions, because this package needs it only for its benchmark.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any

import numpy as np
import scipy.sparse as sparse

from benchmarks.elasticity import law
from benchmarks.elasticity.newton import Cholesky
from benchmarks.elasticity.problem import DECREMENT, Array, Problem, run
from benchmarks.fine_model import condensed_solve, linear_cell_region
from benchmarks.grids import Grid

STEPS = (1, 2, 4, 8)
"""Numbers of load steps that are tried; the time of the first that converges counts, without the failures before."""
MOST = 30
"""Limit of iterations of a load step."""
BREAKS = (0.0, 0.004, 0.02, 0.07, 0.25)
COARSER = (0.0, 0.02, 0.07, 0.25)
"""Ends of the reference's cells between a face of the cube and the first inner plane of the lattice [m]."""


@dataclass(frozen=True, kw_only=True)
class Graded(Grid):
    """A cube of triquadratic hexahedra that are small at the edges of the clamped faces, where the stress is singular.

    Attributes:
        breaks: ends of the cells along an edge; the node in the middle of a cell is in its middle.
    """

    breaks: tuple[float, ...]

    def points(self) -> Array:
        """Return the undeformed positions of the nodes (n, 3) [m]."""
        ends = np.array(self.breaks)
        nodes = np.sort(np.concatenate([ends, 0.5 * (ends[1:] + ends[:-1])]))
        z, y, x = np.meshgrid(nodes - 0.5, nodes - 0.5, nodes, indexing="ij")
        return np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)


def graded(breaks: tuple[float, ...] = BREAKS) -> Graded:
    """Return the reference's mesh; between the lattice's planes x = 1/4, 1/2 and 3/4 there is one cell."""
    ends = (*breaks, 0.5, *(1.0 - place for place in reversed(breaks)))
    return Graded(size=(1.0, 1.0, 1.0), cells=3 * (len(ends) - 1,), order=2, breaks=ends)  # type: ignore[arg-type]


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
        element = felupe.TriQuadraticHexahedron() if order == 2 else felupe.Hexahedron()
        name, kind = ("hexahedron27", "TriQuadraticHexahedron") if order == 2 else ("hexahedron", "Hexahedron")
        mesh = felupe.Mesh(grid.points(), grid.connectivity(element.points), name)
        field = felupe.FieldContainer([felupe.Field(getattr(felupe, f"Region{kind}")(mesh), dim=3)])
        local = local_part(problem) if order == 2 else 0.0
        umat = material(felupe, problem, local)
        body = felupe.SolidBodyNearlyIncompressible(umat, field, bulk=problem.lame - local)
        try:
            found = newton(felupe, problem, grid, field, body, steps, cholesky)
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


def newton(
    felupe: Any,
    problem: Problem,
    grid: Grid,
    field: Any,
    body: Any,
    steps: int,
    cholesky: Cholesky,
    target: float = DECREMENT,
    condensed: bool = False,
) -> dict[str, Any]:
    """Apply the motion in equal load steps with FElupe's Newton method; return the last field and its iterations.

    A step ends by the Newton decrement, and intermediate ones, which are only starting points, by 1e-2 instead.
    """
    points = grid.points()
    far, near = points[:, 0] > 1.0 - 1e-9, points[:, 0] < 1e-9
    boundaries = {name: felupe.Boundary(field[0], mask=mask) for name, mask in (("near", near), ("far", far))}
    fixed, free = felupe.dof.partition(field, boundaries)
    state, decrement, iterations = None, np.inf, 0

    def linear(matrix: Any, right: Array) -> Array:
        nonlocal decrement
        step = cholesky.solve(sparse.triu(matrix, format="csr"), np.asarray(right).ravel())
        if step is None:
            raise felupe.NewtonConvergenceError("the matrix has no factor")
        decrement = float(np.asarray(right).ravel() @ step) / problem.mu
        return step

    for step in range(1, steps + 1):
        boundaries["far"].update(problem.moved(points[far], step / steps).ravel())
        first, limit = True, target if step == steps else max(target, 1e-2)

        def check(dx: Array, x: Any, f: Array, limit: float = limit, **_: Any) -> tuple[float, float, bool]:
            nonlocal first
            done, first = not first and abs(decrement) < limit, False
            if not np.isfinite(f).all():
                raise felupe.NewtonConvergenceError("not finite")
            return float(np.abs(dx).max()), decrement, done

        solver = {"solve": condensed_solve(grid, linear)} if condensed else {"solver": linear}
        result = felupe.newtonraphson(
            x0=state, items=[body], dof0=fixed, dof1=free, ext0=felupe.dof.apply(field, boundaries, fixed),
            check=check, maxiter=MOST, verbose=0, **solver,
        )  # fmt: skip
        state, iterations = result.x, iterations + result.iterations
    return {"x": state, "iterations": iterations, "solves": cholesky.count, "decrement": decrement}


def reference(problem: Problem, breaks: tuple[float, ...] = BREAKS, steps: int = 4) -> dict[str, Any]:
    """Return the run of the reference: Q2/P1, pressure and volume ratio linear in each cell.

    If FElupe does not converge, it gets four times as many load steps, up to 64.

    Raises:
        felupe.NewtonConvergenceError: it does not converge in 64 steps.
    """
    import felupe

    grid, cholesky = graded(breaks), Cholesky(definite=False)
    mesh = felupe.Mesh(grid.points(), grid.connectivity(felupe.TriQuadraticHexahedron().points), "hexahedron27")
    region = felupe.RegionTriQuadraticHexahedron(mesh)
    cells = linear_cell_region(felupe, region, grid.n_cells)
    unit = np.zeros((4 * grid.n_cells, 1))
    unit[::4] = 1.0
    field = felupe.FieldContainer([felupe.Field(region, dim=3), felupe.Field(cells), felupe.Field(cells, values=unit)])
    local = local_part(problem)
    mixed = felupe.NearlyIncompressible(material(felupe, problem, local), bulk=problem.lame - local)
    mixed.chunksize = None
    body = felupe.SolidBody(mixed, field)
    try:
        found = newton(felupe, problem, grid, field, body, steps, cholesky, 1e-10, True)
    except felupe.NewtonConvergenceError:
        if steps >= 64:
            raise
        return reference(problem, breaks, 4 * steps)
    finally:
        cholesky.close()
    u = found.pop("x")[0].values
    forces = body.results.force.toarray().ravel()[: u.size].reshape(u.shape)
    more = {"felupe": version("felupe"), "cells": list(grid.cells), "steps": steps}
    return run(problem, grid.points(), u, forces, **more, **found)
