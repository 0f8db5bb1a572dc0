# SPDX-License-Identifier: Apache-2.0
"""Packing of arrays and results into ROS messages.

``PointCloud2`` contains float32, because RViz accepts nothing else for x, y, z. Bytes are passed as ``array.array``,
the one type that is fast with and without rclpy's field checks.
"""

from __future__ import annotations

import array
import json
import math
import struct
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import (
    Point,
    PoseStamped,
    Quaternion,
    TransformStamped,
    WrenchStamped,
)
from geometry_msgs.msg import (
    Pose as PoseMessage,
)
from numpy.typing import NDArray
from rclpy.serialization import serialize_message
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import Imu, JointState, PointCloud2, PointField
from std_msgs.msg import Float64MultiArray, Header, Int32MultiArray, MultiArrayDimension, MultiArrayLayout, String

from gdfe_ros.actuators import Actuator
from gdfe_ros.constraints import Pose
from gdfe_ros.node.command_messages import EFFORTS
from gdfe_ros.node.interface import topics
from gdfe_ros.node.plain_log import shorten
from gdfe_ros.node.qos import interface_class
from gdfe_ros.node.refusals import LONGEST, Refusal
from gdfe_ros.node.transforms import Placement
from gdfe_ros.recording.published import IMU, POSE, WRENCH

_STAMP_AT = 4
"""Offset of the stamp [B]: the stamp of the message's header follows the four bytes of the CDR head."""
_MARK = -1.2345678901234567e300
_MARK_SECONDS = 0x5EC0_0000
_IMU_PLACES = [*range(4), *range(4 + 9, 16), *range(16 + 9, 28)]
"""Places of the numbers of an Imu message; after each of its three vectors come the 9 numbers of a covariance."""


def to_time(nanoseconds: int) -> Time:
    """Return a time in nanoseconds as a Time message."""
    return Time(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)


def header(stamp: int, frame_id: str) -> Header:
    """Return a header with a stamp [ns]."""
    return Header(stamp=to_time(stamp), frame_id=frame_id)


def cloud(head: Header, points: NDArray[np.void]) -> PointCloud2:
    """Return a cloud with a point for each row of ``points``, whose columns are float32 or int32."""
    kinds = {"f": PointField.FLOAT32, "i": PointField.INT32}
    names, step = points.dtype.names, points.dtype.itemsize
    data = array.array("B")
    data.frombytes(points.tobytes())
    return PointCloud2(
        header=head,
        height=1,
        width=len(points),
        fields=[
            PointField(name=name, offset=4 * place, datatype=kinds[points.dtype[name].kind], count=1)
            for place, name in enumerate(names)
        ],
        is_bigendian=False,
        point_step=step,
        row_step=step * len(points),
        data=data,
        is_dense=True,
    )


def pose_stamped(head: Header, pose: Pose) -> PoseStamped:
    """Return the message of a pose relative to rest; its rotation vector becomes a unit quaternion."""
    x, y, z, w = map(float, Rotation.from_rotvec(pose.rotation).as_quat())
    px, py, pz = pose.translation
    return PoseStamped(
        header=head,
        pose=PoseMessage(position=Point(x=px, y=py, z=pz), orientation=Quaternion(x=x, y=y, z=z, w=w)),
    )


def topology(cells: NDArray[np.int32]) -> Int32MultiArray:
    """Return a message with the vertex ids of the cells (m, c), row by row."""
    count, corners = cells.shape
    data = array.array("i")
    data.frombytes(np.ascontiguousarray(cells, dtype=np.int32).tobytes())
    dimensions = [
        MultiArrayDimension(label="cells", size=count, stride=count * corners),
        MultiArrayDimension(label="corners", size=corners, stride=corners),
    ]
    return Int32MultiArray(layout=MultiArrayLayout(dim=dimensions, data_offset=0), data=data)


def joint_states(head: Header, names: Sequence[str], table: NDArray[np.void]) -> JointState:
    """Return the message of a table with the columns position, velocity and effort, and a row for each name."""
    return JointState(header=head, name=list(names), **{name: _doubles(table[name]) for name in table.dtype.names})


def actuation(actuators: Mapping[str, Actuator], values: Mapping[str, float]) -> JointState:
    """Return a message of commands by name: tensions and pressures in ``effort``, all others in ``position``."""
    forced = [name in actuators and actuators[name].mode in EFFORTS for name in values]
    pairs = list(zip(forced, map(float, values.values()), strict=True))
    return JointState(
        name=list(values),
        position=[math.nan if force else value for force, value in pairs],
        effort=[value if force else math.nan for force, value in pairs],
    )


def refused(source: str, refusal: Refusal) -> String:
    """Return the message about a command on topic ``source`` that was refused, as JSON text."""
    entries = {"source": source, "reason": refusal.reason.value, "message": shorten(str(refusal), LONGEST)}
    return String(data=json.dumps(entries))


def jacobian(values: NDArray[np.float64], probes: list[str], actuators: list[str]) -> Float64MultiArray:
    """Return the message of a Jacobian (probes, 3, actuators); its layout's labels name probes, axes, actuators."""
    labels = (",".join(probes), "x,y,z", ",".join(actuators))
    strides = np.cumprod(values.shape[::-1])[::-1]
    dimensions = [
        MultiArrayDimension(label=label, size=size, stride=int(stride))
        for label, size, stride in zip(labels, values.shape, strides, strict=True)
    ]
    return Float64MultiArray(layout=MultiArrayLayout(dim=dimensions, data_offset=0), data=_doubles(values))


class Template:
    """The serialised bytes of a message with a header, into which new numbers are written.

    Filling a message object and serialising it by rclpy takes 20 to 40 us, and milliseconds for lists of points.
    Writing stamp and numbers into the bytes of an already serialised message takes 2 to 5 us.

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


class Packer:
    """Serialises tables of numbers into messages of a topic.

    Args:
        kind: columns of the tables, one of those in `gdfe_ros.recording.published`.
        frame_id: frame in the header.
        count: rows of each table.
    """

    def __init__(self, kind: np.dtype, frame_id: str, count: int = 1) -> None:
        head, mark = header(0, frame_id), struct.pack("<d", _MARK)
        shape = (count, len(kind.names))
        if kind == POSE:
            message: Any = PoseStamped(header=head)
            message.pose.position.x = _MARK
        elif kind == WRENCH:
            message = WrenchStamped(header=head)
            message.wrench.force.x = _MARK
        elif kind == IMU:
            message, shape = Imu(header=head), (1, _IMU_PLACES[-1] + 1)
            message.orientation.x = _MARK
        else:
            message = cloud(head, np.zeros(count, kind))
            message.data = array.array("B", mark + bytes(message.data[len(mark) :]))
        self._template = Template(message)
        self._values = self._rows = self._template.view(mark, shape, kind[0].str)
        if kind == IMU:
            self._rows = np.empty((1, len(kind.names)))

    def pack(self, stamp: int, write: Callable[[NDArray[Any]], None]) -> bytes:
        """Serialise the table that ``write`` writes into an array (count, columns), with a stamp [ns]."""
        write(self._rows)
        if self._values is not self._rows:
            self._values[:, _IMU_PLACES] = self._rows
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
            transform = TransformStamped(header=header(second * 10**9, parent), child_frame_id=name)
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


def _doubles(values: NDArray[np.float64]) -> array.array:
    return array.array("d", np.ascontiguousarray(values, dtype=np.float64).tobytes())
