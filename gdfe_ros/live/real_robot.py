# SPDX-License-Identifier: Apache-2.0
"""A real robot beside its simulation: measured points, their distances from the simulated ones, and its body."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import viser
from numpy.typing import NDArray

from gdfe_ros.live.surface import AlternatingBody, DrawnSurface
from gdfe_ros.mesh import HexMesh

_GREEN = (30, 160, 60)
_ROOT = "/robot"
"""Path of all objects of the robot in the view."""
_POINT = 0.03
"""Diameter of a measured point, divided by the body's size."""


class RealRobot:
    """Draws a robot in green, its body translucent.

    Args:
        space: the scene of the page.
        mesh: the undeformed body.
        scale: factor from metres to the units of the view.
        size: size of the body in the units of the view.
    """

    def __init__(self, space: viser.SceneApi, mesh: HexMesh, *, scale: float, size: float) -> None:
        self._space, self._scale, self._size = space, scale, size
        self._surface = DrawnSurface(mesh, scale=scale, plain=np.array(_GREEN) / 255.0)
        self._surface.be_translucent(True)
        self._body: AlternatingBody | None = None

    def draw(
        self,
        places: Mapping[str, tuple[NDArray[np.float64], NDArray[np.float64]]],
        body: NDArray[np.float64] | None,
    ) -> None:
        """Draw the robot.

        Args:
            places: dict from probe to its measured and simulated position, each (3,) [m].
            body: positions of the vertices of the measured body (n, 3) [m]; None: it is not drawn.
        """
        measured, simulated = (self._scale * np.array(each) for each in zip(*places.values(), strict=True))
        self._space.add_point_cloud(
            f"{_ROOT}/points",
            measured.astype(np.float32),
            _GREEN,
            point_size=_POINT * self._size,
            point_shape="rounded",
        )
        lines = np.stack([measured, simulated], axis=1).astype(np.float32)
        self._space.add_line_segments(f"{_ROOT}/distances", lines, _GREEN, thickness=2.0, thickness_units="screen")
        for name, place, other in zip(places, measured, simulated, strict=True):
            length = float(np.linalg.norm(place - other)) / self._scale
            self._space.add_label(f"{_ROOT}/{name}", f"{name}: {1e3 * length:.2f} mm", position=place)
        if body is not None:
            self._draw_body(self._surface.pack(body, None))

    def _draw_body(self, frame: bytes) -> None:
        if self._body is None:
            self._body = AlternatingBody(self._space, f"{_ROOT}/body", frame)
            return
        self._body.turn()  # the object that was filled at the last call has been read by now
        self._body.fill(frame)
