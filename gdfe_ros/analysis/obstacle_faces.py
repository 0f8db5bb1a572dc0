# SPDX-License-Identifier: Apache-2.0
"""The faces of obstacles, for pictures."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gdfe_ros.constraints import Pose
from gdfe_ros.constraints.form import Plane, form_faces
from gdfe_ros.constraints.obstacle import Obstacle

if TYPE_CHECKING:
    from gdfe_ros.scene import Scene
    from gdfe_ros.simulation import Simulation

_POSE = (*(f"position.{axis}" for axis in "xyz"), *(f"orientation.{axis}" for axis in "xyzw"))
BEYOND = 0.25
"""Margin of a drawn plane around the points that it must cover, divided by the larger extent of the points."""


def faces_of(simulation: Simulation) -> list[NDArray[np.float64]]:
    """Return the faces (f, k, 3) [m] of each obstacle of a simulation, at its present pose."""
    obstacles = [handle for handle in simulation.scene.handles if isinstance(handle, Obstacle)]
    return [obstacle_faces(each, simulation.handle_pose(each.name), simulation.positions) for each in obstacles]


def recorded_faces(
    scene: Scene, samples: Mapping[str, Mapping[str, NDArray]], positions: NDArray[np.float64]
) -> list[NDArray[np.float64]]:
    """Return the faces (f, k, 3) [m] of each obstacle and rigid body of a scene, at its pose in a recorded step.

    Args:
        scene: the recorded scene.
        samples: arrays of a step, by topic and field. An obstacle whose pose is missing is at its initial pose.
        positions: positions of the body's vertices (n, 3) [m].
    """
    faces = []
    for obstacle in (handle for handle in scene.handles if isinstance(handle, Obstacle)):
        values = samples.get(pose_topic(obstacle))
        pose = Pose()
        if values is not None:
            x, y, z, qx, qy, qz, qw = (float(values[f"pose.{name}"][0]) for name in _POSE)
            pose = Pose((x, y, z), tuple(Rotation.from_quat([qx, qy, qz, qw]).as_rotvec()))
        faces.append(obstacle_faces(obstacle, pose, positions))
    return faces


def pose_topic(obstacle: Obstacle) -> str:
    """Return the topic, without the node's name, on which an obstacle's pose is published."""
    return f"{obstacle.section}/{obstacle.name}/pose"


def obstacle_faces(obstacle: Obstacle, pose: Pose, before: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the faces (f, k, 3) [m] of an obstacle at a ``pose``.

    A plane is one rectangle. It covers the projections of the points ``before`` (n, 3) [m] and a margin (`BEYOND`).
    """
    origin, axes = obstacle.frame(pose)
    if isinstance(obstacle.form, Plane):
        own = (before - origin) @ axes
        low, high = own[:, :2].min(axis=0), own[:, :2].max(axis=0)
        edge = BEYOND * (high - low).max()
        (a, b), (c, d) = low - edge, high + edge
        faces = np.array([[[a, b, 0.0], [c, b, 0.0], [c, d, 0.0], [a, d, 0.0]]])
    else:
        faces = form_faces(obstacle.form)
    return origin + faces @ axes.T
