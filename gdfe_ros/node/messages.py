# SPDX-License-Identifier: Apache-2.0
"""Messages of rclpy: poses, arrays, frames on /tf, and markers for RViz and Foxglove.

The marker of a surface contains lists of Point and ColorRGBA objects; filling and serialising 10 000 of them takes
17 ms. Values are therefore written into a serialised template. Bytes are passed as ``array.array``, the one type that
is fast with and without rclpy's field checks.
"""

from __future__ import annotations

import array
import json
import math
import struct
from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, PoseStamped, Quaternion, Vector3
from geometry_msgs.msg import Pose as PoseMessage
from numpy.typing import NDArray
from rclpy.serialization import serialize_message
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState
from std_msgs.msg import ColorRGBA, Float64MultiArray, Header, Int32MultiArray, MultiArrayDimension, MultiArrayLayout
from visualization_msgs.msg import Marker, MarkerArray

from gdfe_ros.actuators import Actuator
from gdfe_ros.colour_map import colour
from gdfe_ros.constraints import Pose
from gdfe_ros.constraints.form import Box, Capsule, Cylinder, Sphere, TriangleMesh
from gdfe_ros.constraints.obstacle import Obstacle
from gdfe_ros.constraints.rigid_body import RigidBody
from gdfe_ros.mesh import HexMesh
from gdfe_ros.mesh.surfaces.solid import Solid
from gdfe_ros.node.frames import Placement
from gdfe_ros.node.refusals import LONGEST, Refusal
from gdfe_ros.recording.packing import Cdr, pack_text, put_stamp
from gdfe_ros.results.contacts import places_and_forces
from gdfe_ros.scene.scene import Scene
from gdfe_ros.untrusted.bounded_text import shorten


def to_time(nanoseconds: int) -> Time:
    """Return a time in nanoseconds as a Time message."""
    return Time(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)


def header(stamp: int, frame_id: str) -> Header:
    """Return a header with a stamp [ns]."""
    return Header(stamp=to_time(stamp), frame_id=frame_id)


def by_axis(values: Iterable[float], axes: str = "xyz") -> dict[str, float]:
    """Return a dict from axis, e.g. ``x``, to component: the arguments of a message with a vector or quaternion."""
    return dict(zip(axes, map(float, values), strict=True))


def pose_message(translation: Iterable[float], quaternion: Iterable[float]) -> PoseMessage:
    """Return the message of a translation (3,) [m] and a quaternion (x, y, z, w)."""
    position, orientation = Point(**by_axis(translation)), Quaternion(**by_axis(quaternion, "xyzw"))
    return PoseMessage(position=position, orientation=orientation)


def pose_stamped(head: Header, pose: Pose, quaternion: Iterable[float] | None = None) -> PoseStamped:
    """Return the message of a pose relative to rest.

    Args:
        head: header of the message.
        pose: pose relative to rest.
        quaternion: unit quaternion of the pose's rotation; None: it is computed from the rotation vector.
    """
    turn = Rotation.from_rotvec(pose.rotation).as_quat() if quaternion is None else quaternion
    return PoseStamped(header=head, pose=pose_message(pose.translation, turn))


def topology(cells: NDArray[np.int32]) -> Int32MultiArray:
    """Return a message with the vertex ids of the cells (m, c), row by row."""
    data = array.array("i")
    data.frombytes(np.ascontiguousarray(cells, dtype=np.int32).tobytes())
    return Int32MultiArray(layout=_layout(("cells", "corners"), cells.shape), data=data)


def _layout(labels: Sequence[str], shape: Sequence[int]) -> MultiArrayLayout:
    """Return the layout message of an array of this shape in row-major order."""
    strides = np.cumprod(shape[::-1])[::-1]
    dimensions = [
        MultiArrayDimension(label=label, size=size, stride=int(stride))
        for label, size, stride in zip(labels, shape, strides, strict=True)
    ]
    return MultiArrayLayout(dim=dimensions, data_offset=0)


def actuation(actuators: Mapping[str, Actuator], values: Mapping[str, float]) -> JointState:
    """Return a message of commands by name: efforts in ``effort``, all others in ``position``."""
    forced = [name in actuators and actuators[name].mode.by_effort for name in values]
    pairs = list(zip(forced, map(float, values.values()), strict=True))
    return JointState(
        name=list(values),
        position=[math.nan if force else value for force, value in pairs],
        effort=[value if force else math.nan for force, value in pairs],
    )


def pack_refusal(source: str, refusal: Refusal, *, late: bool) -> bytes:
    """Return the serialised message about a command from ``source`` that was refused, as JSON text.

    ``late``: the step refused it, not the arrival.
    """
    entries = {"source": source, "reason": refusal.reason.value, "message": shorten(str(refusal), LONGEST)}
    return pack_text(json.dumps({**entries, "late": late}))


def jacobian(values: NDArray[np.float64], probes: list[str], actuators: list[str]) -> Float64MultiArray:
    """Return the message of a Jacobian (probes, 3, actuators); its layout's labels name probes, axes, actuators."""
    labels = (",".join(probes), "x,y,z", ",".join(actuators))
    data = array.array("d", np.ascontiguousarray(values, dtype=np.float64).tobytes())
    return Float64MultiArray(layout=_layout(labels, values.shape), data=data)


