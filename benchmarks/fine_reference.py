# SPDX-License-Identifier: Apache-2.0
"""Mesh-converged solutions with FElupe: ``python -m benchmarks.fine_reference SCENE``.

The elements are those of `benchmarks.fine_model`. The mesh is the paper's or, for nearly
incompressible rubber, one that is twice as fine. A solution takes seven seconds to a few minutes
in one thread.
"""

from __future__ import annotations

import argparse
import sys
from importlib.metadata import version
from pathlib import Path
from time import perf_counter

import scipy.sparse

from benchmarks.cases import Case, CaseName, get_case
from benchmarks.fine_model import build_model, condensed_solve, strain_energy
from benchmarks.peers.felupe_model import MILLIMETRES
from benchmarks.peers.felupe_peer import nodal_forces, run_newton
from benchmarks.peers.peer import handle_reaction
from benchmarks.references import (
    Reference,
    ReferenceKind,
    load_reference,
    measure_error,
    reference_path,
    save_reference,
)

TOLERANCE = 1e-7
"""Tolerance of Newton's method: norm of the residual divided by that of the reactions."""
REFINEMENT = {CaseName.BEND5: 1, CaseName.TWIST90: 2, CaseName.TENSILE: 2, CaseName.TWIST90_UNIFORM: 1}
"""Number of cells along each edge of a cell of the paper's mesh."""
STEPS = {CaseName.BEND5: 2, CaseName.TWIST90: 3, CaseName.TENSILE: 3, CaseName.TWIST90_UNIFORM: 3}
"""Number of load steps."""


def make_reference(case: Case, *, refinement: int, steps: int, command: str) -> Reference:
    """Solve a scene on its refined mesh and sample it at the vertices of the paper's mesh.

    Args:
        case: scene to solve.
        refinement: number of cells along each edge of a cell of the paper's mesh.
        steps: number of load steps.
        command: command line that the user typed; it is stored with the reference.
    """
    from pypardiso import PyPardisoSolver

    start = perf_counter()
    nx, ny, nz = (refinement * count for count in case.cells)
    grid = case.grid((nx, ny, nz), order=2)
    pardiso = PyPardisoSolver(mtype=-2)
    solve = condensed_solve(grid, lambda a, b: pardiso.solve(scipy.sparse.triu(a, format="csr"), b))
    model = build_model(case, grid)
    result, iterations = run_newton(case, model, steps=steps, solver=None, tolerance=TOLERANCE, solve=solve)
    displacement = result.x[0].values / MILLIMETRES
    vertices = case.grid().points()
    return Reference(
        vertices=vertices,
        displacement=grid.evaluate(displacement, vertices),
        reaction=handle_reaction(grid, displacement, nodal_forces(model, displacement)),
        energy=strain_energy(case, grid, result),
        meta={
            "scene": case.name.value,
            "command": command,
            "element": "Q2/P1: triquadratic hexahedra, linear discontinuous pressure and volume ratio",
            "mesh": [nx, ny, nz],
            "unknowns": int(displacement.size),
            "steps": steps,
            "iterations": iterations,
            "tolerance": TOLERANCE,
            "felupe": version("felupe"),
            "seconds": round(perf_counter() - start, 1),
            "units": "m, N, N m, J",
        },
    )


def main() -> int:
    """Compute the reference of a scene, write it, and print its distance from the common reference."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.fine_reference", description=__doc__)
    parser.add_argument("scene", choices=[name.value for name in CaseName])
    parser.add_argument("--refinement", type=int, help="cells along each edge of a cell of the paper's mesh")
    parser.add_argument("--directory", type=Path, help="where to keep it (default: test/data/reference)")
    options = parser.parse_args()
    case = get_case(options.scene)
    reference = make_reference(
        case,
        refinement=options.refinement or REFINEMENT[case.name],
        steps=STEPS[case.name],
        command=" ".join(["python -m benchmarks.fine_reference", *sys.argv[1:]]),
    )
    path = reference_path(case.name, ReferenceKind.REFINED, directory=options.directory)
    save_reference(path, reference)
    shared = load_reference(case.name)
    error = measure_error(reference.displacement, shared.displacement)
    index = case.reaction_index
    print(f"{path}: {reference.meta['seconds']} s, {reference.meta['iterations']} iterations")
    print(f"against {ReferenceKind.FINE.value}: mean {error.mean:.2e}, maximum {error.maximum:.2e}, reaction", end=" ")
    print(f"{reference.reaction[index]:.6g} / {shared.reaction[index]:.6g}, energy", end=" ")
    print(f"{reference.energy:.6g} / {shared.energy:.6g}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
