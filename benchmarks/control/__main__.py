# SPDX-License-Identifier: Apache-2.0
"""Inverse control on circles: open loop, open loop in real time, and closed loop with a wrong modulus.

``python -m benchmarks.control`` prints a table for each kind of control. Errors are those of the plant, a separate
simulation that receives only the commands. In real time, the goals move with the wall clock, even if the model is not
ready.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.control.circles import CIRCLES, Circle, measured, robot
from gdfe_ros import Command, Simulation
from gdfe_ros.control import FeedbackControl, InverseControl, RealTimeControl

RATE = 50.0
"""Rate of the commands [1/s]."""
WRONG = (0.7, 1.3)
"""Ratios of the plant's moduli to the model's, for closed-loop control."""
APPROACH = 40
"""Number of commands before the circle starts, for closed-loop control."""


@dataclass(frozen=True, kw_only=True)
class Followed:
    """Result of following a circle.

    Attributes:
        times: time of each command [s]: processor time; for real time, wall time.
        errors: distance of the plant from its goals after each command [m].
        radius: radius of the circle [m].
        solves: number of the model's equilibria per command.
    """

    times: Sequence[float]
    errors: Sequence[float]
    radius: float
    solves: float = 1.0

    @property
    def error(self) -> float:
        """Mean error divided by the radius."""
        return float(np.mean(self.errors)) / self.radius

    def row(self) -> list[str]:
        """Return median, 95th percentile and maximum of the times [ms]; mean and largest error / radius [%]."""
        times, errors = 1e3 * np.array(self.times), 100.0 * np.array(self.errors) / self.radius
        numbers = statistics.median(times), np.percentile(times, 95), max(times), errors.mean(), errors.max()
        return [f"{number:.2f}" for number in numbers]


def open_loop(circle: Circle, *, moves: int, rounds: float) -> Followed:
    """Move a model along a circle with `InverseControl.move`, and a plant with the resulting commands."""
    model, plant = robot(circle), robot(circle)
    middle, control = measured(circle, model), InverseControl(model, circle.targets)
    _begin(control, circle, middle)
    times, errors = [], []
    for number in range(round(rounds * moves)):
        goals, before = circle.goals(middle, (number + 1) / moves), time.process_time()
        found = control.move(goals, 1.0 / RATE)
        times.append(time.process_time() - before)
        errors.append(_error(circle, plant, found.commands, goals))
    return Followed(times=times, errors=errors, radius=circle.radius)


def real_time(circle: Circle, *, moves: int, rounds: float) -> Followed:
    """Compute commands at the wall clock's rate with `RealTimeControl`, then simulate the plant with them."""
    model = robot(circle)
    middle = measured(circle, model)
    _begin(InverseControl(model, circle.targets), circle, middle)
    times, given = [], []
    with RealTimeControl(model, circle.targets) as control:
        began, count = time.perf_counter(), round(rounds * moves)
        for number in range(count):
            time.sleep(max(0.0, began + number / RATE - time.perf_counter()))
            goals, before = circle.goals(middle, (number + 1) / moves), time.perf_counter()
            given.append((goals, control.command(goals, 1.0 / RATE).commands))
            times.append(time.perf_counter() - before)
    plant = robot(circle)
    errors = [_error(circle, plant, commands, goals) for goals, commands in given]
    return Followed(times=times, errors=errors, radius=circle.radius, solves=control.solves / count)


def closed_loop(circle: Circle, modulus: float, *, moves: int, rounds: float) -> Followed:
    """Move a plant, whose moduli are ``modulus`` times the model's, along the model's circle with `FeedbackControl`."""
    model, plant = robot(circle), robot(circle, modulus)
    middle, control = measured(circle, model), FeedbackControl(model, circle.targets)
    times, errors = [], []
    for number in range(-APPROACH, round(rounds * moves)):
        goals, before = circle.goals(middle, max(number + 1, 0) / moves), time.process_time()
        control.observe(measured(circle, plant))
        found = control.command(goals, 1.0 / RATE)
        times.append(time.process_time() - before)
        errors.append(_error(circle, plant, found.commands, goals))
    return Followed(times=times[APPROACH:], errors=errors[APPROACH:], radius=circle.radius)


def _begin(control: InverseControl, circle: Circle, middle: np.ndarray) -> None:
    found = control.reach(circle.goals(middle, 0.0))
    if not found.reached:
        raise RuntimeError(f"{circle.scene}: the circle begins out of reach: {found.message}")


def _error(circle: Circle, plant: Simulation, commands: dict[str, float], goals: np.ndarray) -> float:
    """Step a plant to commands, and return its distance [m] from the goals."""
    plant.step(Command(actuators=commands))
    return circle.distance(plant, goals)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the tables."""
    parser = argparse.ArgumentParser(description="Inverse control on circles.")
    parser.add_argument("loops", nargs="*", default=[], help="open, real, closed; none: all")
    parser.add_argument("--rounds", type=float, default=2)
    parser.add_argument("--period", type=float, default=2.0, help="of a round [s]")
    parser.add_argument("--robots", nargs="+", default=[circle.scene for circle in CIRCLES])
    given = parser.parse_args(arguments)
    moves = round(given.period * RATE)
    loops = {"open": (open_loop, ""), "real": (real_time, "")}
    loops |= {f"closed, modulus {wrong:g}": (closed_loop, wrong) for wrong in WRONG}
    for title, (loop, wrong) in loops.items():
        if given.loops and not any(title.startswith(each) for each in given.loops):
            continue
        table = Table(title=f"{title} loop, circles of {given.period:g} s, {RATE:g} commands a second")
        for column in ("robot", "radius [mm]", "[ms]", "95 % [ms]", "max [ms]", "mean [%]", "max [%]", "solves"):
            table.add_column(column, justify="left" if column == "robot" else "right")
        for circle in CIRCLES:
            if circle.scene in given.robots:
                more = (wrong,) if wrong else ()
                found = loop(circle, *more, moves=moves, rounds=given.rounds)
                table.add_row(circle.scene, f"{1e3 * circle.radius:g}", *found.row(), f"{found.solves:.2f}")
        Console(width=110).print(table)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
