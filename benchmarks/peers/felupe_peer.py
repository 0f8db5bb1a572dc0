# SPDX-License-Identifier: Apache-2.0
"""FElupe as a peer: documented API, the best numbers of load steps, and a fast sparse solver."""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import version
from importlib.util import find_spec
from time import perf_counter
from typing import Any

import numpy as np

from benchmarks.cases import Case, CaseName, LogNeoHooke
from benchmarks.peers.felupe_model import MILLIMETRES, Model, build_model
from benchmarks.peers.peer import Array, PeerSolution, Variant, handle_reaction

TOLERANCE = 1e-3
"""Tolerance of Newton's method: residual divided by reactions. A smaller tolerance changes no printed digit of the
error.
"""
ROUGH = 1e-1
"""Tolerance of all load steps except the last, because their results are only starting points."""
_MAXIMUM_ITERATIONS = 30

_LINEAR = {
    CaseName.BEND5: ((10, 1, 1), (20, 2, 2), (25, 2, 2), (30, 3, 3)),
    CaseName.TWIST90: ((8, 2, 2), (12, 3, 3), (16, 4, 4)),
    CaseName.TENSILE: ((8, 2, 2), (12, 3, 3), (16, 4, 4)),
    CaseName.TWIST90_UNIFORM: ((8, 2, 2), (12, 3, 3), (16, 4, 4)),
}
_QUADRATIC = {
    CaseName.BEND5: ((10, 1, 1), (20, 1, 1), (20, 2, 2)),
    CaseName.TWIST90: ((8, 2, 2),),
    CaseName.TENSILE: ((8, 2, 2),),
    CaseName.TWIST90_UNIFORM: ((8, 2, 2),),
}
# Fewest load steps that converge, which are also the fastest: linear, quadratic hexahedra.
_STEPS = {
    CaseName.BEND5: (1, 1),
    CaseName.TWIST90: (2, 3),
    CaseName.TENSILE: (2, 3),
    CaseName.TWIST90_UNIFORM: (2, 2),
}


def available() -> str | None:
    """Return None if FElupe and its automatic differentiation are installed, else the reason and the remedy."""
    missing = [name for name in ("felupe", "tensortrax") if find_spec(name) is None]
    return f"not installed: {', '.join(missing)}; pip install felupe tensortrax pypardiso" if missing else None


def variants(case: Case) -> tuple[Variant, ...]:
    """Return the variants: mean-dilatation hexahedra on the paper's mesh and on coarser meshes."""
    linear, quadratic = _STEPS[case.name]
    runs = [_variant("H8", cells, linear) for cells in (*_LINEAR[case.name], case.cells)]
    runs += [_variant("H27", cells, quadratic) for cells in _QUADRATIC[case.name]]
    return tuple(runs)


def _variant(element: str, cells: tuple[int, int, int], steps: int) -> Variant:
    return Variant(label=f"{element} {'x'.join(map(str, cells))}", element=element, cells=cells, steps=steps)


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
    result, iterations = run_newton(case, model, steps=variant.steps, solver=linear_solver)
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
    case: Case,
    model: Model,
    *,
    steps: int,
    solver: Callable[..., Any],
    tolerance: float = TOLERANCE,
    **options: Any,
) -> tuple[Any, int]:
    """Apply the load in steps; return FElupe's last Newton result and the number of linear solves.

    Args:
        case: scene.
        model: model of the scene.
        steps: number of equal load steps.
        solver: FElupe's ``solver`` argument.
        tolerance: tolerance of the last step.
        options: further arguments of `felupe.newtonraphson`.
    """
    felupe = model.felupe
    handle = model.grid.points()[model.grid.face(right=True)]
    fixed, free = felupe.dof.partition(model.field, model.boundaries)
    state, iterations, result = None, 0, None
    for step in range(1, steps + 1):
        model.prescribe(case.handle_displacement(handle, load=step / steps))
        result = felupe.newtonraphson(
            x0=state,
            items=model.items,
            dof0=fixed,
            dof1=free,
            ext0=felupe.dof.apply(model.field, model.boundaries, fixed),
            solver=solver,
            tol=tolerance if step == steps else max(tolerance, ROUGH),
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
