# SPDX-License-Identifier: Apache-2.0
"""A block of 49 152 tetrahedra whose end is moved in steps, on two threads: ``python -m benchmarks.tets.stream``."""

from __future__ import annotations

import time

import numpy as np

from gdfe_ros.constraints import Handle, Pose
from gdfe_ros.materials import NeoHookean
from gdfe_ros.mesh import bar
from gdfe_ros.mesh.tetmesh import divided
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.equilibrium.energy import EquilibriumSolver
from gdfe_ros.solver.solution import Increment

CELLS, THREADS, STEPS, STEP, TOLERANCE = [32, 16, 16], 2, 30, 5e-4, 1e-4


def main() -> None:
    """Print the set-up time and the time of a step; the first steps and compilation are not counted."""
    mesh = divided(bar([0.2, 0.1, 0.1], CELLS))
    x, none = mesh.vertices[:, 0], np.zeros(mesh.n_cells, np.int32)
    ends = [np.flatnonzero(x == value).astype(np.int32) for value in (x.min(), x.max())]
    handles = [Handle("base", ends[0], fixed=True), Handle("end", ends[1])]
    EquilibriumSolver(Body.build(mesh.vertices, mesh.cells, [NeoHookean(young=2e5, poisson=0.45)], none, handles))
    began = time.perf_counter()
    body = Body.build(mesh.vertices, mesh.cells, [NeoHookean(young=2e5, poisson=0.45)], none, handles)
    equilibrium = EquilibriumSolver(body, threads=THREADS)
    state, setup = equilibrium.at_rest(), time.perf_counter() - began
    times, iterations = [], []
    for k in range(STEPS):
        poses = {"base": Pose(), "end": Pose((0.0, 0.0, -STEP * (k + 1)))}
        began = time.perf_counter()
        found = equilibrium.solve(Increment(poses=poses, commands={}, tolerance=TOLERANCE, limit=500), state)
        if not found.converged:
            raise SystemExit(f"step {k} did not converge: {found.state.summary.message}")
        state = equilibrium.accept(found, state)
        times.append(time.perf_counter() - began)
        iterations.append(found.iterations)
    late = times[STEPS // 2 :]
    print(
        f"{mesh.n_cells} tetrahedra, {mesh.n_vertices} nodes: set up in {setup:.1f} s, "
        f"{1.0 / np.median(late):.1f} steps a second with {THREADS} threads, "
        f"{np.mean(iterations[2:]):.1f} iterations a step"
    )


if __name__ == "__main__":
    main()
