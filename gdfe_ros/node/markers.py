# SPDX-License-Identifier: Apache-2.0
"""Markers for RViz and Foxglove: the body's surface, obstacles, rigid bodies and contact forces.

The marker of a surface contains lists of Point and ColorRGBA objects; filling and serialising 10 000 of them takes
17 ms. Values are therefore written into a serialised template.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping

import numpy as np
from geometry_msgs.msg import Point, Quaternion, Vector3
from geometry_msgs.msg import Pose as PoseMessage
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from gdfe_ros.colour_map import colour
from gdfe_ros.constraints import Pose
from gdfe_ros.constraints.form import Box, Capsule, Cylinder, Sphere, TriangleMesh
from gdfe_ros.constraints.obstacle import Obstacle
from gdfe_ros.constraints.rigid_body import RigidBody
from gdfe_ros.mesh import HexMesh
from gdfe_ros.mesh.solid import Solid
from gdfe_ros.node.messages import Template
from gdfe_ros.scene.scene import Scene

_PROBE = -1.2345678901234567e300
_COLOUR_PROBE = -1.2345678e30
SHEET = (4.0, 0.005)
"""Edge and thickness of the sheet that represents a plane, divided by the extent of all meshes."""
MOST_TRIANGLES = 4000
"""Largest number of triangles of an obstacle's mesh in a message. In a finer mesh, neighbouring vertices are merged."""
LONGEST = 0.3
"""Length of the arrow for the largest force so far, divided by the body's size."""
_OBSTACLE, _BODY = (0.55, 0.57, 0.6, 0.6), (0.9, 0.55, 0.2, 1.0)
_STICKS, _SLIPS = (0.1, 0.7, 0.2, 1.0), (0.9, 0.1, 0.1, 1.0)
_SHAFT, _HEAD = 0.01, 0.02
"""Diameters of an arrow's shaft and head, divided by the body's size."""


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


class ContactMarkers:
    """Makes the markers of a step, in the namespaces ``obstacles``, ``bodies``, ``links`` and ``forces``.

    A plane is drawn as a sheet. The centre of the sheet is the projection of the undeformed body's centre onto the
    plane. Each contact force is an arrow that begins at its contact point: green if the point sticks, red if it slips.

    Args:
        scene: scene with the obstacles and rigid bodies.
    """

    def __init__(self, scene: Scene) -> None:
        self._things = [handle for handle in scene.handles if isinstance(handle, Obstacle)]
        self._size, self._extent = scene.mesh.size, scene.mesh.extent
        self._middle = scene.mesh.bounds.mean(axis=0)
        self._largest = 0.0
        meshes = [thing for thing in self._things if isinstance(thing.form, TriangleMesh)]
        self._triangles = {thing.name: _corners(thing.form.solid) for thing in meshes}

    def message(self, head: Header, poses: Mapping[str, Pose], points: NDArray[np.void]) -> MarkerArray:
        """Return the markers of obstacles, rigid bodies and contact forces.

        Args:
            head: header of all markers, in the node's frame.
            poses: poses of obstacles and rigid bodies by name, relative to rest.
            points: contact points, as `gdfe_ros.contacts.POINT`.
        """
        # Delete all markers of the last message, including arrows of points that no longer touch.
        markers = [Marker(header=head, action=Marker.DELETEALL)]
        counts: dict[str, int] = {}
        for thing in self._things:
            for kind, size, shift in self._parts(thing, poses[thing.name]):
                origin, axes = thing.frame(poses[thing.name])
                marker = Marker(header=head, ns=thing.section, id=counts.get(thing.section, 0), type=kind)
                counts[thing.section] = marker.id + 1
                marker.pose, marker.scale = _pose(origin + axes @ shift, axes), Vector3(**_named(size))
                marker.color = _colour(_BODY if isinstance(thing, RigidBody) else _OBSTACLE)
                marker.points = self._triangles.get(thing.name, [])
                markers.append(marker)
        return MarkerArray(markers=[*markers, *self._arrows(head, points)])

    def _parts(self, thing: Obstacle, pose: Pose) -> Iterator[tuple[int, tuple[float, ...], NDArray[np.float64]]]:
        """Yield the type, the size (3,) [m] and the position (3,) [m] of each marker that draws an obstacle's shape.

        The position is in the obstacle's frame.
        """
        match thing.form:
            case Sphere(radius):
                yield Marker.SPHERE, (2.0 * radius,) * 3, np.zeros(3)
            case Box(size):
                yield Marker.CUBE, size, np.zeros(3)
            case Cylinder(radius, length) | Capsule(radius, length):
                yield Marker.CYLINDER, (2.0 * radius, 2.0 * radius, length), np.zeros(3)
                for end in (-0.5, 0.5) if isinstance(thing.form, Capsule) else ():
                    yield Marker.SPHERE, (2.0 * radius,) * 3, np.array([0.0, 0.0, end * length])
            case TriangleMesh():
                yield Marker.TRIANGLE_LIST, (1.0, 1.0, 1.0), np.zeros(3)
            case _:
                origin, axes = thing.frame(pose)
                edge, thickness = (share * self._extent for share in SHEET)
                foot = axes.T @ (self._middle - origin)
                yield Marker.CUBE, (edge, edge, thickness), np.array([foot[0], foot[1], -0.5 * thickness])

    def _arrows(self, head: Header, points: NDArray[np.void]) -> Iterator[Marker]:
        places = np.stack([points[name] for name in "xyz"], axis=1).astype(float)
        forces = np.stack([points[f"f{name}"] + points[f"t{name}"] for name in "xyz"], axis=1).astype(float)
        self._largest = max(self._largest, np.linalg.norm(forces, axis=1).max(initial=0.0))
        tips = places + forces * (LONGEST * self._size / max(self._largest, np.finfo(float).tiny))
        for number, (place, tip, slips) in enumerate(zip(places, tips, points["slips"], strict=True)):
            marker = Marker(header=head, ns="forces", id=number, type=Marker.ARROW)
            marker.points = [Point(**_named(place)), Point(**_named(tip))]
            marker.pose.orientation.w = 1.0
            marker.scale = Vector3(x=_SHAFT * self._size, y=_HEAD * self._size)
            marker.color = _colour(_SLIPS if slips else _STICKS)
            yield marker


def _corners(solid: Solid) -> list[Point]:
    """Return the corners of a solid's triangles, three for each triangle; at most `MOST_TRIANGLES` triangles remain."""
    corners, cell = solid.vertices[solid.triangles], solid.size / 512.0
    while len(corners) > MOST_TRIANGLES:
        near, place = np.unique(np.round(solid.vertices / cell), axis=0, return_inverse=True)
        ids = place.reshape(-1)[solid.triangles]
        flat = (ids == np.roll(ids, 1, axis=1)).any(axis=1)
        corners, cell = cell * near[ids[~flat]], 1.3 * cell
    return [Point(**_named(corner)) for corner in corners.reshape(-1, 3)]


def _pose(origin: NDArray[np.float64], axes: NDArray[np.float64]) -> PoseMessage:
    turn = map(float, Rotation.from_matrix(axes).as_quat())
    return PoseMessage(position=Point(**_named(origin)), orientation=Quaternion(**dict(zip("xyzw", turn, strict=True))))


def _named(vector: NDArray[np.float64] | tuple[float, ...]) -> dict[str, float]:
    return dict(zip("xyz", map(float, vector), strict=True))


def _colour(values: tuple[float, float, float, float]) -> ColorRGBA:
    return ColorRGBA(**dict(zip("rgba", values, strict=True)))
