# SPDX-License-Identifier: Apache-2.0
"""Messages with a header, written as bytes (CDR) from the tables of `message_tables`; without ROS.

Filling a message object of ROS and serialising it takes 20 to 40 us, and milliseconds for lists of points. Writing
stamp and numbers into the bytes of an earlier message takes 2 to 5 us.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.recording.message_tables import IMU, JOINTS, PLACE, POSE, WRENCH, Table, tables_of
from gdfe_ros.recording.step import Step
from gdfe_ros.scene.scene import Scene

STAMP_AT = 4
"""Offset of the stamp [B]: the stamp of the message's header follows the four bytes of the CDR head."""
_DATATYPES = {"f": 7, "i": 5}
"""Codes of FLOAT32 and INT32 in ``sensor_msgs/msg/PointField``, by numpy's kind."""
_IMU_PLACES = [*range(4), *range(4 + 9, 16), *range(16 + 9, 28)]
"""Indices of the measured numbers of an Imu message; 9 numbers of a covariance follow each of its three fields."""


class Cdr:
    """Bytes of a message in CDR, little endian: each number is aligned to its size, counted from the head's end."""

    def __init__(self) -> None:
        self.data = bytearray(b"\0\1\0\0")

    def put(self, kind: str, *values: float) -> None:
        """Append numbers of one type, given by its letter in `struct`; without numbers, append no padding either."""
        if values:
            self.make_room(struct.calcsize(kind), 0)
            self.data += struct.pack(f"<{len(values)}{kind}", *values)

    def put_text(self, text: str) -> None:
        """Append a text."""
        data = text.encode() + b"\0"
        self.put("I", len(data))
        self.data += data

    def put_header(self, frame_id: str) -> None:
        """Append a header with stamp 0."""
        self.put("I", 0, 0)
        self.put_text(frame_id)

    def make_room(self, size: int, count: int) -> int:
        """Append ``count`` aligned zeros of ``size`` [B] each; return the offset of the first one."""
        self.data += bytes((STAMP_AT - len(self.data)) % size)
        self.data += bytes(size * count)
        return len(self.data) - size * count


def pack_text(text: str) -> bytes:
    """Return a serialised ``std_msgs/msg/String``."""
    message = Cdr()
    message.put_text(text)
    return bytes(message.data)


def put_stamp(data: bytearray, stamp: int) -> bytes:
    """Write a stamp [ns] into a serialised message that begins with a header; return the message as bytes."""
    struct.pack_into("<iI", data, STAMP_AT, stamp // 10**9, stamp % 10**9)
    return bytes(data)


class Packer:
    """Serialises tables of numbers into messages of a topic.

    Args:
        kind: columns of the tables: a dtype of `gdfe_ros.recording.message_tables` other than `JOINTS`.
        frame_id: frame in the header.
        count: rows of each table.
    """

    def __init__(self, kind: np.dtype, frame_id: str, count: int = 1) -> None:
        message, names = Cdr(), kind.names
        message.put_header(frame_id)
        alike = np.dtype(kind[0]) if len({kind[name] for name in names}) == 1 else kind
        shape = (count, len(names)) if alike is not kind else (count,)
        if kind in (POSE, WRENCH, PLACE):
            start = message.make_room(8, len(names))
        elif kind == IMU:
            shape, start = (1, _IMU_PLACES[-1] + 1), message.make_room(8, _IMU_PLACES[-1] + 1 + 9)
        else:
            start = _put_cloud(message, kind, count)
        self._data = message.data
        self._values = np.frombuffer(self._data, alike, int(np.prod(shape)), start).reshape(shape)
        self._rows = np.empty((1, len(names))) if kind == IMU else self._values

    def pack(self, stamp: int, write: Callable[[NDArray[Any]], None]) -> bytes:
        """Serialise the table that ``write`` writes into an array, with a stamp [ns].

        The array is (count, columns) if all columns have one type, else a structured array (count,).
        """
        write(self._rows)
        if self._values is not self._rows:
            self._values[:, _IMU_PLACES] = self._rows
        return put_stamp(self._data, stamp)


def _put_cloud(message: Cdr, kind: np.dtype, count: int) -> int:
    """Append the fields of a PointCloud2 behind its header; return the offset of its points."""
    message.put("I", 1, count, len(kind.names))
    for name in kind.names:
        message.put_text(name)
        message.put("I", kind.fields[name][1])
        message.put("B", _DATATYPES[kind[name].kind])
        message.put("I", 1)
    message.put("B", False)
    message.put("I", kind.itemsize, kind.itemsize * count, kind.itemsize * count)
    start = message.make_room(1, kind.itemsize * count)
    message.put("B", True)
    return start


def packers(scene: Scene, frame: Callable[[str], str]) -> dict[str, Callable[[Step], bytes]]:
    """Return a dict from topic, without the node's name, to the function that makes its message of a step.

    Args:
        scene: scene of the steps.
        frame: function that returns the full name of a table's frame; an empty name is the frame of the rest shape.
    """
    joints = [*(each.name for each in scene.actuators), *(joint.name for arm in scene.arms for joint in arm.joints)]
    tables = {topic: _packer(table, frame(table.frame), joints) for topic, table in tables_of(scene).items()}
    return {"step_record": lambda step: pack_text(step.record.to_json()), **tables}


def _packer(table: Table, frame_id: str, joints: Sequence[str]) -> Callable[[Step], bytes]:
    """Return the function that makes the message of a step on the topic of a table.

    Args:
        table: table of the topic.
        frame_id: frame in the header.
        joints: names of the rows of a table of `JOINTS`.
    """
    if table.write is not None:
        packer = Packer(table.kind, frame_id, table.count)
        return lambda step: packer.pack(step.record.stamp, partial(table.write, step))
    if table.kind == JOINTS:
        return lambda step: _pack_joints(step.record.stamp, frame_id, joints, table.make(step))
    return lambda step: _pack_points(step.record.stamp, frame_id, table.make(step))


def _pack_joints(stamp: int, frame_id: str, names: Sequence[str], rows: NDArray[np.void]) -> bytes:
    """Return a serialised JointState."""
    message = Cdr()
    message.put_header(frame_id)
    message.put("I", len(names))
    for name in names:
        message.put_text(name)
    for column in JOINTS.names:
        message.put("I", len(rows))
        message.put("d", *rows[column])
    return put_stamp(message.data, stamp)


def _pack_points(stamp: int, frame_id: str, rows: NDArray[np.void]) -> bytes:
    """Return a serialised cloud of any number of points."""
    return Packer(rows.dtype, frame_id, len(rows)).pack(stamp, partial(np.copyto, src=rows))
