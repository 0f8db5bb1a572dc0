# SPDX-License-Identifier: Apache-2.0
"""One loop for every body: few iterations, and a distance to the equilibrium that is true."""

from __future__ import annotations

from dataclasses import replace
from itertools import islice
from typing import Any

import numpy as np
import pytest

from gdfe_ros import Command, Pose, Simulation, load_scene
from test.written import advance, scene_of

STRIP = """
mesh: {bar: {size: [0.2, 0.02, 0.001], cells: [40, 4, 1]}}
materials: {m: {law: neo_hookean, young: 1.0e5, poisson: 0.45, density: 1000}}
handles: {base: {where: {face: x-}, fixed: true}, tip: {where: {face: x+}}}
solver: {tolerance: 1.0e-4, max_iterations: 20000}
"""
TUBE = """
mesh: {tube: {inner: 0.009, outer: 0.010, length: 0.08, cells: [1, 20, 24], cap: 0.004}}
materials: {m: {law: neo_hookean, young: 6.0e5, poisson: 0.45}}
handles: {left: {where: {face: x-}, fixed: true}, right: {where: {face: x+}, fixed: true}}
actuators: {air: {chamber: {command: pressure}}}
"""
MEMBRANE = """
mesh: {bar: {size: [0.06, 0.06, 0.001], cells: [20, 20, 1]}}
materials: {m: {law: neo_hookean, young: 6.0e5, poisson: 0.45}}
handles: {rim: {where: {any: [{face: x-}, {face: x+}, {face: y-}, {face: y+}]}, fixed: true}}
loads: {p: {surface: {where: {face: z-}, traction: [0, 0, 1]}}}
"""
CANTILEVER = """
mesh: {bar: {size: [1.0, 0.1, 0.003], cells: [6, 2, 2]}}
materials: {m: {law: neo_hookean, young: 8.0e5, poisson: 0.45, density: 1100}}
handles: {base: {where: {face: x-}, fixed: true}}
loads: {weight: {gravity: [0, 0, -9.81]}}
"""
CONTRAST = """
mesh: {bar: {size: [0.2, 0.04, 0.04], cells: [16, 4, 4]}}
materials:
  soft: {law: neo_hookean, young: 1.0e3, poisson: 0.45}
  stiff: {law: neo_hookean, young: 1.0e8, poisson: 0.45}
regions: [{material: soft}, {material: stiff, where: {box: {x: [0.08, 0.12]}}}]
handles: {base: {where: {face: x-}, fixed: true}, tip: {where: {face: x+}}}
"""
COARSE = """
mesh: {bar: {size: [1.0, 0.1, 0.01], cells: [6, 2, 2]}}
materials: {m: {law: neo_hookean, young: 8.0e5, poisson: 0.45, density: 1100}}
handles: {base: {where: {face: x-}, fixed: true}}
loads: {weight: {gravity: [0, 0, -9.81]}}
solver: {tolerance: 1.0e-2}
"""
SHEET = """
mesh: {bar: {size: [0.2, 0.2, 0.0005], cells: [12, 12, 1]}}
materials: {m: {law: neo_hookean, young: 1.0e5, poisson: 0.45}}
handles: {base: {where: {face: x-}, fixed: true}, tip: {where: {face: x+}}}
solver: {tolerance: 1.0e-3}
"""
SHELL = """
mesh: {sphere: {inner: 0.049, outer: 0.05, cells: [8, 1]}}
materials: {m: {law: neo_hookean, young: 1.0e5, poisson: 0.45}}
handles: {base: {where: {box: {x: [-1.0, -0.045]}}, fixed: true}}
actuators: {air: {chamber: {cavity: 0, command: volume}}}
"""
CRUMPLING = ((0.0, 0.05, 0.0), (0.05, 0.0, 0.0), (-0.02, 0.0, 0.01), (0.1, 0.0, 0.0), (0.0, 0.0, 0.0))


