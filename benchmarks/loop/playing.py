# SPDX-License-Identifier: Apache-2.0
"""Steps of a task, made through the public interface only, so that any commit of the package can make them."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from gdfe_ros import Command, Pose, Simulation, load_scene
from gdfe_ros.scene.loader import scene_from_text

MOST = 20000
"""Largest number of iterations of a step at a fine tolerance."""
SMALL = 1e-10
"""Time [s] below which two moments are the same."""


def make_simulation(task: Mapping[str, Any], *, tolerance: float | None = None, patient: bool = False) -> Simulation:
    """Return the simulation of a task.

    Args:
        task: request of a task.
        tolerance: tolerance that replaces the task's.
        patient: whether steps may take many iterations, and none is skipped.
    """
    text, overrides = task["text"], task["overrides"]
    scene = scene_from_text(text, overrides=overrides) if text else load_scene(task["scene"], overrides=overrides)
    changed: dict[str, Any] = {}
    wanted = tolerance or task["tolerance"]
    if wanted:
        changed["tolerance"] = wanted
    if patient:
        changed |= {"max_iterations": MOST, "skip": ()}
    return Simulation(scene, settings=replace(scene.solver, **changed))


def read_command(given: Mapping[str, Any]) -> Command:
    """Return the command of a JSON object; a pose is a pair of translation and rotation vector."""
    handles = {name: Pose(tuple(shift), tuple(turn)) for name, (shift, turn) in given.get("handles", {}).items()}
    return Command(handles=handles, actuators=given.get("actuators", {}), loads=given.get("loads", {}))


def list_commands(task: Mapping[str, Any], simulation: Simulation) -> list[tuple[Command, float | None]]:
    """Return all commands of a task with the durations of their steps [s]."""
    if task["commands"]:
        return [(read_command(given), None) for given in task["commands"]]
    program, found, before = simulation.scene.program, [], 0.0
    for moment in program.moments(task["total"]):
        poses, values, factors = (
            program.handle_poses(moment),
            program.actuator_values(moment),
            program.load_factors(moment),
        )
        found.append((Command(poses, values, factors, joints=program.joint_positions(moment)), moment - before))
        before = moment
    return found


class Player:
    """A task's simulation, which plays the parts of its program again and again.

    Args:
        task: request of a task.
        tolerance: tolerance that replaces the task's.
    """

    def __init__(self, task: Mapping[str, Any], *, tolerance: float | None = None) -> None:
        started = time.process_time()
        self.simulation = make_simulation(task, tolerance=tolerance)
        self.setup = time.process_time() - started
        self._commands = list_commands(task, self.simulation)
        whole = {"": (0, len(self._commands))}
        self._parts: Mapping[str, Any] = whole if task["commands"] else task["parts"]
        self._starts: dict[str, Any] = {}

    def play(self) -> dict[str, dict[str, Any]]:
        """Play every part from its first state; return a dict from part to its figures and positions."""
        done, found = 0, {}
        for name, (first, last) in self._parts.items():
            if not first:
                self.simulation.reset()
            elif name in self._starts:
                self.simulation.restore(self._starts[name])
            else:
                self._bridge(done, first)
                self._starts[name] = self.simulation.snapshot()
            found[name] = _make_steps(self.simulation, self._commands[first:last]) | {"first": first}
            done = last
        return found

    def _bridge(self, done: int, first: int) -> None:
        """Make the steps between two parts, ``done`` of which are made; from the start if there are none."""
        if not done:
            self.simulation.reset()
        for command, duration in self._commands[done:first]:
            self.simulation.step(command, dt=duration)


def _make_steps(simulation: Simulation, commands: list[tuple[Command, float | None]]) -> dict[str, Any]:
    """Make steps; return their figures, and under ``paths`` their results."""
    started, results = time.process_time(), []
    for command, duration in commands:
        results.append(simulation.step(command, dt=duration))
    seconds = time.process_time() - started
    return {
        "seconds": seconds,
        "steps": len(results),
        "simulated": sum(duration or 0.0 for _, duration in commands),
        "iterations": sum(result.iterations for result in results),
        "unconverged": sum(not result.converged for result in results),
        "digest": hashlib.sha256(results[-1].positions.tobytes()).hexdigest()[:16],
        "results": results,
    }


def drop_results(found: Mapping[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
    """Return the figures of parts without their results, for JSON."""
    return {name: {key: part[key] for key in part if key != "results"} for name, part in found.items()}


def find_distance(first: np.ndarray, second: np.ndarray) -> float:
    """Return the largest distance between the same vertex of two states [m]."""
    return float(np.linalg.norm(first - second, axis=1).max())


def make_bumps(simulation: Simulation, size: float) -> Iterator[np.ndarray]:
    """Yield displacements of a length of about ``size`` [m]: waves along x and y in both directions, and noise.

    The waves vanish at both ends along x, where most bodies are held.
    """
    rest = simulation.mesh.vertices
    along, across = ((rest - rest.min(axis=0)) / np.ptp(rest, axis=0)).T[:2]
    wave, double = np.sin(np.pi * along), np.sin(2.0 * np.pi * along)
    for axis in (2, 1):
        for shape in (wave, double, wave * np.cos(np.pi * across), wave * np.sin(np.pi * across)):
            moved = np.zeros_like(rest)
            moved[:, axis] = size * shape
            yield moved
    yield 0.2 * size * np.random.default_rng(1).normal(size=rest.shape)
