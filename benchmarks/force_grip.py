# SPDX-License-Identifier: Apache-2.0
"""A box of 50 g between two soft pads that are pressed onto it with 3 N each, compared with Drake.

``python -m benchmarks.force_grip`` prints the table. Times are processor times, so that other work on the machine has
little influence. Drake chooses its number of threads.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

from benchmarks.markdown import markdown_table
from benchmarks.peers import drake_grip
from benchmarks.peers.force_grip_case import STEP
from gdfe_ros.scene.loader import scene_from_text
from gdfe_ros.simulation import Simulation

GRIP = """
name: force_grip
meshes:
  left: {bar: {size: [0.01, 0.03, 0.03], cells: [2, 6, 6]}, at: [-0.0305, 0, 0]}
  right: {bar: {size: [0.01, 0.03, 0.03], cells: [2, 6, 6]}, at: [0.0205, 0, 0]}
materials: {soft: {law: neo_hookean, young: 1.0e5, poisson: 0.4, density: 1000}}
regions: [{material: soft}]
handles:
  left: {where: {mesh: left, face: x-}, free: [x]}
  right: {where: {mesh: right, face: x+}, free: [x]}
masses:
  left_paddle: {mass: 0.05, where: {mesh: left, face: x-}}
  right_paddle: {mass: 0.05, where: {mesh: right, face: x+}}
loads:
  weight: {gravity: [0, 0, -9.81]}
  left_push: {surface: {where: {mesh: left, face: x-}, force: [3, 0, 0]}}
  right_push: {surface: {where: {mesh: right, face: x+}, force: [-3, 0, 0]}}
bodies: {part: {box: {size: [0.04, 0.04, 0.04]}, density: 781.25, friction: 0.5}}
dynamics: {scheme: bdf2, step: 0.005, damping: {viscosity: 200}}
solver: {skip: []}
"""
"""Scene of the grip. No solve is skipped. Forces and weight act from the first step, as in Drake."""
FRICTIONS = (0.5, 0.15)
HELD, PROBED = 2.0, 0.1
"""Duration for which each box is held [s], in the measurement and in the probe."""


def grip(friction: float, *, seconds: float) -> dict[str, float]:
    """Press and hold the box for some ``seconds``.

    Returns:
        ``sunk``: final descent of the box [m]; ``drift``: its speed in the second half [m/s]; ``step``: processor time
        of a step [s].

    Raises:
        AssertionError: a step did not converge.
    """
    simulation = Simulation(scene_from_text(GRIP, overrides={"bodies.part.friction": friction}))
    simulation.warm_up()
    count, heights, spent = round(seconds / STEP), [], time.process_time()
    for _ in range(count):
        result = simulation.step()
        assert result.converged, result.message
        heights.append(simulation.handle_pose("part").translation[2])
    spent = time.process_time() - spent
    drift = (heights[-1] - heights[count // 2]) / (0.5 * seconds)
    return {"sunk": -heights[-1], "drift": abs(drift), "step": spent / count}


def measure() -> dict[str, Any]:
    """Return the rows of the table, and a message if Drake is missing."""
    rows = [{"solver": "gdfe_ros", "friction": each, **grip(each, seconds=HELD)} for each in FRICTIONS]
    reason = drake_grip.available()
    if not reason:
        rows += [{"solver": "Drake", "friction": each, **drake_grip.simulate(each, seconds=HELD)} for each in FRICTIONS]
    return {"force_grip": rows, "force_grip_missing": [f"Drake: {reason}"] if reason else []}


def all_tables(report: Mapping[str, Any]) -> dict[str, str]:
    """Return dict from name to the table of a report."""
    rows = [
        [row["solver"], f"{row['friction']:g}", f"{1e6 * row['sunk']:.1f}", f"{1e6 * row['drift']:.2g}",
         f"{1e3 * row['step']:.1f}"]
        for row in report["force_grip"]
    ]  # fmt: skip
    heads = ("solver", "friction", "sunk [um]", "drift [um/s]", "processor time of a step [ms]")
    return {"force_grip": "\n\n".join([markdown_table(heads, rows), *report["force_grip_missing"]])}


if __name__ == "__main__":
    print(all_tables(measure())["force_grip"])
