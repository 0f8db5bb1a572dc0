# SPDX-License-Identifier: Apache-2.0
"""The body's surface as a triangle marker for RViz and Foxglove.

A marker contains lists of Point and ColorRGBA objects; filling and serialising 10 000 of them takes 17 ms. Values are
therefore written into a serialised template.
"""

from __future__ import annotations

import struct

import numpy as np
from geometry_msgs.msg import Point
from numpy.typing import NDArray
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker

from gdfe_ros.colour_map import colour
from gdfe_ros.mesh import HexMesh
from gdfe_ros.node.packing import Template

_PROBE = -1.2345678901234567e300
_COLOUR_PROBE = -1.2345678e30


class SurfaceMarker:
    """Makes serialised markers of a mesh's surface, or of its skin.

    Args:
        mesh: the undeformed body.
        frame_id: frame of the coordinates.
    """

    def __init__(self, mesh: HexMesh, frame_id: str) -> None:
        self._outside = mesh.outside
        self._corners = self._outside.triangles.reshape(-1)
        self._cells = np.repeat(self._outside.cells, len(self._corners) // len(self._outside.cells))
        count = len(self._corners)
        self._template = Template(_marker(count, frame_id))
        self._points = self._template.view(struct.pack("<d", _PROBE), (count, 3), "<f8")
        self._colours = self._template.view(struct.pack("<f", _COLOUR_PROBE), (count, 4), "<f4")

    def pack(self, stamp: int, positions: NDArray[np.float64], values: NDArray[np.float64]) -> bytes:
        """Return the serialised marker.

        Args:
            stamp: stamp of the header [ns].
            positions: positions of the vertices (n, 3) [m].
            values: values of the cells (m,); the colours range from the smallest to the largest value.
        """
        self._points[:] = self._outside.at(positions)[self._corners]
        self._colours[:, :3] = colour(values)[self._cells]
        self._colours[:, 3] = 1.0
        return self._template.stamped(stamp)


def _marker(count: int, frame_id: str) -> Marker:
    """Return a marker whose first point and first colour have values that can be found in the serialised bytes."""
    marker = Marker(header=Header(frame_id=frame_id), ns="surface", type=Marker.TRIANGLE_LIST, action=Marker.ADD)
    marker.scale.x = marker.scale.y = marker.scale.z = 1.0
    marker.color.a = 1.0
    marker.points = [Point() for _ in range(count)]
    marker.colors = [ColorRGBA() for _ in range(count)]
    marker.points[0].x = _PROBE
    marker.colors[0].r = _COLOUR_PROBE
    return marker
