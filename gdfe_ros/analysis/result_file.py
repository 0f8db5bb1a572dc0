# SPDX-License-Identifier: Apache-2.0
"""The result of a solve as an npz file."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from gdfe_ros import __version__
from gdfe_ros.simulation import Simulation
from gdfe_ros.solver.result import StepResult


def write_result(
    path: Path, simulation: Simulation, result: StepResult, *, steps: int, wall_time: float, whole: bool = True
) -> None:
    """Write positions, element fields, reactions and metadata, SI units.

    Keys: ``X, x`` (n, 3) undeformed and current vertices [m]; ``cells`` (m, 8 or 4); ``eps_eq, J, omega`` (m,);
    ``energy`` [J]; ``reaction_<handle>`` (6,) force [N] and moment [N m] of the handle on the body, the moment about
    the handle's deformed centre; ``actuator_<name>`` (3,) command, length [m] or volume [m^3], tension [N] or pressure
    [Pa]; ``probe_<name>`` (3,) position [m]; ``meta``: JSON text, with ``converged``, and ``whole``: whether
    the program was not interrupted.

    Raises:
        OSError: the file cannot be written.
    """
    fields = simulation.fields()
    meta = {
        "scene": simulation.scene.name,
        "policy": result.policy.value,
        "tolerance": simulation.settings.tolerance,
        "converged": result.converged,
        "error_estimate": result.error_estimate,
        "steps": steps,
        "whole": whole,
        "wall_time": wall_time,
        "min_det": result.min_det,
        "message": result.message,
        "actuators": {name: state.mode.value for name, state in result.actuators.items()},
        "version": __version__,
    }
    with path.open("wb") as file:
        np.savez_compressed(
            file,
            X=simulation.mesh.vertices,
            x=result.positions,
            cells=simulation.mesh.cells,
            eps_eq=fields.eps_eq,
            J=fields.J,
            omega=fields.omega,
            energy=result.energy,
            meta=json.dumps(meta),
            **{f"reaction_{name}": values for name, values in result.reactions.items()},
            **{
                f"actuator_{name}": [state.command, state.extent, state.effort]
                for name, state in result.actuators.items()
            },
            **{f"probe_{name}": position for name, position in simulation.probe_positions().items()},
        )
