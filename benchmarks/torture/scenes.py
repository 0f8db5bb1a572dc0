# SPDX-License-Identifier: Apache-2.0
"""Group 8: the shipped robots, commanded to both ends of their ranges in single steps, and released."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from benchmarks.torture.bodies import Driver, distance
from benchmarks.torture.case import Case, Finding, Group
from gdfe_ros.scene import load_scene
from gdfe_ros.scene.scene import Scene
from gdfe_ros.solver.settings import Policy

TOLERANCE = 1e-6
BOUND = 1e-3
"""Largest distance between the neutral states of two load paths, divided by the body's size. It is above the tolerance:
the robots' thin walls are far softer than their cells, and the tolerance applies to an estimate.
"""
LET_GO = 100.0
"""Duration of a step [s], long enough for every rate limit."""
ROBOTS = {
    "tendon_finger": ("flexor", "extensor", "all"),
    "gripper": ("left", "all"),
    "shape_memory_strip": ("heat",),
    "three_chamber_arm": ("left", "all"),
    "pneunet": ("air",),
}
"""Dict from scene to the actuators that are commanded to both ends of their ranges."""


def _scene(name: str) -> Scene:
    scene = load_scene(name)
    return replace(scene, solver=replace(scene.solver, tolerance=TOLERANCE, max_iterations=20000))


def _commands(scene: Scene, driven: str, neutral: dict[str, float]) -> list[dict[str, float]]:
    """Return the commands at the upper and at the lower ends of the ranges of the chosen actuators."""
    chosen = [item for item in scene.actuators if driven in ("all", item.name)]
    return [{**neutral, **{item.name: end(item) for item in chosen}} for end in (lambda i: i.high, lambda i: i.low)]


def _thrown(name: str, driven: str) -> Finding:
    """Command both ends and then the neutral state; return the distance from the state of a body that never moved."""
    scene = _scene(name)
    driver, still = Driver(scene), Driver(scene)
    neutral = {item.name: driver.neutral[item.name] for item in scene.actuators}
    expected = still.step(actuators=neutral).positions
    for command in _commands(scene, driven, neutral):
        driver.step(actuators=command, dt=LET_GO)
    result = driver.step(actuators=neutral, dt=LET_GO)
    error = distance(result.positions, expected, scene.mesh.size)
    remarks = [step.message for step in driver.results if step.message]
    return Finding(tuple(driver.results), error, driver.rise, tuple(remarks))


def _weightless(name: str) -> Finding:
    """Apply ten times the weight in both directions and then the weight; return the distance from the first state."""
    scene = _scene(name)
    driver, still = Driver(scene), Driver(scene)
    expected = still.step().positions
    for factor in (10.0, -10.0, 1.0):
        result = driver.step(loads={load.name: factor for load in scene.loads})
    return Finding(tuple(driver.results), distance(result.positions, expected, scene.mesh.size), driver.rise)


def cases() -> list[Case]:
    """Return the cases with shipped robots."""
    case = partial(Case, group=Group.ACTUATORS, policy=Policy.ENERGY, law="its own", bound=BOUND)
    found = []
    for name, driven in ROBOTS.items():
        for what in driven:
            found.append(case(name=f"{name}: {what} from end to end, let go", run=partial(_thrown, name, what)))
    for name in ("tendon_finger", "three_chamber_arm"):
        found.append(case(name=f"{name}: ten times its weight, both ways", run=partial(_weightless, name)))
    return found
