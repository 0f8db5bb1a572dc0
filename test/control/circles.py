# SPDX-License-Identifier: Apache-2.0
"""Circles inside the workspaces of robots, and robots whose moduli differ from the model's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from gdfe_ros import Command, Simulation, load_scene
from gdfe_ros.control import FeedbackControl, Target

APPROACH = 40
"""Number of commands before a circle."""


@dataclass(frozen=True, kw_only=True)
class Circle:
    """A circle inside a robot's workspace.

    Attributes:
        scene: name of the robot's scene.
        middle: dict from actuator to the command at the circle's centre.
        targets: controlled targets.
        first, second: coordinates of the circle, each as index of a target and axis.
        radius: radius [m].
        tolerance: solver tolerance of a robot whose modulus differs from the model's. It is small compared with the
            radius divided by the body's size.
    """

    scene: str
    middle: Mapping[str, float]
    targets: Sequence[Target]
    first: tuple[int, int]
    second: tuple[int, int]
    radius: float
    tolerance: float = 1e-4

    def goals(self, middle: np.ndarray, turn: float) -> np.ndarray:
        """Return the goals (t, 3) [m] after ``turn`` revolutions around ``middle`` (t, 3) [m]."""
        goals, angle = middle.copy(), 2.0 * np.pi * turn
        goals[self.first] += self.radius * np.cos(angle)
        goals[self.second] += self.radius * np.sin(angle)
        return goals

    def distance(self, simulation: Simulation, goals: np.ndarray) -> float:
        """Return the distance [m] of a simulation's targets from the goals (t, 3) [m]."""
        places, parts = simulation.probe_positions(), []
        for target, goal in zip(self.targets, goals, strict=True):
            parts.append((places[target.probe] - goal)[list(target.axes)])
        return float(np.linalg.norm(np.concatenate(parts)))


CIRCLES = (
    Circle(
        scene="tendon_finger",
        middle={"flexor": 5.0, "extensor": 15.0},
        targets=[Target(probe="tip", axes=(0, 2))],
        first=(0, 0),
        second=(0, 2),
        radius=5e-4,
        tolerance=1e-5,
    ),
    Circle(
        scene="three_chamber_arm",
        middle={"left": 12e3, "right": 12e3, "upper": 12e3},
        targets=[Target(probe="tip", axes=(1, 2))],
        first=(0, 1),
        second=(0, 2),
        radius=5e-3,
    ),
    Circle(
        scene="gripper",
        middle={"left": 3e-3, "right": 3e-3, "upper": 2e-3},
        targets=[Target(probe="left_tip", axes=(1,)), Target(probe="right_tip", axes=(1,))],
        first=(0, 1),
        second=(1, 1),
        radius=3e-3,
    ),
)
"""Circles of three robots. For the gripper, each of two fingertips is one coordinate of the circle."""


def robot(circle: Circle, modulus: float = 1.0) -> Simulation:
    """Return the robot at the commands of the circle's centre; ``modulus`` is a factor on the scene's moduli."""
    materials = load_scene(circle.scene).materials
    changes = {f"materials.{name}.young": modulus * material.young for name, material in materials.items()}
    changes["solver.tolerance"] = circle.tolerance
    simulation = Simulation(load_scene(circle.scene, overrides={} if modulus == 1.0 else changes))
    simulation.step(Command(actuators=circle.middle))
    return simulation


def measured(circle: Circle, simulation: Simulation) -> np.ndarray:
    """Return the present positions (t, 3) [m] of the probes."""
    places = simulation.probe_positions()
    return np.array([places[target.probe] for target in circle.targets])


def closed_loop(circle: Circle, modulus: float, *, moves: int, rounds: float) -> float:
    """Move a plant, whose moduli are ``modulus`` times the model's, along the model's circle with `FeedbackControl`.

    The commands begin `APPROACH` steps before the circle.

    Returns:
        Mean distance of the plant from its goals on the circle, divided by the radius.
    """
    model, plant = robot(circle), robot(circle, modulus)
    middle, control, errors = measured(circle, model), FeedbackControl(model, circle.targets), []
    for number in range(-APPROACH, round(rounds * moves)):
        goals = circle.goals(middle, max(number + 1, 0) / moves)
        control.observe(measured(circle, plant))
        plant.step(Command(actuators=control.command(goals, 0.02).commands))
        errors.append(circle.distance(plant, goals))
    return float(np.mean(errors[APPROACH:])) / circle.radius
