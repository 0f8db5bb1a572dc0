# SPDX-License-Identifier: Apache-2.0
"""Solution of a `Problem` with this solver: an ordinary scene, with a tolerance far below the measured errors."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace

from benchmarks.coarse_meshes.problem import YOUNG, Array, Found, Problem
from gdfe_ros.command import Command
from gdfe_ros.mesh.packing import pack_mesh
from gdfe_ros.scene import scene_from_text
from gdfe_ros.simulation import Simulation
from gdfe_ros.solver.settings import Torsion

TOLERANCE, LIMIT = 1e-9, 20_000


@dataclass(frozen=True, eq=False, kw_only=True)
class NodalForces:
    """A dead load with a given force on each vertex.

    Attributes:
        name: name of the load.
        values: forces (n, 3) [N].
    """

    name: str
    values: Array

    def forces(self, rest: Array, cells: Array) -> Array:
        """Return the force at each vertex (n, 3) [N]."""
        return self.values


def solve(problem: Problem, torsion: Torsion = Torsion.CELL) -> Found:
    """Return this solver's solution of a problem.

    Raises:
        RuntimeError: the solve did not converge.
    """
    handles = {
        name: {"where": {"vertices": held.vertices.tolist()}, "free": [axis.name.lower() for axis in held.free]}
        for name, held in problem.held.items()
    }
    scene = scene_from_text(
        json.dumps(
            {
                "name": "coarse",
                "mesh": {"embedded": pack_mesh(problem.mesh)},
                "materials": {"soft": {"law": "linear", "young": YOUNG, "poisson": problem.poisson}},
                "regions": [{"material": "soft"}],
                "handles": handles,
                "solver": {"tolerance": TOLERANCE, "max_iterations": LIMIT, "torsion": torsion.value},
            }
        )
    )
    if problem.forces is not None:
        scene = replace(scene, loads=(NodalForces(name="forces", values=problem.forces),))
    simulation = Simulation(scene)
    result = simulation.step(Command(handles={name: held.pose for name, held in problem.held.items()}))
    if not result.converged:
        raise RuntimeError(f"{problem.mesh.n_cells} cells: {result.message}")
    return Found(displacement=result.positions - problem.mesh.vertices, reactions=result.reactions)
