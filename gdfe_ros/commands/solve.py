# SPDX-License-Identifier: Apache-2.0
"""``gdfe solve``: play a scene's program, print the result and write it to a file."""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
import sys
import time
from pathlib import Path

import numpy as np
from rich.table import Table

from gdfe_ros import __version__
from gdfe_ros.actuators.actuator import Mode
from gdfe_ros.commands.options import add_overrides, require_ending, require_folder, require_picture
from gdfe_ros.commands.waiting import PlayProgress, convergence, print_failures, waiting
from gdfe_ros.entry import INTERRUPTED
from gdfe_ros.results.contacts import contact_points, total_forces
from gdfe_ros.results.step_result import StepResult
from gdfe_ros.scene import Scene, load_scene
from gdfe_ros.scene.override import read_overrides
from gdfe_ros.simulation import Simulation
from gdfe_ros.solver.settings import Policy, SolverSettings
from gdfe_ros.untrusted.regular_file import replacing
from gdfe_ros.untrusted.terminal import QUANTITIES, PlainConsole, make_table

NOT_CONVERGED = 3
"""Exit status if a step did not converge."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("scene", help="a name in config/scenes or the path of a YAML file")
    parser.add_argument("--policy", choices=[policy.value for policy in Policy], help="policy instead of the scene's")
    parser.add_argument("--steps", type=int, help="number of equal load steps (default: chosen by the solver)")
    parser.add_argument("--tolerance", type=float, help="tolerance of the solver, instead of the scene's")
    add_overrides(parser, "override a key of the scene, e.g. mesh.bar.cells=[25,2,2]; may be given several times")
    parser.add_argument(
        "--keep-going", action="store_true", help="go on after a step that did not converge (default: stop there)"
    )
    parser.add_argument("--out", type=Path, metavar="FILE.npz", help="write the last step to this file")
    parser.add_argument("--picture", type=Path, metavar="FILE.png", help="draw the deformed body of the last step")


def run(arguments: argparse.Namespace) -> int:
    """Solve a scene; return 0, 3 if a step did not converge, or 130 after an interrupt.

    Table, file and picture show the last step that was solved, also after an interrupt.
    """
    require_ending("--out", arguments.out, [".npz"])
    require_folder("--out", arguments.out)
    require_picture(arguments.picture)
    with waiting(f"loading {arguments.scene}"):
        scene = load_scene(arguments.scene, overrides=read_overrides(arguments.set))
        simulation = Simulation(scene, settings=_settings(scene, arguments))
    for remark in simulation.remarks():
        PlainConsole(stderr=True).print(f"warning: {remark}", style="yellow", highlight=False)
    with waiting(f"preparing {scene.name}"):
        simulation.warm_up()
    started = time.perf_counter()
    results, interrupted = _play(simulation, keep_going=arguments.keep_going)
    wall_time = time.perf_counter() - started
    last = results[-1]
    PlainConsole().print(_table(simulation, results, wall_time))
    if arguments.out:
        write_result(arguments.out, simulation, last, steps=len(results), wall_time=wall_time, whole=not interrupted)
    if arguments.picture:
        _draw(arguments.picture, simulation, last)
    print_failures(results)
    if not last.converged and not arguments.keep_going:
        text = describe_stop(results, beyond=_is_withdrawn(simulation, last))
        PlainConsole(stderr=True, soft_wrap=True).print(text, style="red", highlight=False)
    if interrupted:
        print(f"gdfe solve: interrupted after t = {last.time:.4g} s", file=sys.stderr)
        return INTERRUPTED
    return 0 if all(result.converged for result in results) else NOT_CONVERGED


def describe_stop(results: list[StepResult], *, beyond: bool = False) -> str:
    """Return a line about a run that a failed step ended: the last equilibrium and its commands, and a remedy.

    Args:
        results: results of the steps; the last one failed.
        beyond: whether the failed step returned the last equilibrium on the path to its commands.
    """
    found = [result for result in results if result.converged or (beyond and result is results[-1])]
    if not found:
        return "no equilibrium was found; remedy: smaller commands, or --keep-going"
    states = found[-1].actuators.items()
    commands = [f"{name} = {state.command:.4g} {state.unit}".strip() for name, state in states]
    place = f"{'before ' * beyond}t = {found[-1].time:.4g} s"
    text = f"no equilibrium found beyond {', '.join([*commands, place])}"
    named = "lost its stability" in results[-1].message
    if not named and any(state.mode is Mode.PRESSURE for _, state in states):
        text += "; if the pressure falls with the volume there, command the volume"
    return f"{text}; --keep-going plays the rest of the program"


def _is_withdrawn(simulation: Simulation, last: StepResult) -> bool:
    """Return whether a failed step returned an equilibrium at commands that fall short of the program's commands."""
    program = simulation.scene.program
    if last.converged or program is None or not 0.0 <= last.error_estimate <= simulation.settings.tolerance:
        return False
    wanted = program.actuator_values(last.time)
    reached = {name: state.command for name, state in last.actuators.items() if name in wanted}
    return last.min_det > 0.0 and any(not math.isclose(value, wanted[name]) for name, value in reached.items())


