# SPDX-License-Identifier: Apache-2.0
"""Work of a sweep's worker: play the program of each case, and return numbers about its final state."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import Any

from gdfe_ros.errors import GdfeError
from gdfe_ros.scene import scene_from_text
from gdfe_ros.simulation import Simulation
from gdfe_ros.solver.result import StepResult

Result = dict[str, Any]
_KEPT: list[Simulation] = []
"""Simulation of the worker's last case, kept because the next case reuses its factor if the matrix is the same."""
_AXES = ("fx", "fy", "fz", "mx", "my", "mz")


def run_cases_in_turn(scene: str, cases: Sequence[Mapping[str, Any]]) -> list[Result]:
    """Return the results of ``run_case`` for several cases, run one after the other."""
    return [run_case(scene, overrides) for overrides in cases]


def run_case(scene: str, overrides: Mapping[str, Any]) -> Result:
    """Play a scene's program with overrides and return numbers about its final state.

    If the scene is invalid with these overrides, ``status`` is ``failed`` and ``error`` is the reason.

    Args:
        scene: YAML text that needs no other file.
        overrides: dict from dotted scene key to value.

    Returns:
        Dict from name to value. ``elapsed`` and ``cpu_time`` [s] are for the whole case, reading the scene included.
    """
    started, worked = time.perf_counter(), time.thread_time()
    result = _run(scene, overrides)
    return result | {"elapsed": time.perf_counter() - started, "cpu_time": time.thread_time() - worked}


def _run(scene: str, overrides: Mapping[str, Any]) -> Result:
    try:
        simulation = Simulation(scene_from_text(scene, origin="of the sweep", overrides=overrides))
        _KEPT[:] = [simulation]
        results = list(simulation.play())
    except (GdfeError, ValueError, ArithmeticError) as error:
        return {"status": "failed", "error": f"{type(error).__name__}: {error}"}
    return {
        "status": "converged" if all(result.converged for result in results) else "not converged",
        "error": next((result.message for result in results if not result.converged), ""),
        **_numbers(simulation, results),
    }


def _numbers(simulation: Simulation, results: list[StepResult]) -> Result:
    last, fields = results[-1], simulation.fields()
    numbers = {
        "vertices": simulation.mesh.n_vertices,
        "steps": len(results),
        "iterations": sum(result.iterations for result in results),
        "solve_time": sum(result.wall_time for result in results),
        "error_estimate": last.error_estimate,
        "energy": last.energy,
        "min_det": min(result.min_det for result in results),
        "eps_eq_max": float(fields.eps_eq.max()),
        "eps_eq_mean": float(fields.eps_eq.mean()),
    }
    for name in simulation.handle_names:
        pose = simulation.handle_pose(name)
        numbers |= {f"{name}.{axis}": float(v) for axis, v in zip("xyz", pose.translation, strict=True)}
        numbers |= {f"{name}.{axis}": float(v) for axis, v in zip(_AXES, last.reactions[name], strict=True)}
    for name, state in simulation.actuator_states().items():
        numbers |= {f"{name}.extent": state.extent, f"{name}.effort": state.effort}
    for name, position in simulation.probe_positions().items():
        numbers |= {f"{name}.{axis}": float(value) for axis, value in zip("xyz", position, strict=True)}
    return numbers
