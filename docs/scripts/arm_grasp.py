# SPDX-License-Identifier: Apache-2.0
"""Pictures of the scene `arm_grasp`: ``python -m docs.scripts.arm_grasp`` writes them into docs/images."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from numpy.typing import NDArray

from gdfe_ros.analysis.scenery import obstacle_faces
from gdfe_ros.scene import load_scene
from gdfe_ros.simulation import Simulation

IMAGES = Path(__file__).resolve().parents[1] / "images"
MOMENTS = (0.0, 1.2, 3.0, 15.6)
"""Times of the drawn frames [s]."""


def main() -> None:
    """Play the scene; draw frames, the forces at the fingertips and the efforts of the joints."""
    mpl.use("Agg")
    simulation = Simulation(load_scene("arm_grasp"))
    figure = plt.figure(figsize=(13, 3.6))
    table, frames = [], 0
    steps = round(simulation.scene.program.duration / simulation.scene.dynamics.step)
    _frame(figure.add_subplot(1, 4, 1, projection="3d"), simulation, 0.0)
    frames += 1
    for result in simulation.play(steps):
        if frames < len(MOMENTS) and result.time > MOMENTS[frames] - 1e-6:
            frames += 1
            _frame(figure.add_subplot(1, 4, frames, projection="3d"), simulation, result.time)
        tips = [float(np.linalg.norm(tip.wrench(result)[:3])) for tip in simulation.scene.sensors.values()]
        joints = simulation.joint_states()
        table.append([result.time, *tips, *(joints[name].effort for name in ("shoulder_lift", "elbow", "wrist_1"))])
    figure.subplots_adjust(0.0, 0.0, 1.0, 0.95, 0.0, 0.0)
    figure.savefig(IMAGES / "arm_grasp.png", dpi=90)
    _plot(np.array(table))


def _frame(axes: Axes, simulation: Simulation, time: float) -> None:
    """Draw arm, hand, box and table at a ``time`` [s]."""
    faces: list[tuple[NDArray[np.float64], tuple[float, float, float]]] = []
    arm = simulation.scene.arms[0]
    states = simulation.joint_states()
    frames = arm.dynamics.frames(np.array([states[joint.name].position for joint in arm.joints]))
    for visual in arm.visuals:
        place = frames[visual.link]
        faces.append((visual.faces @ place.axes.T + place.origin, visual.colour or (0.7, 0.7, 0.7)))
    quads = simulation.mesh.surface()
    faces.append((simulation.positions[quads], (0.95, 0.55, 0.15)))
    for body in simulation.scene.rigid_bodies:
        shape = obstacle_faces(body, simulation.handle_pose(body.name), simulation.positions)
        faces.append((shape, (0.3, 0.6, 0.3)))
    _add(axes, faces)
    sheet = np.array([[[-0.45, -0.3, 0], [0.12, -0.3, 0], [0.12, 0.3, 0], [-0.45, 0.3, 0]]]) - [0, 0, 0.055]
    axes.computed_zorder = False  # by depth the whole table would be before the hand
    axes.add_collection3d(Poly3DCollection(sheet, facecolors=(0.9, 0.9, 0.88), zorder=-1))
    axes.set(xlim=(-0.40, 0.08), ylim=(-0.22, 0.26), zlim=(-0.1, 0.38), title=f"{time:.1f} s")
    axes.set_box_aspect((1, 1, 1), zoom=1.5)
    axes.view_init(20, -35)
    axes.set_axis_off()


def _add(axes: Axes, shapes: list[tuple[NDArray[np.float64], tuple[float, float, float]]]) -> None:
    """Draw the faces of all shapes as one collection, so that they are sorted by depth."""
    light, polygons, colours = np.array([0.3, -0.5, 0.8]), [], []
    for faces, colour in shapes:
        normals = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
        lengths = np.linalg.norm(normals, axis=1)
        shade = 0.7 + 0.3 * np.abs(normals @ light) / np.where(lengths > 0.0, lengths, 1.0)
        polygons += list(faces)
        colours.append(np.clip(shade[:, None] * np.array(colour), 0.0, 1.0))
    rows = np.concatenate(colours)
    axes.add_collection3d(Poly3DCollection(polygons, facecolors=rows, edgecolors=0.85 * rows, linewidths=0.1))


def _plot(table: NDArray[np.float64]) -> None:
    figure, (above, below) = plt.subplots(2, 1, figsize=(8, 5), sharex=True)
    for column, name in ((1, "left fingertip"), (2, "right fingertip")):
        above.plot(table[:, 0], table[:, column], label=name)
    above.set(ylabel="contact force [N]")
    for column, name in ((3, "shoulder_lift"), (4, "elbow"), (5, "wrist_1")):
        below.plot(table[:, 0], table[:, column], label=name)
    below.set(xlabel="time [s]", ylabel="effort [N m]")
    for axes in (above, below):
        axes.legend(loc="right")
        axes.grid(alpha=0.3)
    figure.tight_layout()
    figure.savefig(IMAGES / "arm_forces.png", dpi=90)


if __name__ == "__main__":
    main()
