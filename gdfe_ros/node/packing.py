# SPDX-License-Identifier: Apache-2.0
"""Templates for the messages of every step: clouds of vertices and cells, poses, wrenches, frames.

Filling a message object and serialising it by rclpy takes 20 to 40 us, and milliseconds for lists of points. Writing
stamp and numbers into the bytes of an already serialised message takes 2 to 5 us.
"""

from __future__ import annotations

import array
import struct
from collections.abc import Sequence
from typing import Any

import numpy as np
from geometry_msgs.msg import TransformStamped
from numpy.typing import NDArray
from rclpy.serialization import serialize_message
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import Imu, PointCloud2

from gdfe_ros.constraints import Pose
from gdfe_ros.element_fields import ElementFields
from gdfe_ros.node import messages
from gdfe_ros.node.frames import Placement
from gdfe_ros.node.interface import topics
from gdfe_ros.node.messages import MESH_FIELDS, STRAIN_FIELDS, VELOCITY_FIELDS
from gdfe_ros.node.qos import interface_class
from gdfe_ros.solver.motion.imu import ImuReading

_STAMP_AT = 4
"""Offset of the stamp [B]: the stamp of the message's header follows the four bytes of the CDR head."""
_MARK = -1.2345678901234567e300
_MARK_SECONDS = 0x5EC0_0000
_NO_TURN = (0.0, 0.0, 0.0, 1.0)


