# SPDX-License-Identifier: Apache-2.0
"""Drawn things beside the body: obstacles and rigid bodies, links of arms, forces, walls of chambers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gdfe_ros.actuators.actuator import Chamber
from gdfe_ros.arms.arm import Arm, Visual
from gdfe_ros.constraints import Pose
from gdfe_ros.constraints.form import Plane, form_faces
from gdfe_ros.constraints.obstacle import ArmLink, Obstacle
from gdfe_ros.constraints.rigid_body import RigidBody
from gdfe_ros.live.interface import Reading
from gdfe_ros.mesh.cells.tetrahedra import flat_quads
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
            node = self._nodes[thing.name]
            node.position, node.wxyz = self._scale * origin, turn_of(Rotation.from_matrix(axes))

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
        colour, opacity = (_BODY, _BODY_OPACITY) if isinstance(thing, RigidBody) else (_OBSTACLE, _OBSTACLE_OPACITY)
        return _add_faces(self._space, path, self._scale * form_faces(thing.form), color=colour, opacity=opacity)


def turn_of(rotation: Rotation) -> NDArray[np.float64]:
    """Return the quaternion (w, x, y, z) of a rotation, in viser's order."""
    return np.roll(rotation.as_quat(), 1)


def _add_faces(space: viser.SceneApi, path: str, faces: NDArray[np.floating], **look: Any) -> viser.SceneNodeHandle:
    """Add faces (f, k, 3) in the units of the view as a mesh."""
    count, corners = faces.shape[:2]
    fan = np.array([[0, place, place + 1] for place in range(1, corners - 1)])
    triangles = (corners * np.arange(count)[:, None, None] + fan).reshape(-1, 3)
    return space.add_mesh_simple(path, faces.reshape(-1, 3), triangles, flat_shading=True, side="double", **look)


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
            node.position = self._scale * frames[link].origin
            node.wxyz = turn_of(Rotation.from_matrix(frames[link].axes))

    def _add(self, path: str, shape: Visual) -> viser.SceneNodeHandle:
        colour = tuple(round(255 * part) for part in shape.colour or _GREY)
        return _add_faces(self._space, path, self._scale * shape.faces, color=colour)


_LONGEST = 0.35
"""Length of the arrow for the largest force so far, divided by the body's size."""
_LEAST_SHARE = 0.01
"""A force has no arrow if it is below this fraction of the largest force so far."""
_SHAFT, _HEAD, _HEAD_LENGTH = 0.008, 0.022, 0.05
"""Radii of an arrow's shaft and head, and length of its head, divided by the body's size."""


class Arrows:
    """Draws forces as arrows that end at the points of action; lengths are relative to the largest force so far.

    Args:
        space: 3-D space of the page.
        group: name of the parent scene node.
        colours: dict from a kind of forces to the colour of its arrows: red, green and blue, 0 to 255.
        size: size of the body in the units of the view.
        thin: factor on the default thickness of the arrows.

    Attributes:
        largest: largest of the forces that were drawn last [N].
    """

    def __init__(
        self,
        space: viser.SceneApi,
        group: str,
        colours: Mapping[str, tuple[int, int, int]],
        *,
        size: float,
        thin: float = 1.0,
    ) -> None:
        self._size, self.largest, self._so_far = size, 0.0, 0.0
        self._nodes = {
            kind: space.add_arrows(
                f"{group}/{kind}",
                np.zeros((1, 2, 3), np.float32),
                colour,
                shaft_radius=thin * _SHAFT * size,
                head_radius=thin * _HEAD * size,
                head_length=thin * _HEAD_LENGTH * size,
                visible=False,
            )
            for kind, colour in colours.items()
        }

    def draw(
        self, forces: Mapping[str, tuple[NDArray[np.float64], NDArray[np.float64]]], *, noise: float = 0.0
    ) -> None:
        """Draw the forces of each kind.

        Args:
            forces: dict from a kind to end points (k, 3) in the units of the view, and force vectors (k, 3) [N].
            noise: largest force [N] that may be an error of the solve; such forces have no arrow, and do not change the
                scale.
        """
        sizes = {kind: np.linalg.norm(vectors, axis=1) for kind, (_, vectors) in forces.items()}
        self.largest = max((float(each.max(initial=0.0)) for each in sizes.values()), default=0.0)
        if self.largest > noise:
            self._so_far = max(self._so_far, self.largest)
        for kind, (ends, vectors) in forces.items():
            node, wanted = self._nodes[kind], sizes[kind] > max(noise, _LEAST_SHARE * self._so_far)
            node.visible = bool(wanted.any())
            if node.visible:
                shafts = vectors[wanted] * (_LONGEST * self._size / self._so_far)
                node.points = np.stack([ends[wanted] - shafts, ends[wanted]], axis=1).astype(np.float32)


_IDLE, _FULL = np.array([205.0, 215.0, 230.0]), np.array([20.0, 90.0, 220.0])
"""Colours without pressure and at the largest pressure so far: red, green and blue, 0 to 255."""
_OPACITY = 0.85


class Chambers:
    """Draws the wall of each chamber, in a blue that deepens with the pressure, relative to the largest one so far.

    Args:
        space: 3-D space of the page.
        group: name of the parent scene node.
        scene: scene with the chambers.
        scale: factor from metres to the units of the view.

    Attributes:
        largest: largest magnitude of a pressure so far [Pa].
    """

    def __init__(self, space: viser.SceneApi, group: str, scene: Scene, *, scale: float) -> None:
        self._scale, self.largest = scale, 0.0
        self._chambers = [each for each in scene.actuators if isinstance(each, Chamber)]
        self._used = [np.unique(each.quads) for each in self._chambers]
        self._nodes = [
            space.add_mesh_simple(
                f"{group}/{chamber.name}",
                self._walls(chamber, used, scene.mesh.vertices),
                np.searchsorted(used, _triangles(chamber.quads)),
                color=tuple(_IDLE.astype(int)),
                opacity=_OPACITY,
                side="double",
                cast_shadow=False,
                receive_shadow=False,
            )
            for chamber, used in zip(self._chambers, self._used, strict=True)
        ]

    def draw(self, positions: NDArray[np.floating], readings: Mapping[str, list[Reading]]) -> None:
        """Move the walls to positions of all vertices (n, 3) [m], and colour them by the readings of the actuators."""
        pressures = [_pressure(readings.get(chamber.name, ())) for chamber in self._chambers]
        self.largest = max(self.largest, *map(abs, pressures))
        for chamber, used, node, pressure in zip(self._chambers, self._used, self._nodes, pressures, strict=True):
            fraction = abs(pressure) / self.largest if self.largest > 0.0 else 0.0
            node.vertices = self._walls(chamber, used, positions)
            node.color = tuple(np.rint(_IDLE + fraction * (_FULL - _IDLE)).astype(int).tolist())

    def _walls(
        self, chamber: Chamber, used: NDArray[np.integer], positions: NDArray[np.floating]
    ) -> NDArray[np.float32]:
        return (self._scale * chamber.at(positions)[used]).astype(np.float32)


def _triangles(faces: NDArray[np.integer]) -> NDArray[np.integer]:
    """Return the faces as triangles (t, 3)."""
    quads = flat_quads(faces)
    return np.concatenate([quads[:, [0, 1, 2]], quads[quads[:, 2] != quads[:, 3]][:, [0, 2, 3]]])


def _pressure(readings: list[Reading]) -> float:
    """Return the pressure [Pa] among an actuator's readings, 0 before the first step."""
    return next((value for name, value, _ in readings if name == "pressure"), 0.0)
