# SPDX-License-Identifier: Apache-2.0
"""Values in the messages of a robot's own topics, found by paths such as ``rigid_bodies[0].pose``."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gdfe_ros.analysis.message_values import cloud_values
from gdfe_ros.errors import GdfeError
from gdfe_ros.fitting.match import CommandModel, CompareModel
from gdfe_ros.recording.foreign_bag import ForeignBag
from gdfe_ros.recording.reader import BagReader
from gdfe_ros.untrusted.spelling import did_you_mean

_STEP = re.compile(r"\.?([A-Za-z_]\w*)|\[(-?\d+)\]|\[([A-Za-z_]\w*)=([^\]]*)\]")
_HOLDERS = ("pose", "transform", "wrench")
_PLACES = (("position", "orientation"), ("translation", "rotation"))


def follow(message: Any, path: str) -> Any:
    """Return the value at a path in a message; None if the message has no such item of a sequence.

    Args:
        message: the message.
        path: names of fields, separated by points; ``[k]`` is the k-th item of a sequence, from 0, and ``[name=text]``
            the first item whose field ``name`` is ``text``.

    Raises:
        GdfeError: the path has another form, or a message has no such field.
    """
    value, place = message, 0
    while place < len(path):
        step = _STEP.match(path, place)
        if step is None:
            raise GdfeError(f"path {path!r}: {path[place:]!r} is no field, [index] or [field=text]")
        field, index, key, text = step.groups()
        if field is not None:
            value = _field(value, field, path)
        elif index is not None:
            items = _items(value, path)
            if not -len(items) <= int(index) < len(items):
                return None
            value = items[int(index)]
        else:
            value = next((item for item in _items(value, path) if str(_field(item, key, path)) == text), None)
            if value is None:
                return None
        place = step.end()
    return value


def vector_of(part: Any, *, pose: bool) -> list[float] | None:
    """Return the numbers of a number, point, vector, pose, transform or wrench; None for any other value.

    Args:
        part: a message, or a value in it. Poses with a stamp or a covariance count as poses.
        pose: whether the rotation vector of a pose is appended to its position.
    """
    if isinstance(part, int | float | np.number):
        return [float(part)]
    if isinstance(part, np.ndarray) and part.ndim == 1 and len(part) in (1, 3):
        return part.astype(float).tolist()
    for place, turn in _PLACES:
        if hasattr(part, place) and hasattr(part, turn):
            point = getattr(part, place)
            return [point.x, point.y, point.z, *(_turn(getattr(part, turn)) if pose else [])]
    for name in (*_HOLDERS, "point", "vector", "force"):
        if hasattr(part, name):
            return vector_of(getattr(part, name), pose=pose)
    if all(hasattr(part, axis) for axis in "xyz") and not hasattr(part, "w"):
        return [part.x, part.y, part.z]
    return None


def _field(value: Any, name: str, path: str) -> Any:
    known = [key for key in getattr(value, "__dataclass_fields__", {}) if not key.startswith("_")]
    if name not in known:
        hint = did_you_mean(name, known)
        raise GdfeError(f"path {path!r}: there is no field {name!r}; {hint}fields: {', '.join(known) or 'none'}")
    return getattr(value, name)


def _items(value: Any, path: str) -> Any:
    if not isinstance(value, list | tuple | np.ndarray):
        raise GdfeError(f"path {path!r}: [...] belongs to a sequence, but this is {type(value).__name__}")
    return value


def _turn(orientation: Any) -> list[float]:
    quaternion = [orientation.x, orientation.y, orientation.z, orientation.w]
    return list(Rotation.from_quat(quaternion).as_rotvec()) if any(quaternion) else [0.0, 0.0, 0.0]


KNOWN = (
    "Pose", "PoseStamped", "PoseWithCovariance", "PoseWithCovarianceStamped", "PoseArray", "Odometry", "Point",
    "PointStamped", "Vector3", "Vector3Stamped", "Transform", "TransformStamped", "TFMessage", "tfMessage", "Marker",
    "MarkerArray", "Wrench", "WrenchStamped", "JointState", "Float64MultiArray", "Float64", "Float32", "FluidPressure",
    "PointCloud2",
)  # fmt: skip
"""Types of messages from which quantities or commands can be read without a `path`."""


_LATE = 0.1
"""Largest time [s] by which the stamps of a topic may go back, as for delayed messages; at most half of the time until
then. Stamps that go back farther belong to another run, or to a clock that was set back.
"""
_CALENDAR = 1e8
"""Stamps from this one on [s], of 1973, are those of a calendar's clock; earlier ones are those of a simulator."""