class TransformPacker:
    """Serialises the placements of frames into messages for /tf.

    Args:
        names: names of the frames.
        parents: name of the parent of each frame.
    """

    def __init__(self, names: Sequence[str], parents: Sequence[str]) -> None:
        message, offsets = Cdr(), []
        message.put("I", len(names))
        for name, parent in zip(names, parents, strict=True):
            stamp = message.make_room(4, 2)
            message.put_text(parent)
            message.put_text(name)
            offsets.append((stamp, message.make_room(8, 7)))
        self._data = message.data
        self._stamps = [np.frombuffer(self._data, "<i4", 2, stamp) for stamp, _ in offsets]
        self._places = [np.frombuffer(self._data, "<f8", 7, place) for _, place in offsets]

    def pack(self, stamp: int, places: Sequence[Placement]) -> bytes:
        """Serialise the placements of the frames, in the order of their names, with a stamp [ns]."""
        for values, time, place in zip(self._places, self._stamps, places, strict=True):
            time[:] = stamp // 10**9, stamp % 10**9
            values[:3], values[3:] = place.origin, place.turn.as_quat()
        return bytes(self._data)


_PROBE = -1.2345678901234567e300
_COLOUR_PROBE = -1.2345678e30
SHEET = (4.0, 0.005)
"""Edge and thickness of the sheet that represents a plane, divided by the extent of all meshes."""
MOST_TRIANGLES = 4000
"""Largest number of triangles of an obstacle's mesh in a message. In a finer mesh, neighbouring vertices are merged."""
_LONGEST_ARROW = 0.3
"""Length of the arrow for the largest force so far, divided by the body's size."""
_OBSTACLE, _BODY = (0.55, 0.57, 0.6, 0.6), (0.9, 0.55, 0.2, 1.0)
_STICKS, _SLIPS = (0.1, 0.7, 0.2, 1.0), (0.9, 0.1, 0.1, 1.0)
_SHAFT, _HEAD = 0.01, 0.02
"""Diameters of an arrow's shaft and head, divided by the body's size."""


class SurfaceMarker:
    """Makes serialised markers of a mesh's surface, or of the finer skin that is embedded in the mesh.

    Args:
        mesh: the undeformed body.
        frame_id: frame of the coordinates.
    """

    def __init__(self, mesh: HexMesh, frame_id: str) -> None:
        self._outside = mesh.outside
        self._corners = self._outside.triangles.reshape(-1)
        self._cells = np.repeat(self._outside.cells, len(self._corners) // len(self._outside.cells))
        count = len(self._corners)
        self._data = bytearray(serialize_message(_marker(count, frame_id)))
        starts = (self._data.index(struct.pack("<d", _PROBE)), self._data.index(struct.pack("<f", _COLOUR_PROBE)))
        self._points = np.frombuffer(self._data, "<f8", 3 * count, starts[0]).reshape(count, 3)
        self._colours = np.frombuffer(self._data, "<f4", 4 * count, starts[1]).reshape(count, 4)

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
        return put_stamp(self._data, stamp)


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
            points: contact points, as `gdfe_ros.results.contacts.POINT`.
        """
        # Delete all markers of the last message, including arrows of points that no longer touch.
        markers = [Marker(header=head, action=Marker.DELETEALL)]
        counts: dict[str, int] = {}
        for thing in self._things:
            for kind, size, shift in self._parts(thing, poses[thing.name]):
                origin, axes = thing.frame(poses[thing.name])
                marker = Marker(header=head, ns=thing.section, id=counts.get(thing.section, 0), type=kind)
                counts[thing.section] = marker.id + 1
                marker.pose = pose_message(origin + axes @ shift, Rotation.from_matrix(axes).as_quat())
                marker.scale = Vector3(**by_axis(size))
                marker.color = ColorRGBA(**by_axis(_BODY if isinstance(thing, RigidBody) else _OBSTACLE, "rgba"))
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
        places, forces = (each.astype(float) for each in places_and_forces(points))
        self._largest = max(self._largest, np.linalg.norm(forces, axis=1).max(initial=0.0))
        tips = places + forces * (_LONGEST_ARROW * self._size / max(self._largest, np.finfo(float).tiny))
        for number, (place, tip, slips) in enumerate(zip(places, tips, points["slips"], strict=True)):
            marker = Marker(header=head, ns="forces", id=number, type=Marker.ARROW)
            marker.points = [Point(**by_axis(place)), Point(**by_axis(tip))]
            marker.pose.orientation.w = 1.0
            marker.scale = Vector3(x=_SHAFT * self._size, y=_HEAD * self._size)
            marker.color = ColorRGBA(**by_axis(_SLIPS if slips else _STICKS, "rgba"))
            yield marker


def _corners(solid: Solid) -> list[Point]:
    """Return the corners of a solid's triangles, three for each triangle; at most `MOST_TRIANGLES` triangles remain."""
    corners, cell = solid.vertices[solid.triangles], solid.size / 512.0
    while len(corners) > MOST_TRIANGLES:
        near, place = np.unique(np.round(solid.vertices / cell), axis=0, return_inverse=True)
        ids = place.reshape(-1)[solid.triangles]
        flat = (ids == np.roll(ids, 1, axis=1)).any(axis=1)
        corners, cell = cell * near[ids[~flat]], 1.3 * cell
    return [Point(**by_axis(corner)) for corner in corners.reshape(-1, 3)]
