# SPDX-License-Identifier: Apache-2.0
"""The cube in this solver: one step of an ordinary simulation, and the Newton decrement of its result."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.elasticity.newton import Cholesky, Pattern
from benchmarks.elasticity.problem import Array, Problem, run
from gdfe_ros import Command, Simulation
from gdfe_ros.constraints import Handle
from gdfe_ros.materials.table import BULK, CARRIED, PENALTY
from gdfe_ros.mesh import HexMesh, TetMesh, bar
from gdfe_ros.mesh.tetmesh import divide
from gdfe_ros.results.element_fields import corner_forces
from gdfe_ros.scene.scene import Scene
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.elements.cell_type import cell_type_of
from gdfe_ros.solver.elements.measures import update_hourglass_scales
from gdfe_ros.solver.settings import SolverSettings

TOLERANCE = 1e-5
"""Tolerance of every solve: distance to the equilibrium over the cube's diagonal."""


def cube(n: int, *, tetrahedra: bool) -> HexMesh | TetMesh:
    """Return the mesh of n^3 hexahedra, or of six quadratic tetrahedra in each of n^3 cubes."""
    grid = bar([1.0, 1.0, 1.0], [n, n, n])
    return divide(grid) if tetrahedra else grid


def solve(problem: Problem, n: int, *, tetrahedra: bool, tolerance: float = TOLERANCE) -> dict[str, Any]:
    """Return the run of this solver on the cube (`problem.run`); its time includes the set-up from mesh to factor."""
    mesh = cube(n, tetrahedra=tetrahedra)
    x = mesh.vertices[:, 0]
    ends = [np.flatnonzero(np.abs(x - place) < 1e-9).astype(np.int32) for place in (0.0, 1.0)]
    began = time.process_time()
    simulation = Simulation(
        Scene(
            name="cube",
            mesh=mesh,
            materials={"cube": problem.law},
            cell_material=np.zeros(mesh.n_cells, np.int32),
            handles=(Handle("near", ends[0], fixed=True), Handle("far", ends[1])),
            solver=SolverSettings(tolerance=tolerance),
        )
    )
    result = simulation.step(Command(handles={"far": problem.pose}))
    spent = time.process_time() - began
    displacement = result.positions - mesh.vertices
    decrement, forces = measure_decrement(problem, mesh, result.positions, np.concatenate(ends))
    return run(
        problem,
        mesh.vertices,
        displacement,
        forces,
        time=spent,
        iterations=result.iterations,
        steps=result.substeps,
        decrement=decrement,
        message="" if result.converged else result.message or "not converged",
    )


def measure_decrement(problem: Problem, mesh: HexMesh | TetMesh, x: Array, held: np.ndarray) -> tuple[float, Array]:
    """Return the squared Newton decrement over mu at positions ``x`` (n, 3) [m], and dE/dx (n, 3) [N].

    E is the energy of the elements with the whole volume energy, without pressures as unknowns. ``held`` are the
    vertices whose positions are given.
    """
    body = Body.build(mesh.vertices, mesh.cells, [problem.law], np.zeros(mesh.n_cells, np.int32), [])
    parameters, none = body.table.parameters.copy(), np.zeros(mesh.n_cells)
    carried = parameters[:, CARRIED] == 1.0
    parameters[carried, PENALTY] = parameters[carried, BULK]
    body = replace(body, table=body.table._replace(parameters=parameters))
    local, scale = corner_forces(body, x, none)[0], np.ones(mesh.n_cells)
    if cell_type_of(body.shape).softens:
        update_hourglass_scales(
            x, np.arange(mesh.n_cells, dtype=np.int32), body.shape, body.material, body.table, scale
        )
    size = 3 * mesh.cells.shape[1]
    tangents = np.zeros((mesh.n_cells, size, size))
    cell_type_of(body.shape).tangents(x, body.shape, body.blocks, body.material, none, scale, body.table, tangents)
    rows = (3 * body.cells[:, :, None] + np.arange(3, dtype=np.int32)).reshape(mesh.n_cells, size)
    free = np.setdiff1d(np.arange(x.size), 3 * held[:, None] + np.arange(3))
    forces = np.bincount(rows.ravel(), local.ravel(), minlength=x.size)
    cholesky = Cholesky()
    step = cholesky.solve(Pattern(rows, free).matrix(tangents), forces[free])
    cholesky.close()
    if step is None:
        raise RuntimeError(f"{problem.name}: the tangent of the result is not positive definite")
    return float(forces[free] @ step) / problem.mu, forces.reshape(-1, 3)
