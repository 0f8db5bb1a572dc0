# SPDX-License-Identifier: Apache-2.0
"""Draw the pictures of docs/contact.md and docs/gripper.md: ``python -m docs.scripts.contact_scenes``."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from numpy.typing import NDArray

from gdfe_ros.analysis.picture import COLOURS, obstacle_collection, shade
from gdfe_ros.analysis.scenery import obstacle_faces
from gdfe_ros.constraints import Pose
from gdfe_ros.constraints.obstacle import Obstacle
from gdfe_ros.scene import load_scene
from gdfe_ros.simulation import Simulation

IMAGES = Path(__file__).resolve().parents[1] / "images"
NEAR = 1e-6
"""Largest time [s] by which a drawn step may precede the requested moment."""


@dataclass(frozen=True, kw_only=True)
class Shot:
    """Options for drawing a scene.

    Attributes:
        moments: drawn times [s].
        view: elevation and azimuth [deg].
        size: size of a panel [inches].
        zoom: magnification inside a panel.
        below: whether panels are below each other, not beside each other.
        cut: whether only the half of the body behind y = 0 is drawn.
    """

    moments: tuple[float, ...]
    view: tuple[float, float] = (12.0, -72.0)
    size: tuple[float, float] = (4.2, 2.9)
    zoom: float = 1.25
    below: bool = False
    cut: bool = False


SHOTS = {
    "finger_press": Shot(moments=(1.0, 3.0)),
    "grasp": Shot(moments=(0.0, 1.2, 5.0, 14.5), size=(2.4, 3.2), zoom=1.5),
    "ball_gripper": Shot(moments=(0.0, 1.2, 4.0), view=(10.0, -60.0), size=(2.9, 3.2), zoom=1.4),
    "ball_drop": Shot(moments=(0.0, 0.1, 0.4, 1.2), view=(8.0, -86.0), size=(6.5, 1.25), zoom=3.6, below=True),
    "crawler": Shot(moments=(0.2, 0.4, 0.6, 0.8), size=(6.5, 1.15), zoom=4.2, below=True),
    "soft_pinch": Shot(moments=(0.005, 1.2, 2.5, 4.9), view=(6.0, -84.0), size=(2.4, 3.0), zoom=1.4),
    "peg_in_soft_hole": Shot(moments=(1.0, 2.5), view=(12.0, -80.0), cut=True),
}


@dataclass(frozen=True, eq=False)
class Frame:
    """State of a scene: time [s], positions (n, 3) [m], strains of the cells (m,), poses of the obstacles."""

    time: float
    positions: NDArray[np.float64]
    strain: NDArray[np.float64]
    poses: dict[str, Pose]


def filmed(simulation: Simulation, moments: tuple[float, ...]) -> list[Frame]:
    """Play a scene and return its states at the requested moments.

    Raises:
        RuntimeError: a step did not converge.
    """
    obstacles = [each.name for each in simulation.scene.handles if isinstance(each, Obstacle)]
    frames = []
    for result in simulation.play():
        if not result.converged:
            raise RuntimeError(f"{simulation.scene.name} at {result.time:g} s: {result.message}")
        if result.time > moments[len(frames)] - NEAR:
            poses = {name: simulation.handle_pose(name) for name in obstacles}
            frames.append(Frame(result.time, simulation.positions.copy(), simulation.fields().eps_eq, poses))
            if len(frames) == len(moments):
                break
    return frames


def draw_scene(path: Path, name: str, shot: Shot) -> None:
    """Play a scene and draw its moments with one scale into a PNG file."""
    simulation = Simulation(load_scene(name))
    frames = filmed(simulation, shot.moments)
    rows, columns = (len(frames), 1) if shot.below else (1, len(frames))
    figure = Figure(figsize=(shot.size[0] * columns, shot.size[1] * rows), dpi=100)
    solids = [each for each in simulation.scene.handles if isinstance(each, Obstacle)]
    everywhere = np.vstack([frame.positions for frame in frames])
    things = [[obstacle_faces(each, frame.poses[each.name], everywhere) for each in solids] for frame in frames]
    shown = np.vstack([everywhere, *(faces.reshape(-1, 3) for found in things for faces in found)])
    most = max(float(np.percentile(frame.strain, 99.0)) for frame in frames)
    for place, (frame, faces) in enumerate(zip(frames, things, strict=True)):
        row, column = (place, 0) if shot.below else (0, place)
        corner = column / columns, 1.0 - (row + 1) / rows
        axes = figure.add_axes((*corner, 1.0 / columns, 1.0 / rows), projection="3d", computed_zorder=False)
        axes.patch.set_alpha(0.0)
        figure.text(corner[0] + 0.02 / columns, 1.0 - (row + 0.1) / rows, f"{frame.time:.1f} s", color="0.3", va="top")
        _draw(axes, simulation, frame, faces, most, shot)
        _frame(axes, shown, shot)
    figure.savefig(path)


def _draw(axes: Axes, simulation: Simulation, frame: Frame, things: list[NDArray], most: float, shot: Shot) -> None:
    """Draw body and obstacles. The body is drawn over the obstacles, unless it is cut open and contains them."""
    quads = frame.positions[simulation.mesh.surface()]
    colours = matplotlib.colormaps[COLOURS](np.clip(frame.strain / most, 0.0, 1.0))
    faces = shade(colours[simulation.mesh.boundary.cells], quads)
    if shot.cut:
        behind = quads[:, :, 1].mean(axis=1) > 0.0
        quads, faces = quads[behind], faces[behind]
    body = Poly3DCollection(quads, facecolors=faces, edgecolors=(0, 0, 0, 0.22), linewidths=0.25, clip_on=False)
    solids = [obstacle_collection(thing) for thing in things]
    body.set_zorder(-1 if shot.cut else 1)
    for drawn in [body, *solids]:
        axes.add_collection3d(drawn)


def _frame(axes: Axes, points: NDArray[np.float64], shot: Shot) -> None:
    low, high = points.min(axis=0), points.max(axis=0)
    span = np.maximum(high - low, 0.05 * (high - low).max())
    for letter, centre, width in zip("xyz", 0.5 * (low + high), span, strict=True):
        getattr(axes, f"set_{letter}lim")(centre - 0.5 * width, centre + 0.5 * width)
    axes.set_box_aspect(tuple(span), zoom=shot.zoom)
    axes.set_proj_type("ortho")
    axes.view_init(*shot.view)
    axes.set_axis_off()


def main(names: list[str]) -> None:
    """Draw the scenes with these names, or all scenes if there are no names, and print the names of the files."""
    for name in names or SHOTS:
        path = IMAGES / f"{name}.png"
        draw_scene(path, name, SHOTS[name])
        print(f"written: {path.name}, {path.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main(sys.argv[1:])
