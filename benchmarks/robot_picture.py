# SPDX-License-Identifier: Apache-2.0
"""One picture of all robots in simulation, each at its most characteristic moment, coloured by equivalent strain."""

from __future__ import annotations

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

from matplotlib import image
from matplotlib.figure import Figure

from gdfe_ros.analysis.picture import draw_body
from gdfe_ros.scene import load_scene
from gdfe_ros.simulation import Simulation

if TYPE_CHECKING:
    from benchmarks.robots import Robot

COLUMNS = 3
STEPS = 50
"""Number of steps per second of simulation time."""


def draw_robots(path: Path, robots: Sequence[Robot]) -> None:
    """Play each robot's program to its moment, and draw all robots side by side into a PNG file."""
    rows = -(-len(robots) // COLUMNS)
    figure = Figure(figsize=(4.6 * COLUMNS, 2.6 * rows), dpi=120, layout="constrained")
    places = figure.subplots(rows, COLUMNS, squeeze=False).ravel()
    for axes, robot in zip(places, robots, strict=False):
        axes.imshow(image.imread(draw_robot(robot)))
    for axes in places:
        axes.set_axis_off()
    figure.savefig(path)


def draw_robot(robot: Robot) -> BytesIO:
    """Return a PNG picture of a robot at its moment."""
    simulation, picture = Simulation(load_scene(robot.scene)), BytesIO()
    for result in simulation.play(round(STEPS * simulation.scene.program.duration)):
        if not result.converged:
            raise RuntimeError(f"{robot.scene} at {result.time:g} s: {result.message}")
        if result.time > robot.moment - 0.5 / STEPS:
            break
    strain = simulation.fields().eps_eq
    draw_body(picture, simulation.mesh, result.positions, strain, title=robot.scene, label="equivalent strain")
    picture.seek(0)
    return picture