def _settings(scene: Scene, arguments: argparse.Namespace) -> SolverSettings:
    chosen = {name: getattr(arguments, name) for name in ("policy", "steps", "tolerance")}
    return dataclasses.replace(scene.solver, **{key: value for key, value in chosen.items() if value is not None})


def _play(simulation: Simulation, *, keep_going: bool) -> tuple[list[StepResult], bool]:
    """Return the results of the program's steps, up to a failed one or an interrupt, and whether it was interrupted."""
    results: list[StepResult] = []
    program = simulation.scene.program
    with PlayProgress(simulation.scene.name, duration=program.duration if program else 0.0) as progress:
        try:
            for result in simulation.play():
                progress.add(result)
                results.append(result)
                if not (result.converged or keep_going):
                    break
        except KeyboardInterrupt:
            if not results:
                raise
            return results, True
    return results, False


def _table(simulation: Simulation, results: list[StepResult], wall_time: float) -> Table:
    last, mesh = results[-1], simulation.mesh
    failed = "" if last.converged else ": the last step did not converge, its values are no equilibrium"
    if _is_withdrawn(simulation, last):
        failed = ": the last step failed, the values are those of the last equilibrium before its command"
    title = f"{simulation.scene.name}, policy {last.policy.value}{failed}"
    table = make_table(title, QUANTITIES, right=("value",), min_width=64)
    table.add_row("vertices, cells", f"{mesh.n_vertices}, {mesh.n_cells}", "")
    table.add_row("steps", str(len(results)), "")
    table.add_row("iterations", str(sum(result.iterations for result in results)), "")
    table.add_row("solve time", f"{wall_time:.3f}", "s")
    table.add_row("converged", convergence(results), "")
    table.add_row("estimated distance to equilibrium", f"{last.error_estimate:.2e}", "of size")
    table.add_row("strain energy", f"{last.energy:.6g}", "J")
    table.add_row("min det F", f"{last.min_det:.4f}", "")
    _add_forces(table, simulation, last)
    for name, state in last.actuators.items():
        table.add_row(f"{name}: command, {state.mode.value}", f"{state.command:.6g}", state.unit)
        for what, value, unit in state.readings():
            table.add_row(f"{name}: {what}", f"{value:.6g}", unit)
    for name, position in simulation.probe_positions().items():
        table.add_row(f"{name}: position", "  ".join(f"{value:.5g}" for value in position), "m")
    return table


def _add_forces(table: Table, simulation: Simulation, last: StepResult) -> None:
    """Add reactions, readings of contact sensors, motions of rigid bodies and total contact forces to the table."""
    readings = {f"sensor {name}": sensor.wrench(last) for name, sensor in simulation.scene.sensors.items()}
    for name, reaction in {**last.reactions, **readings}.items():
        table.add_row(f"{name}: force", "  ".join(f"{value:.5g}" for value in _clean(reaction[:3])), "N")
        table.add_row(f"{name}: moment", "  ".join(f"{value:.5g}" for value in _clean(reaction[3:])), "N m")
    for handle in simulation.scene.handles:
        if handle.section == "bodies":
            shift = simulation.handle_pose(handle.name).translation
            table.add_row(f"{handle.name}: moved by", "  ".join(f"{value:.5g}" for value in shift), "m")
    if last.contacts:
        for name, force in total_forces(contact_points(last.contacts), simulation.scene.handles).items():
            table.add_row(f"{name}: total force on it", "  ".join(f"{value:.5g}" for value in force), "N")


def _clean(values: object) -> list[float]:
    """Return values with rounding noise set to zero."""
    largest = max(abs(float(value)) for value in values)
    return [0.0 if abs(float(value)) < 1e-9 * largest else float(value) for value in values]


def write_result(
    path: Path, simulation: Simulation, result: StepResult, *, steps: int, wall_time: float, whole: bool = True
) -> None:
    """Write positions, element fields, reactions and metadata, in SI units.

    Keys: ``X, x`` (n, 3) undeformed and current vertices [m]; ``cells`` (m, 8 or 4); ``eps_eq, J, omega`` (m,);
    ``energy`` [J]; ``reaction_<handle>`` (6,) force [N] and moment [N m] of the handle on the body, the moment about
    the handle's deformed centre; ``actuator_<name>`` (3,) command, extent and effort; ``probe_<name>`` (3,) position
    [m]; ``meta``: JSON text, with ``converged``, and ``whole``: whether the program was not interrupted.

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
    with replacing(path) as written, written.open("wb") as file:
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


def _draw(path: Path, simulation: Simulation, result: StepResult) -> None:
    from gdfe_ros.analysis.picture import draw_body  # matplotlib takes a second to import
    from gdfe_ros.analysis.scenery import Scenery

    title = f"{simulation.scene.name} at t = {result.time:g} s" + ("" if result.converged else ", not converged")
    words = {"title": title, "label": "equivalent strain", "scenery": Scenery.of(simulation)}
    draw_body(path, simulation.mesh, result.positions, simulation.fields().eps_eq, **words)
