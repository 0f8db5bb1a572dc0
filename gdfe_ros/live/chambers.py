# SPDX-License-Identifier: Apache-2.0
"""The walls of chambers in the 3-D view."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import viser
from numpy.typing import NDArray

from gdfe_ros.actuators.actuator import Chamber
from gdfe_ros.live.view import Reading
from gdfe_ros.mesh.tet_faces import flat_quads
from gdfe_ros.scene.scene import Scene

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