def true_errors(text: str, commands: list[Command]) -> list[float]:
    """Return the distance of each step to the same step solved to 1e-9, divided by tolerance and size."""
    simulation, errors = Simulation(scene_of(text)), []
    settings = replace(simulation.settings, tolerance=1e-9, max_iterations=20000)
    fine = Simulation(scene_of(text), settings=settings)
    size, tolerance = simulation.stepper.body.size, simulation.settings.tolerance
    for command in commands:
        result = advance(simulation, command)
        fine.restore(simulation.snapshot())
        exact = advance(fine, command)
        apart = np.linalg.norm(result.positions - exact.positions, axis=1).max()
        errors.append(float(apart) / (size * tolerance))
    return errors


@pytest.mark.parametrize(
    ("text", "commands"),
    [
        (STRIP, [Command(handles={"tip": Pose((0.0, 0.0, z))}) for z in np.linspace(0.0, 0.02, 11)[1:]]),
        (STRIP, [Command(handles={"tip": Pose((-x, 0.0, 0.0))}) for x in np.linspace(0.0, 0.02, 9)[1:]]),
        (TUBE, [Command(actuators={"air": -p}) for p in np.linspace(0.0, 4e3, 9)[1:]]),
        (MEMBRANE, [Command(loads={"p": p}) for p in np.linspace(0.0, 3e3, 6)[1:]]),
        (CANTILEVER, [Command(loads={"weight": w}) for w in (0.6, -0.4, 1.4, 0.2, 1.0, -0.9)]),
        (COARSE, [Command(loads={"weight": w}) for w in (0.59, -0.33, -0.9, -0.96, 1.03, 1.28)]),
        (SHEET, [Command(handles={"tip": Pose(way)}) for way in CRUMPLING]),
        (SHELL, [Command(actuators={"air": v * 4.0 / 3.0 * np.pi * 0.049**3}) for v in (1.1, 2.0, 5.0)]),
        (CONTRAST, [Command(handles={"tip": Pose((x, 0.0, z))}) for x, z in ((0.0, 0.1), (-0.05, 0.0), (0.0, 0.0))]),
    ],
    ids=[
        *("strip", "pushed strip", "tube under vacuum", "membrane", "cantilever"),
        *("hanging bar", "crumpled sheet", "shell of given volume", "stiff middle"),
    ],
)
def test_thin_bodies_are_where_they_say(text: str, commands: list[Command]) -> None:
    """Converged steps of thin bodies and of a bar with a stiff middle are within one tolerance of the equilibrium."""
    assert max(true_errors(text, commands)) <= 1.0


def test_a_stream_is_where_it_says() -> None:
    """Each step of a stream whose pressure keeps growing is within one tolerance of the equilibrium."""
    scene = load_scene("pneunet")
    simulation = Simulation(scene)
    fine = Simulation(scene, settings=replace(scene.solver, tolerance=1e-3 * scene.solver.tolerance))
    for result in islice(simulation.play(400), 31):
        fine.restore(simulation.snapshot())
        exact = advance(fine, dt=0.0)
        assert result.converged
        apart = np.linalg.norm(result.positions - exact.positions, axis=1).max() / scene.solver.tolerance
        assert apart <= simulation.stepper.body.size


@pytest.mark.parametrize(
    ("name", "overrides", "most"),
    [
        ("bend5", {}, 30),
        ("bend5", {"mesh.bar.cells": [10, 1, 1]}, 30),
        ("twist90", {}, 40),
        ("twist90_uniform", {}, 40),
        ("tensile", {}, 80),
    ],
)
def test_bars_take_few_iterations(name: str, overrides: dict[str, Any], most: int) -> None:
    """One step of a bar from rest to the full command takes a quarter of the iterations with the constant matrix."""
    simulation = Simulation(load_scene(name, overrides=overrides))
    (result,) = simulation.play(1)
    assert result.converged
    assert result.iterations <= most
