# SPDX-License-Identifier: Apache-2.0
"""A clamped bar of 0.1 x 0.02 x 0.02 m, E = 2e5 Pa, 1000 kg/m^3, that sags under its weight."""

from __future__ import annotations

import time
from typing import NamedTuple

import numpy as np

from gdfe_ros.actuators import Gravity
from gdfe_ros.constraints import Handle
from gdfe_ros.materials import Material
from gdfe_ros.mesh import Mesh
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.equilibrium.energy import EquilibriumSolver
from gdfe_ros.solver.forces.actuation import Actuation
from gdfe_ros.solver.solution import Increment

DENSITY, GRAVITY = 1000.0, 9.81
TOLERANCE = 1e-5


class Sag(NamedTuple):
    """Mean sag of the bar's end [m], iterations, set-up time and solve time [s]."""

    metres: float
    iterations: int
    setup: float
    solve: float


def sag(mesh: Mesh, law: Material) -> Sag:
    """Return the sag of a bar along x that is clamped at its end with the smallest x.

    Raises:
        RuntimeError: the solve did not converge.
    """
    held = np.flatnonzero(mesh.vertices[:, 0] < 1e-9).astype(np.int32)
    began = time.perf_counter()
    body = Body.build(
        mesh.vertices, mesh.cells, [law], np.zeros(mesh.n_cells, np.int32), [Handle("base", held, fixed=True)]
    )
    weight = np.array([0.0, 0.0, -GRAVITY])
    load = Gravity(name="weight", acceleration=weight, density=np.full(mesh.n_cells, DENSITY))
    equilibrium = EquilibriumSolver(body, Actuation(body, (), [load]))
    ready = time.perf_counter()
    rest = equilibrium.at_rest()
    found = equilibrium.solve(
        Increment(poses=rest.poses, commands={"weight": 1.0}, tolerance=TOLERANCE, limit=5000), rest
    )
    if not found.converged:
        raise RuntimeError(f"no equilibrium: {found.state.summary.message}")
    end = mesh.vertices[:, 0] > mesh.vertices[:, 0].max() - 1e-9
    drop = (mesh.vertices - found.positions)[end, 2].mean()
    return Sag(float(drop), found.iterations, ready - began, time.perf_counter() - ready)
