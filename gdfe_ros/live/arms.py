# SPDX-License-Identifier: Apache-2.0
"""The links of arms in the 3-D view."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import viser
from scipy.spatial.transform import Rotation

from gdfe_ros.arms.arm import Arm, Visual
from gdfe_ros.scene.scene import Scene

_GREY = (0.72, 0.74, 0.78)
"""Colour of links without a colour in their description."""


class Arms:
    """Draws the visual shapes of links. The shapes are sent once; later only changed poses are sent.

    Args:
        space: 3-D space of the page.
        group: name of the parent scene node.
        scene: scene with the arms.
        scale: factor from metres to the units of the view.
    """

    def __init__(self, space: viser.SceneApi, group: str, scene: Scene, *, scale: float) -> None:
        self._space, self._scale, self._arms = space, scale, scene.arms
        self._nodes = {
            arm.name: [(each.link, self._add(f"{group}/{arm.name}/{k}", each)) for k, each in enumerate(arm.visuals)]
            for arm in scene.arms
        }
        for arm in scene.arms:
            self._place(arm, arm.start)

    def move(self, joints: Mapping[str, float]) -> None:
        """Move all links to their poses at the given joint positions [rad] or [m], by joint name."""
        for arm in self._arms:
            if all(joint.name in joints for joint in arm.joints):
                self._place(arm, np.array([joints[joint.name] for joint in arm.joints]))

    def _place(self, arm: Arm, q: np.ndarray) -> None:
        frames = arm.dynamics.frames(q)
        for link, node in self._nodes[arm.name]:
            x, y, z, w = Rotation.from_matrix(frames[link].axes).as_quat()
            node.position, node.wxyz = self._scale * frames[link].origin, np.array([w, x, y, z])

    def _add(self, path: str, shape: Visual) -> viser.SceneNodeHandle:
        count, corners = shape.faces.shape[:2]
        fan = np.array([[0, place, place + 1] for place in range(1, corners - 1)])
        return self._space.add_mesh_simple(
            path,
            (self._scale * shape.faces).reshape(-1, 3),
            (corners * np.arange(count)[:, None, None] + fan).reshape(-1, 3),
            color=tuple(round(255 * part) for part in shape.colour or _GREY),
            flat_shading=True,
            side="double",
        )
