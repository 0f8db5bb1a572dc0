# SPDX-License-Identifier: Apache-2.0
"""FElupe as a peer: documented API, the best numbers of load steps, and a fast sparse solver."""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import version
from importlib.util import find_spec
from time import perf_counter
from typing import Any

import numpy as np

from benchmarks.cases import Case, LogNeoHooke
from benchmarks.peers.felupe_model import MILLIMETRES, Model, build_model
from benchmarks.peers.peer import Array, PeerSolution, Variant, handle_reaction

TOLERANCE = 1e-3
"""Tolerance of Newton's method: residual divided by reactions. A smaller tolerance changes no printed digit of the
error.
"""
ROUGH = 1e-1
"""Tolerance of all load steps except the last, because their results are only starting points."""
_MAXIMUM_ITERATIONS = 30


def available() -> str | None:
    """Return None if FElupe and its automatic differentiation are installed, else the reason and the remedy."""
    missing = [name for name in ("felupe", "tensortrax") if find_spec(name) is None]
    return f"not installed: {', '.join(missing)}; pip install felupe tensortrax pypardiso" if missing else None


def solve(case: Case, variant: Variant, points: Array) -> PeerSolution:
    """Build the model, apply the load in steps and evaluate the solution; see `Peer.solve`.

    Raises:
        felupe.NewtonConvergenceError: if a step does not converge.
    """
    name, linear_solver = fastest_solver()
    start = perf_counter()
    grid = case.grid(variant.cells, order=2 if variant.element == "H27" else 1)
    model = build_model(case, grid)
    built = perf_counter()
    handle = grid.points()[grid.face(right=True)]

    def move(load: float) -> None:
        model.prescribe(case.handle_displacement(handle, load=load))

    result, iterations = run_newton(model, move, steps=variant.steps, solver=linear_solver)
    solved = perf_counter()
    displacement = result.x[0].values / MILLIMETRES
    return PeerSolution(
        displacement=grid.evaluate(displacement, points),
        reaction=handle_reaction(grid, displacement, nodal_forces(model, displacement)),
        time_setup=built - start,
        time_solve=solved - built,
        settings={
            "version": version("felupe"),
            "law": "log neo-Hooke" if isinstance(case.laws[0], LogNeoHooke) else "Ogden N=3",
            "formulation": "(u, p, J)" if isinstance(case.laws[0], LogNeoHooke) else "condensed (p, J)",
            "linear_solver": name,
            "tolerance": TOLERANCE,
            "iterations": iterations,
        },
    )


def run_newton(
    model: Model, move: Callable[[float], None], *, steps: int, solver: Callable[..., Any], **options: Any
) -> tuple[Any, int]:
    """Apply the load in steps; return FElupe's last Newton result and the number of linear solves.

    Args:
        model: model of the body.
        move: function that prescribes the motion of the right face at a load, 0 to 1.
        steps: number of equal load steps.
        solver: FElupe's ``solver`` argument.
        options: further arguments of `felupe.newtonraphson`.
    """
    felupe = model.felupe
    fixed, free = felupe.dof.partition(model.field, model.boundaries)
    state, iterations, result = None, 0, None
    for step in range(1, steps + 1):
        move(step / steps)
        result = felupe.newtonraphson(
            x0=state,
            items=model.items,
            dof0=fixed,
            dof1=free,
            ext0=felupe.dof.apply(model.field, model.boundaries, fixed),
            solver=solver,
            tol=TOLERANCE if step == steps else ROUGH,
            maxiter=_MAXIMUM_ITERATIONS,
            verbose=0,
            **options,
        )
        # FElupe works on a copy of the field: the next step continues from the result's.
        state, iterations = result.x, iterations + result.iterations
    return result, iterations


def nodal_forces(model: Model, displacement: Array) -> Array:
    """Return the external forces on the body at every node [N], shape (n, 3), at the last evaluated state.

    They are the internal forces of the solid items. The tie of a sliding handle is left out, because it
    is part of the handle.
    """
    solids = model.items[:-1] if model.slides else model.items
    forces = np.zeros(displacement.size)
    for solid in solids:
        forces += solid.results.force.toarray().ravel()[: displacement.size]
    return forces.reshape(displacement.shape)


def fastest_solver() -> tuple[str, Callable[..., Any]]:
    """Return the name and the function of the fastest sparse solver that is installed."""
    if find_spec("pypardiso") is not None:
        from pypardiso import spsolve as pardiso

        return "pypardiso", pardiso
    from scipy.sparse.linalg import spsolve

    return "scipy spsolve", spsolve
