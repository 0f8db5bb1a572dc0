# SPDX-License-Identifier: Apache-2.0
"""Scenes and programs that are written in a test; keyword arguments override keys, ``__`` stands for a dot."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from gdfe_ros import Command, Simulation
from gdfe_ros.results.step_result import StepResult
from gdfe_ros.scene import Scene, scene_from_text

ROOT = Path(__file__).parents[1]
STRIP = """\
mesh:
  bar:
    size: [0.1, 0.02, 0.02]
    cells: [10, 4, 4]
    cut: [{box: {x: [0.01, 0.09], y: [-0.005, 0.005], z: [-0.005, 0.005]}}]
materials: {m: {law: neo_hookean, young: 1.0e6, poisson: 0.45}}
handles: {base: {where: {face: x-}, fixed: true}}
actuators:
  wire: {cable: {points: [[0, 0, 0.008], [0.05, 0, 0.008], [0.1, 0, 0.008]], command: shortening, range: [-0.05, 0.05]}}
  air: {chamber: {near: [0.05, 0, 0], command: volume}}
"""
"""A strip with a cavity of air and a cable beside it."""


def scene_of(text: str, overrides: Mapping[str, Any] | None = None, **keys: Any) -> Scene:
    """Return the scene of a text; without the key ``regions``, its first material is everywhere."""
    name = "" if re.search("^name:", text, re.M) else "name: body\n"
    material = re.search(r"^materials:\s*\{?\s*(\w+):", text, re.M)
    regions = f"\nregions: [{{material: {material[1]}}}]" if material and "\nregions:" not in text else ""
    given = {**(overrides or {}), **{key.replace("__", "."): value for key, value in keys.items()}}
    return scene_from_text(f"{name}{text}{regions}", overrides=given)


def simulate(text: str, **overrides: Any) -> Simulation:
    """Return a simulation of the scene of a text."""
    return Simulation(scene_of(text, **overrides))


def advance(simulation: Simulation, *command: Command, count: int = 1, **options: Any) -> StepResult | None:
    """Make equal steps, each of which must converge; return the last result."""
    result = None
    for _ in range(count):
        result = simulation.step(*command, **options)
        assert result.converged, result.message
    return result


def trace(
    simulation: Simulation, count: int, measure: Callable[[StepResult], Any], *command: Command, **options: Any
) -> np.ndarray:
    """Make equal steps, each of which must converge; return an array of ``measure`` of each result."""
    return np.array([measure(advance(simulation, *command, **options)) for _ in range(count)])


def run_python(code: str, *arguments: Any, **environment: Any) -> subprocess.CompletedProcess[str]:
    """Run code in a fresh process that imports this package from here; return its status and output."""
    env = {**os.environ, "PYTHONPATH": str(ROOT), **{name: str(value) for name, value in environment.items()}}
    command = [sys.executable, "-c", code, *map(str, arguments)]
    return subprocess.run(command, env=env, capture_output=True, text=True, timeout=300, check=False)
