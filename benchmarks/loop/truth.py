# SPDX-License-Identifier: Apache-2.0
"""True errors of converged steps, in tolerances, against finer solves of the same code.

The positions of both are written to a file, for `benchmarks.loop.newton` to check the finer ones. Where it cannot,
further fine solves begin `PUSH` tolerances beside the first one, and have to return to it. If they do not, it has not
converged, whatever it says, or it is no minimum.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.loop.playing import Player, find_distance, list_commands, make_bumps, make_simulation
from gdfe_ros import Command, Simulation
from gdfe_ros.errors import GdfeError

if TYPE_CHECKING:
    from gdfe_ros.results.step_result import StepResult

PUSH = 2.0
"""Displacement from which a fine solve is repeated, in tolerances."""
AGREE = 0.1
"""Largest distance between two fine solves of the same equilibrium, in tolerances."""
CHECKED = 5
"""Number of steps of a stream whose finer solves are checked."""
COARSER = 100.0
"""Factor of the fine tolerance at the second attempt, if a fine solve has not converged."""


def measure_each(task: Mapping[str, Any], fine: float, bends: float | None, path: str, push: bool) -> dict[str, Any]:
    """Make a task's steps, and continue each converged one at a fine tolerance.

    Args:
        task: request of a task.
        fine: fine tolerance, divided by the task's.
        bends: displacement across x from which the last state counts as bent, divided by the size; None: not counted.
        path: file for the positions (n, 3) [m] after each converged step and its finer solve, and for the tensions [N]
            and pressures [Pa] of all actuators there.
        push: whether the finer solves of the middle and of the last step are checked by pushing.
    """
    simulation = make_simulation(task)
    tolerance, size = simulation.settings.tolerance, float(simulation.mesh.size)
    exact = [make_simulation(task, tolerance=tolerance * fine * factor, patient=True) for factor in (1.0, COARSER)]
    orders, steps, spent, places = list_commands(task, simulation), [], 0.0, {}
    checked = {len(orders) // 2, len(orders) - 1} if push else set()
    simulation.warm_up()
    began = time.process_time()
    for number, (command, duration) in enumerate(orders):
        started = time.process_time()
        result = simulation.step(command, dt=duration)
        seconds = time.process_time() - started
        spent += seconds
        step = {"seconds": seconds, "iterations": result.iterations, "converged": bool(result.converged)}
        step |= {"stable": result.stable, "estimate": result.error_estimate / tolerance, "message": result.message[:80]}
        if result.converged:
            truth, judged = _judge(exact, simulation, (command, duration), number in checked)
            step |= judged
            for kind, each in (("found", result), ("truth", truth)):
                if each is not None:
                    _keep_place(places, kind, number, each)
        steps.append(step)
        if time.process_time() - began > task["limit"]:
            break
    whole = time.process_time() - began
    np.savez(path, **places)
    across = float(np.abs(simulation.positions - simulation.mesh.vertices)[:, 1:].max()) / size
    ends = {} if bends is None else {"bent": int(across > bends)}
    return {**ends, "seconds": spent, "whole": whole, "unit": tolerance, "given": len(orders), "each": steps}


def _judge(
    exact: Sequence[Simulation], simulation: Simulation, order: tuple[Command, float | None], check: bool
) -> tuple[StepResult | None, dict[str, Any]]:
    """Continue the last step with each of the simulations ``exact`` until one converges; return its result."""
    command, duration = order
    tolerance, size = simulation.settings.tolerance, float(simulation.mesh.size)
    snapshot, found = simulation.snapshot(), simulation.positions.copy()
    for finer in exact:
        finer.restore(snapshot)
        truth = finer.step(command, dt=0.0 if duration is not None else None)
        if truth.converged:
            error = find_distance(truth.positions, found) / size
            checks = _push(finer, truth, command, size * tolerance) if check else {}
            return truth, {"error": error / tolerance, "fine iterations": truth.iterations, **checks}
    return None, {"flaw": f"the fine solve did not converge: {truth.message[:60]}"}


def _push(finer: Simulation, truth: StepResult, command: Command, unit: float) -> dict[str, Any]:
    """Repeat a fine solve from pushed places; return whether all came back, and the farthest end in tolerances."""
    snapshot, farthest = finer.snapshot(), 0.0
    for bump in make_bumps(finer, PUSH * unit):
        finer.restore(snapshot)
        try:
            finer.set_positions(truth.positions + bump)
        except GdfeError:
            continue
        again = finer.step(command)
        if again.converged:
            farthest = max(farthest, find_distance(again.positions, truth.positions) / unit)
    finer.restore(snapshot)
    return {"verified": farthest <= AGREE, "returns": farthest}


def measure_path(task: Mapping[str, Any], fine: float, path: str) -> dict[str, dict[str, Any]]:
    """Play a task at its own and at a fine tolerance; return the errors of the converged steps of each part.

    With dynamics, errors add up along the path; the error is that of the path, divided by the size, under ``path``.

    Args:
        task: request of a task.
        fine: fine tolerance, divided by the task's.
        path: file for the positions of some steps at the fine tolerance, as in `measure_each`; empty with dynamics.
    """
    player = Player(task)
    tolerance, size = player.simulation.settings.tolerance, float(player.simulation.mesh.size)
    exact = Player(task, tolerance=tolerance * fine)
    moves, figures, places = player.simulation.scene.dynamics is not None, {}, {}
    played, true = player.play(), exact.play()
    for name, part in played.items():
        pairs = list(zip(part["results"], true[name]["results"], strict=True))
        judged = [(found, truth) for found, truth in pairs if found.converged and truth.converged]
        errors = [find_distance(found.positions, truth.positions) / size for found, truth in judged]
        own = {"unconverged": part["unconverged"], "judged": len(judged), "unit": tolerance}
        own["unjudged"] = len(pairs) - part["unconverged"] - len(judged)
        own |= {"path": max(errors, default=None)} if moves else _in_tolerances(errors, tolerance)
        figures[name] = own
        for number in range(len(pairs) - 1, -1, -max(len(pairs) // CHECKED, 1)):
            if pairs[number][1].converged and not moves:
                _keep_place(places, "truth", part["first"] + number, pairs[number][1])
    np.savez(path, **places)
    return figures


def _in_tolerances(errors: Sequence[float], tolerance: float) -> dict[str, Any]:
    """Return the largest of some errors in tolerances, and how many are beyond one."""
    largest = max(errors, default=None)
    return {
        "error": None if largest is None else largest / tolerance,
        "beyond": sum(error > tolerance for error in errors),
    }


def _keep_place(places: dict[str, Any], kind: str, number: int, result: StepResult) -> None:
    """Add the positions [m] and the actuators' efforts after a step to the arrays of a file."""
    places[f"{kind} {number}"] = result.positions
    places[f"efforts {kind} {number}"] = [state.effort for state in result.actuators.values()]
