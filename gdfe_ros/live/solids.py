# SPDX-License-Identifier: Apache-2.0
"""Obstacles and rigid bodies in the 3-D view."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import viser
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gdfe_ros.constraints import Pose
from gdfe_ros.constraints.arm_link import ArmLink
from gdfe_ros.constraints.form import Plane
from gdfe_ros.constraints.form_faces import form_faces
from gdfe_ros.constraints.obstacle import Obstacle
from gdfe_ros.constraints.rigid_body import RigidBody
from gdfe_ros.scene.scene import Scene

_SHEET = 4.0
"""Edge of the sheet that represents a plane, divided by the extent of all meshes."""
_OBSTACLE, _BODY, _LINES = (140, 145, 155), (230, 140, 50), (110, 115, 125)
_OBSTACLE_OPACITY, _BODY_OPACITY = 0.45, 0.8
"""Opacities of obstacles and of rigid bodies, below 1 so that forces and objects behind them remain visible."""


class Solids:
    """Draws obstacles and rigid bodies. Their shapes are sent once; later only changed poses are sent.

    A plane is drawn as a sheet with lines. Their distance is a tenth of the extent of all meshes. The sheet follows the
    body in steps of this distance, so that the lines appear fixed.

    Args:
        space: 3-D space of the page.
        group: name of the parent scene node.
        scene: scene with the obstacles and rigid bodies.
        scale: factor from metres to the units of the view.
    """

    def __init__(self, space: viser.SceneApi, group: str, scene: Scene, *, scale: float) -> None:
        self._space, self._scale, self._size = space, scale, scene.mesh.extent
        self._things = [each for each in scene.handles if isinstance(each, Obstacle) and not isinstance(each, ArmLink)]
        self._nodes = {thing.name: self._add(f"{group}/{thing.name}", thing) for thing in self._things}

    def move(self, poses: Mapping[str, Pose], positions: NDArray[np.floating]) -> None:
        """Move each shape to its pose; viser sends the changes.

        Args:
            poses: poses of all obstacles and rigid bodies by name, relative to rest.
            positions: positions of the body's vertices (n, 3) [m].
        """
        for thing in self._things:
            origin, axes = thing.frame(poses[thing.name])
            if isinstance(thing.form, Plane):
                cell = self._size / 10.0
                foot = np.round((positions.mean(axis=0) - origin) @ axes / cell) * cell
                origin = origin + axes[:, :2] @ foot[:2]
            node, (x, y, z, w) = self._nodes[thing.name], Rotation.from_matrix(axes).as_quat()
            node.position, node.wxyz = self._scale * origin, np.array([w, x, y, z])

    def _add(self, path: str, thing: Obstacle) -> viser.SceneNodeHandle:
        if isinstance(thing.form, Plane):
            edge = _SHEET * self._size * self._scale
            return self._space.add_grid(
                path,
                width=edge,
                height=edge,
                cell_size=edge / _SHEET / 10.0,
                section_size=edge / _SHEET,
                cell_color=_LINES,
                section_color=_LINES,
                plane_color=_OBSTACLE,
                plane_opacity=_OBSTACLE_OPACITY,
                shadow_opacity=0.0,
            )
        faces = form_faces(thing.form)
        count, corners = faces.shape[:2]
        fan = np.array([[0, place, place + 1] for place in range(1, corners - 1)])
        free = isinstance(thing, RigidBody)
        return self._space.add_mesh_simple(
            path,
            (self._scale * faces).reshape(-1, 3),
            (corners * np.arange(count)[:, None, None] + fan).reshape(-1, 3),
            color=_BODY if free else _OBSTACLE,
            opacity=_BODY_OPACITY if free else _OBSTACLE_OPACITY,
            flat_shading=True,
            side="double",
        )