class TopicValues:
    """Reader of the times and values of a bag's topics.

    Args:
        reader: reader of the bag.

    Attributes:
        names: names of the topics that have messages.
        remarks: text about the messages that are left out because stamps go back; empty if there are none.
    """

    remarks: tuple[str, ...] = ()
    _end = math.inf

    def __init__(self, reader: BagReader | ForeignBag) -> None:
        self._reader, self._decode = reader, reader.decoder()
        self.names = sorted(name for name, count in reader.counts.items() if count)
        self._simulated: dict[str, bool] = {}

    def start(self, models: Sequence[CompareModel | CommandModel]) -> float:
        """Return the time [s] of the earliest message on the topics that the ``models`` name; 0 without topics.

        If the stamps of one of these topics go back, messages recorded later are not read from now on.
        """
        named = [model for model in models if model.topic]
        for model in named:
            self._require(model.topic, f"bag {self._reader.path}", path=model.path)
        start = min((self._time(model.topic, *next(self._messages(model.topic))) for model in named), default=0.0)
        for model in named:
            self._end_at_restart(model, start)
        return start

    def _end_at_restart(self, model: CompareModel | CommandModel, start: float) -> None:
        """End the reading where the stamps of a topic go back by more than `_LATE`; ``start`` [s] is time 0."""
        first = last = None
        for log, stamp, _ in self._samples(model):
            if first is None:
                first = last = stamp
            if last - stamp > min(_LATE, 0.5 * (last - first)):
                self._end, back = log, f"where the stamps of topic {model.topic} go back by {last - stamp:g} s"
                text = f"read only up to t = {last - start:g} s, {back}"
                self.remarks = (f"{text}: the run was restarted, or a clock was set back",)
                return
            last = max(last, stamp)

    def of(
        self, model: CompareModel | CommandModel, where: str, *, pose: bool = False
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return times (m,) [s] and values (m, d) of a topic.

        Args:
            model: entry of the match file that names the topic and the item in its messages.
            where: first words of error messages.
            pose: whether poses are returned with their rotation vectors, (m, 6).

        Raises:
            GdfeError: there is no such topic, or its messages have no such item.
        """
        self._require(model.topic, where, path=model.path)
        times, rows = [], []
        for _, stamp, part in self._samples(model):
            rows.append(_numbers(part, model, where, pose=pose))
            times.append(stamp)
        if not rows and self.remarks:
            raise GdfeError(f"{where}: topic {model.topic} has nothing before its end; the bag is {self.remarks[0]}")
        if not rows:
            what = model.path or model.frame_id or model.marker or model.joint
            raise GdfeError(f"{where}: topic {model.topic} never has {what!r}; it has {', '.join(self._list(model))}")
        order = np.argsort(times, kind="stable")
        found, first = np.unique(np.array(times)[order], return_index=True)
        return found, np.array(rows, dtype=np.float64)[order][first]

    def clouds(self, model: CompareModel, where: str) -> tuple[NDArray[np.float64], list[NDArray[np.float64]]]:
        """Return times (m,) [s] and points (p, 3) [m] of each PointCloud2; points that are not finite are left out."""
        self._require(model.topic, where)
        times, clouds = [], []
        for _, stamp, message in self._samples(model):
            if not hasattr(message, "point_step"):
                kind = self._reader.topics[model.topic].type
                raise GdfeError(f"{where}: topic {model.topic} is {kind}; a PointCloud2 is needed")
            columns = cloud_values(message)
            points = np.stack([columns[axis] for axis in "xyz"], axis=1).astype(np.float64)
            times.append(stamp)
            clouds.append(points[np.isfinite(points).all(axis=1)])
        return np.array(times), clouds

    def _require(self, topic: str, where: str, *, path: str | None = None) -> None:
        if topic not in self.names:
            hint = did_you_mean(topic, self.names)
            raise GdfeError(f"{where}: no message on topic {topic!r}; {hint}topics: {', '.join(self.names)}")
        kind = self._reader.topics[topic].type
        if path is None and kind.rpartition("/")[2] not in KNOWN:
            remedy = "remedy: `path`, e.g. `path: rigid_bodies[0].pose.position`"
            raise GdfeError(f"{where}: topic {topic} has the type {kind}; known: {', '.join(KNOWN)}; {remedy}")

    def _samples(self, model: CompareModel | CommandModel) -> Iterator[tuple[float, float, Any]]:
        """Yield recording time [s], stamp [s] and part for each part of a message that ``model`` selects."""
        for log, message in self._messages(model.topic):
            if log >= self._end:
                return
            for part in _parts(message, model):
                timed = part if hasattr(part, "header") and not model.path else message
                yield log, self._time(model.topic, log, timed), part

    def _time(self, topic: str, log: float, message: Any) -> float:
        """Return the stamp [s] of a message of a topic; if it has none, its recording time ``log`` [s].

        The stamp 0 is a time if other stamps of the topic are those of a simulator; otherwise it was not set.
        """
        stamp = _stamp(message)
        if stamp == 0.0 and topic not in self._simulated:
            stamps = (_stamp(each) for _, each in self._messages(topic))
            self._simulated[topic] = next((each for each in stamps if each), _CALENDAR) < _CALENDAR
        return log if stamp is None or (stamp == 0.0 and not self._simulated[topic]) else stamp

    def _messages(self, topic: str) -> Iterator[tuple[float, Any]]:
        for message in self._reader.messages([topic]):
            yield 1e-9 * message.log_time, self._decode(message.type, message.data)

    def _list(self, model: CompareModel | CommandModel) -> list[str]:
        """Return the names of all items in the messages of a topic, sorted."""
        found: set[str] = set()
        for _, message in self._messages(model.topic):
            found |= {_label(part) for part in _every(message)}
        return sorted(found)


def _every(message: Any) -> list[Any]:
    return list(getattr(message, "transforms", None) or getattr(message, "markers", None) or [message])


def _label(part: Any) -> str:
    if hasattr(part, "child_frame_id"):
        return part.child_frame_id
    return f"{part.ns}/{part.id}" if hasattr(part, "ns") else ", ".join(getattr(part, "name", []))


def _parts(message: Any, model: CompareModel | CommandModel) -> list[Any]:
    """Return the parts of a message that ``model`` selects: a path, a frame's transform, a marker, or all of it."""
    if model.path:
        found = follow(message, model.path)
        return [] if found is None else [found]
    if model.joint and hasattr(message, "effort"):  # several publishers may each name their own joints
        return [message] if model.joint in message.name else []
    wanted = model.frame_id or model.marker
    return [part for part in _every(message) if wanted is None or _label(part) == wanted]


def _numbers(part: Any, model: CompareModel | CommandModel, where: str, *, pose: bool) -> list[float]:
    if (found := vector_of(part, pose=pose)) is not None:
        return found
    if hasattr(part, "poses"):
        if len(part.poses) == 1:
            return vector_of(part.poses[0], pose=pose)
        text = f"{where}: topic {model.topic} has {len(part.poses)} poses a message"
        raise GdfeError(f"{text}; remedy: `path: poses[0]`")
    if hasattr(part, "fluid_pressure"):
        return [part.fluid_pressure]
    if hasattr(part, "effort"):
        return [_joint(part, model, where)]
    if model.path and not hasattr(part, "data"):
        text = f"{where}: `path: {model.path}` of topic {model.topic} leads to {type(part).__name__}"
        raise GdfeError(f"{text}; remedy: a path to a number, a point, a vector or a pose")
    data = np.atleast_1d(part.data)
    place = int(model.joint or 0)
    if not 0 <= place < data.size:
        raise GdfeError(
            f"{where}: joint {place} of topic {model.topic}; it has {data.size} numbers, 0 to {data.size - 1}"
        )
    return [float(data[place])]


def _joint(part: Any, model: CompareModel | CommandModel, where: str) -> float:
    names, values = list(part.name), getattr(part, model.field)
    if model.joint not in names:
        raise GdfeError(f"{where}: `joint: {model.joint}` is not in topic {model.topic}; it has {', '.join(names)}")
    if names.index(model.joint) >= len(values):
        raise GdfeError(f"{where}: topic {model.topic} has no {model.field} of {model.joint}; remedy: another `field`")
    return float(values[names.index(model.joint)])


def _stamp(message: Any) -> float | None:
    """Return the stamp of a message's header [s]; None for a message without a header."""
    header = getattr(message, "header", None)
    if header is None and _every(message) != [message]:
        header = getattr(_every(message)[0], "header", None)
    return None if header is None else header.stamp.sec + 1e-9 * header.stamp.nanosec
