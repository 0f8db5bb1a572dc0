# SPDX-License-Identifier: Apache-2.0
"""The shipped robots: rate of their steps, their deformation, and a picture of all robots.

``python -m benchmarks.robots [--out FILE] [--pictures FOLDER]`` plays every program with 100 steps per second of
simulation time on one core, writes the report and ``robots.png``, and prints the table of docs/benchmark.md.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks.markdown import markdown_table
from benchmarks.replay import first_steps, summed
from benchmarks.report import run_script
from gdfe_ros.scene import load_scene
from gdfe_ros.simulation import Simulation

RATE = 100
"""Number of steps per second of simulation time."""


class Robot(NamedTuple):
    """A scene, a short description of its motion, and its most characteristic moment [s] for the picture."""

    scene: str
    line: str
    moment: float


ROBOTS = (
    Robot("tendon_finger", "a flexor curls it, an extensor stretches it", 1.5),
    Robot("pneunet", "eight air cells over a stiff sheet curl by 109 degrees at 44 kPa", 3.0),
    Robot("bending_tube", "air in a ringed tube curls it by 93 degrees at 11 kPa", 3.0),
    Robot("three_chamber_arm", "leans wherever three pressures say", 6.0),
    Robot("gripper", "three tendons close three fingers, the wrist lifts and turns", 4.0),
    Robot("shape_memory_strip", "a layer that shortens by 8 % coils it up", 3.0),
    Robot("two_material_bar", "the joint shows that both halves are hyperelastic (Fig. 10)", 2.0),
)


def measure(robot: Robot) -> dict[str, Any]:
    """Play a robot's program in small steps; return rates [1/s], least det F and whether all steps converged.

    ``rate`` is the number of steps divided by the processor time of the whole program, including all threads and the
    work between steps, but without building and compiling. ``p99`` is the 99th percentile of a step's wall time [s].
    """
    simulation = Simulation(load_scene(robot.scene))
    simulation.warm_up()
    duration = simulation.scene.program.duration
    started = time.process_time()
    results = list(simulation.play(round(RATE * duration)))
    seconds = time.process_time() - started
    times = sorted(result.wall_time for result in results)
    return {
        "scene": robot.scene,
        "line": robot.line,
        "cells": simulation.mesh.n_cells,
        "rate": len(results) / seconds,
        "p99": times[int(0.99 * len(times))],
        "min_det": min(result.min_det for result in results),
        "converged": all(result.converged for result in results),
    }


def robot_table(report: list[dict[str, Any]]) -> str:
    """Return the robots as a Markdown table."""
    heads = ("robot", "what it does", "cells", "steps/s", "p99 of a step, wall [ms]", "min det F")
    rows = [
        (f"`{item['scene']}`", item["line"], str(item["cells"]), f"{item['rate']:.0f}", f"{1e3 * item['p99']:.1f}",
         f"{item['min_det']:.2f}")
        for item in report
    ]  # fmt: skip
    fast = sum(item["rate"] > RATE for item in report)
    said = f"{fast} of {len(report)} robots are faster than real time, which is {RATE} steps/s."
    return f"{markdown_table(heads, rows)}\n\n{said}"


def draw(folder: Path, _: object) -> None:
    """Draw the robots into a folder."""
    from benchmarks.robot_picture import draw_robots

    draw_robots(folder / "robots.png", ROBOTS)


def probe() -> dict[str, float]:
    """Return the figures of the first steps of every program."""
    found: dict[str, float] = {}
    for robot in ROBOTS:
        simulation = Simulation(load_scene(robot.scene))
        found |= first_steps(robot.scene, simulation, round(RATE * simulation.scene.program.duration))
    return summed(found)


if __name__ == "__main__":
    run_script(
        "benchmarks.robots",
        "The shipped robots: how fast each streams.",
        "robots",
        measure=lambda: [measure(robot) for robot in ROBOTS],
        tables=robot_table,
        probe=probe,
        draw=draw,
    )
