# SPDX-License-Identifier: Apache-2.0
"""Inverse control on circles: time of a move, and how far from the circle a plant goes that is told the commands alone.

``python -m benchmarks.control`` prints a table. Times are those of the processor, one thread. The plant is a
simulation of its own with the model's modulus.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from rich.console import Console
from rich.table import Table

from gdfe_ros import Command, Simulation, load_scene
from gdfe_ros.control import InverseControl, Target

RATE = 50.0
"""Moves a second."""


@dataclass(frozen=True, kw_only=True)
class Circle:
    """A circle inside a robot's workspace.

    Attributes:
        scene: its name.
        middle: commands at its middle.
        targets: what is led.
        first, second: coordinates of the circle, each as target and axis.
        radius: [m].
    """

    scene: str
    middle: Mapping[str, float]
    targets: Sequence[Target]
    first: tuple[int, int]
    second: tuple[int, int]
    radius: float

    def goals(self, middle: np.ndarray, turn: float) -> np.ndarray:
        """Return goals (t, 3) [m] after a share of a ``turn``, around ``middle`` (t, 3) [m]."""
        goals, angle = middle.copy(), 2.0 * np.pi * turn
        goals[self.first] += self.radius * np.cos(angle)
        goals[self.second] += self.radius * np.sin(angle)
        return goals

    def distance(self, simulation: Simulation, goals: np.ndarray) -> float:
        """Return how far [m] a simulation is from goals (t, 3) [m]."""
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
"""The gripper's fingers have a tendon each: the circle is that of two of them, one a coordinate."""


@dataclass(frozen=True, kw_only=True)
class Followed:
    """How a circle was followed.

    Attributes:
        times: processor time [s] of each move.
        errors: distance [m] of the plant from the circle after each move.
        radius: [m].
    """

    times: Sequence[float]
    errors: Sequence[float]
    radius: float

    def row(self) -> list[str]:
        """Return median and 95th percentile [ms], and mean and largest error over the radius [%]."""
        times, errors = 1e3 * np.array(self.times), 100.0 * np.array(self.errors) / self.radius
        numbers = statistics.median(times), np.percentile(times, 95), errors.mean(), errors.max()
        return [f"{number:.2f}" for number in numbers]


def follow(circle: Circle, *, rounds: int, period: float) -> Followed:
    """Lead a model round a circle, and a plant by the commands that come of it.

    Args:
        circle: what to follow.
        rounds: how often.
        period: time of a round [s].
    """
    scene, moves = load_scene(circle.scene), round(period * RATE)
    model, plant = Simulation(scene), Simulation(scene)
    for simulation in (model, plant):
        simulation.step(Command(actuators=circle.middle))
    places = model.probe_positions()
    middle = np.array([places[target.probe] for target in circle.targets])
    control = InverseControl(model, circle.targets)
    found = control.reach(circle.goals(middle, 0.0))
    if not found.reached:
        raise RuntimeError(f"{circle.scene}: the circle begins out of reach: {found.message}")
    times, errors = [], []
    for number in range(rounds * moves):
        goals, before = circle.goals(middle, (number + 1) / moves), time.process_time()
        found = control.move(goals, 1.0 / RATE)
        times.append(time.process_time() - before)
        plant.step(Command(actuators=found.commands))
        errors.append(circle.distance(plant, goals))
    return Followed(times=times, errors=errors, radius=circle.radius)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description="Inverse control on circles.")
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--period", type=float, default=2.0, help="of a round [s]")
    given = parser.parse_args(arguments)
    table = Table(title=f"circles of {given.period:g} s, {given.rounds} rounds, {RATE:g} moves a second")
    for column in ("robot", "radius [mm]", "move [ms]", "95 % [ms]", "mean error [%]", "largest [%]"):
        table.add_column(column, justify="left" if column == "robot" else "right")
    for circle in CIRCLES:
        found = follow(circle, rounds=given.rounds, period=given.period)
        table.add_row(circle.scene, f"{1e3 * circle.radius:g}", *found.row())
    Console(width=110).print(table)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