class Template:
    """The serialised bytes of a message with a header.

    Args:
        message: message of the final size, with marker values where numbers will be written.
    """

    def __init__(self, message: Any) -> None:
        self._bytes = bytearray(serialize_message(message))

    def view(self, mark: bytes, shape: tuple[int, ...], kind: str) -> NDArray[Any]:
        """Return a writable view of the numbers that begin at the bytes ``mark``; ``kind`` is their numpy type."""
        count = int(np.prod(shape))
        return np.frombuffer(self._bytes, kind, count, self._bytes.index(mark)).reshape(shape)

    def filled(self) -> bytes:
        """Return the message with its present numbers."""
        return bytes(self._bytes)

    def stamped(self, stamp: int) -> bytes:
        """Return the message with its present numbers and a stamp [ns]."""
        struct.pack_into("<iI", self._bytes, _STAMP_AT, stamp // 10**9, stamp % 10**9)
        return bytes(self._bytes)


class MeshPacker:
    """Serialises vertices into the message that ``messages.mesh_cloud`` makes.

    Args:
        rest: (n, 3) undeformed vertices [m].
        frame_id: frame of the coordinates.
    """

    def __init__(self, rest: NDArray[np.float64], frame_id: str) -> None:
        self._rest = rest
        cloud = messages.mesh_cloud(messages.header(0, frame_id), rest, rest)
        self._template, self._values = _cloud_template(cloud, (len(rest), len(MESH_FIELDS)))

    def pack(self, stamp: int, positions: NDArray[np.float64]) -> bytes:
        """Serialise positions (n, 3) [m] with a stamp [ns]."""
        self._values[:, :3] = positions
        np.subtract(positions, self._rest, out=self._values[:, 3:], casting="same_kind")
        return self._template.stamped(stamp)


class VelocityPacker:
    """Serialises vertices and their velocities into the message that ``messages.velocity_cloud`` makes.

    Args:
        rest: (n, 3) undeformed vertices [m].
        frame_id: frame of the coordinates and the velocities.
    """

    def __init__(self, rest: NDArray[np.float64], frame_id: str) -> None:
        cloud = messages.velocity_cloud(messages.header(0, frame_id), rest, np.zeros_like(rest))
        self._template, self._values = _cloud_template(cloud, (len(rest), len(VELOCITY_FIELDS)))

    def pack(self, stamp: int, positions: NDArray[np.float64], velocities: NDArray[np.float64]) -> bytes:
        """Serialise positions (n, 3) [m] and velocities (n, 3) [m/s] with a stamp [ns]."""
        self._values[:, :3], self._values[:, 3:] = positions, velocities
        return self._template.stamped(stamp)


class StrainPacker:
    """Serialises element fields into the message that ``messages.strain_cloud`` makes.

    Args:
        fields: element fields of the body in any state.
        frame_id: frame of the centroids' coordinates.
    """

    def __init__(self, fields: ElementFields, frame_id: str) -> None:
        cloud = messages.strain_cloud(messages.header(0, frame_id), fields)
        self._template, self._values = _cloud_template(cloud, (len(fields.J), len(STRAIN_FIELDS)))

    def pack(self, stamp: int, fields: ElementFields) -> bytes:
        """Serialise fields with a stamp [ns]."""
        self._values[:, :3] = fields.centroids
        for column, name in enumerate(STRAIN_FIELDS[3:], start=3):
            self._values[:, column] = getattr(fields, name)
        return self._template.stamped(stamp)


class PosePacker:
    """Serialises poses into the message that ``messages.pose_stamped`` makes.

    Args:
        frame_id: frame of the poses.
    """

    def __init__(self, frame_id: str) -> None:
        message = messages.pose_stamped(messages.header(0, frame_id), Pose())
        message.pose.position.x = _MARK
        self._template = Template(message)
        self._values = self._template.view(struct.pack("<d", _MARK), (7,), "<f8")

    def pack(self, stamp: int, pose: Pose) -> bytes:
        """Serialise a pose with a stamp [ns]."""
        self._values[:3] = pose.translation
        self._values[3:] = Rotation.from_rotvec(pose.rotation).as_quat() if any(pose.rotation) else _NO_TURN
        return self._template.stamped(stamp)


class WrenchPacker:
    """Serialises reactions into the message that ``messages.wrench_stamped`` makes.

    Args:
        frame_id: frame of the wrenches.
    """

    def __init__(self, frame_id: str) -> None:
        reaction = np.array([_MARK, 0.0, 0.0, 0.0, 0.0, 0.0])
        self._template = Template(messages.wrench_stamped(messages.header(0, frame_id), reaction))
        self._values = self._template.view(struct.pack("<d", _MARK), (6,), "<f8")

    def pack(self, stamp: int, reaction: NDArray[np.float64]) -> bytes:
        """Serialise a reaction (6,), force [N] then moment [N m], with a stamp [ns]."""
        self._values[:] = reaction
        return self._template.stamped(stamp)


class ImuPacker:
    """Serialises readings of an inertial measurement unit into the message that ``messages.imu`` makes.

    Args:
        frame_id: frame of the unit.
    """

    def __init__(self, frame_id: str) -> None:
        message = Imu(header=messages.header(0, frame_id))
        message.orientation.x = _MARK
        self._template = Template(message)
        # Each of the three is followed by a covariance of 9 numbers.
        values = self._template.view(struct.pack("<d", _MARK), (4 + 9 + 3 + 9 + 3,), "<f8")
        self._orientation, self._turn, self._felt = values[:4], values[13:16], values[25:28]

    def pack(self, stamp: int, reading: ImuReading) -> bytes:
        """Serialise a reading with a stamp [ns]."""
        self._orientation[:] = reading.orientation.as_quat()
        self._turn[:], self._felt[:] = reading.angular_velocity, reading.linear_acceleration
        return self._template.stamped(stamp)


class TransformPacker:
    """Serialises the placements of frames into messages for /tf.

    Args:
        names: names of the frames.
        parents: name of the parent of each frame.
    """

    def __init__(self, names: Sequence[str], parents: Sequence[str]) -> None:
        kind = interface_class(topics.TF.type)
        marks = [_MARK * (1 + place) for place in range(len(names))]
        seconds = [_MARK_SECONDS + place for place in range(len(names))]
        transforms = []
        for name, parent, mark, second in zip(names, parents, marks, seconds, strict=True):
            transform = TransformStamped(header=messages.header(second * 10**9, parent), child_frame_id=name)
            transform.transform.translation.x = mark
            transforms.append(transform)
        self._template = Template(kind(transforms=transforms))
        self._places = [self._template.view(struct.pack("<d", mark), (7,), "<f8") for mark in marks]
        self._stamps = [self._template.view(struct.pack("<i", second), (2,), "<i4") for second in seconds]

    def pack(self, stamp: int, places: Sequence[Placement]) -> bytes:
        """Serialise the placements of the frames, in the order of their names, with a stamp [ns]."""
        for values, time, place in zip(self._places, self._stamps, places, strict=True):
            time[:] = stamp // 10**9, stamp % 10**9
            values[:3], values[3:] = place.origin, place.turn.as_quat()
        return self._template.filled()


def _cloud_template(cloud: PointCloud2, shape: tuple[int, int]) -> tuple[Template, NDArray[np.float32]]:
    """Return a template of a cloud, and a writable float32 view of the points' values with the given shape."""
    mark = struct.pack("<d", _MARK)
    cloud.data = array.array("B", mark + bytes(cloud.data[len(mark) :]))
    template = Template(cloud)
    return template, template.view(mark, shape, "<f4")
