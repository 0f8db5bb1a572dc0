# SPDX-License-Identifier: Apache-2.0
"""One picture of all robots in simulation, each at its most characteristic moment, coloured by equivalent strain."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from numpy.typing import NDArray

from gdfe_ros.analysis.picture import shaded
from gdfe_ros.mesh import HexMesh
from gdfe_ros.scene import load_scene
from gdfe_ros.simulation import Simulation

if TYPE_CHECKING:
    from benchmarks.robots import Robot

COLUMNS = 4
STEPS = 50
"""Number of steps per second of simulation time."""
VIEWS = {"gripper": (24.0, -50.0), "three_chamber_arm": (16.0, -52.0), "two_material_bar": (20.0, -64.0)}
VIEW = (14.0, -68.0)
MOST = 98.0
"""Percentile of the strains at the upper end of a panel's colour range."""
COLOURS = "viridis"
SLENDER = 0.3
"""Ratio of second largest to largest extent below which a body uses the whole width of its panel."""


def draw_robots(path: Path, robots: Sequence[Robot]) -> None:
    """Play each robot's program to its moment, and draw all robots side by side into a PNG file."""
    rows = -(-(len(robots) + 1) // COLUMNS)
    figure = Figure(figsize=(3.6 * COLUMNS, 3.3 * rows), dpi=110)
    for place, robot in enumerate(robots):
        column, row = place % COLUMNS, place // COLUMNS
        box = (column / COLUMNS, 1.0 - (row + 1) / rows, 1.0 / COLUMNS, 0.84 / rows)
        axes = figure.add_axes(box, projection="3d", computed_zorder=False)
        simulation = _played(robot)
        strain = simulation.fields().eps_eq
        top = float(np.percentile(strain, MOST))
        _draw(axes, simulation.mesh, simulation.positions, strain / max(top, 1e-12), VIEWS.get(robot.scene, VIEW))
        x, y = box[0] + 0.03 / COLUMNS, box[1] + 0.93 / rows
        figure.text(x, y, robot.scene.replace("_", " "), fontsize=12, weight="bold")
        figure.text(x, y - 0.06 / rows, f"equivalent strain up to {top:.2f}", fontsize=8.5, color="0.35")
    _legend(figure, len(robots) % COLUMNS, rows)
    figure.savefig(path)


def _played(robot: Robot) -> Simulation:
    simulation = Simulation(load_scene(robot.scene))
    for result in simulation.play(round(STEPS * simulation.scene.program.duration)):
        if not result.converged:
            raise RuntimeError(f"{robot.scene} at {result.time:g} s: {result.message}")
        if result.time > robot.moment - 0.5 / STEPS:
            break
    return simulation


def _draw(
    axes: Axes,
    mesh: HexMesh,
    positions: NDArray[np.float64],
    values: NDArray[np.float64],
    view: tuple[float, float],
) -> None:
    """Draw the deformed surface over the pale undeformed one, without axes, true to scale."""
    surface = mesh.surface()
    rest, quads = mesh.vertices[surface], positions[surface]
    colours = matplotlib.colormaps[COLOURS](np.clip(values[mesh.boundary.cells], 0.0, 1.0))
    axes.add_collection3d(Poly3DCollection(rest, facecolors=(0.6, 0.62, 0.68, 0.045), edgecolors="none", zorder=0))
    faces = shaded(colours, quads)
    axes.add_collection3d(Poly3DCollection(quads, facecolors=faces, edgecolors=(0, 0, 0, 0.22), linewidths=0.25))
    points = np.vstack([positions, mesh.vertices])
    low, high = points.min(axis=0), points.max(axis=0)
    span = np.maximum(high - low, 0.05 * (high - low).max())
    for name, centre, width in zip("xyz", 0.5 * (low + high), span, strict=True):
        getattr(axes, f"set_{name}lim")(centre - 0.5 * width, centre + 0.5 * width)
    slender = np.sort(span)[1] < SLENDER * span.max()
    axes.set_box_aspect(span, zoom=0.95 if slender else 1.2)
    axes.view_init(*view)
    axes.set_axis_off()


def _legend(figure: Figure, column: int, rows: int) -> None:
    """Draw the legend of the colours in the last, empty panel."""
    left, width = column / COLUMNS, 1.0 / COLUMNS
    bar = figure.add_axes((left + 0.15 * width, 0.45 / rows, 0.7 * width, 0.05 / rows))
    mappable = matplotlib.cm.ScalarMappable(matplotlib.colors.Normalize(0.0, 1.0), matplotlib.colormaps[COLOURS])
    figure.colorbar(mappable, cax=bar, orientation="horizontal", ticks=[0.0, 1.0])
    bar.set_xticklabels(["0", "as given"], fontsize=9)
    bar.set_title("equivalent strain", fontsize=11)
    figure.text(left + 0.5 * width, 0.26 / rows, "grey: at rest", fontsize=9, color="0.35", ha="center")
