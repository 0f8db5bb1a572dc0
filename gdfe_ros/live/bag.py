# SPDX-License-Identifier: Apache-2.0
"""Bag of a live session, recorded without ROS; it has the contents of a node's bag, and `gdfe replay` repeats it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore

from gdfe_ros.analysis.message_values import Values
from gdfe_ros.analysis.published import Publication
from gdfe_ros.contacts import contact_names
from gdfe_ros.node.interface import NODE_NAME, topics
from gdfe_ros.node.interface.scene_topics import state_topics
from gdfe_ros.recording.provenance import RunInfo
from gdfe_ros.recording.recorder import BackPressure, QueueOptions, Recorder
from gdfe_ros.recording.step import Step
from gdfe_ros.recording.topic import TopicInfo
from gdfe_ros.simulation import Simulation

_DATATYPES = {"f4": 7, "i4": 5}
"""Codes of data types in ``sensor_msgs/msg/PointField``, by numpy's name."""
_CLOUD, _JOINTS, _TEXT = "sensor_msgs/msg/PointCloud2", "sensor_msgs/msg/JointState", "std_msgs/msg/String"


class Messages:
    """Makes serialised messages and describes their types.

    Args:
        joints: names of the entries of a JointState.
    """

    def __init__(self, *, joints: Sequence[str] = ()) -> None:
        self._store, self._joints = get_typestore(Stores.ROS2_JAZZY), list(joints)

    def topic(self, name: str, kind: str, role: str) -> TopicInfo:
        """Return the description of a topic for a bag, with the definition and the hash of its type."""
        text, _ = self._store.generate_msgdef(kind, ros_version=2)
        digest = self._store.hash_rihs01(kind)
        return TopicInfo(name=name, type=kind, definition=text, type_hash=digest, role=role)

    def text(self, data: str) -> bytes:
        """Serialise a String message."""
        return self._bytes(self._store.types[_TEXT](data), _TEXT)

    def pack(self, kind: str, values: Values, stamp: int, frame_id: str) -> bytes:
        """Return a serialised message with a header.

        Args:
            kind: type of the message.
            values: dict from the dotted path of a field, e.g. ``pose.position.x``, to its value (1,). For a cloud: from
                the name of a column to its values (k,). For a JointState: from the name of a field to its values.
            stamp: stamp of the header [ns].
            frame_id: frame of the header.
        """
        message = self._empty(kind)
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
        message.header.frame_id = frame_id
        if kind == _CLOUD:
            self._fill_cloud(message, values)
        elif kind == _JOINTS:
            message.name = self._joints
            for name, array in values.items():
                setattr(message, name, np.asarray(array, dtype=np.float64))
        else:
            for path, array in values.items():
                *parents, last = path.split(".")
                part = message
                for name in parents:
                    part = getattr(part, name)
                setattr(part, last, float(array[0]))
        return self._bytes(message, kind)

    def _fill_cloud(self, cloud: Any, values: Values) -> None:
        kinds = {name: column.dtype.str[1:] for name, column in values.items()}
        table = np.empty(len(next(iter(values.values()))), [(name, f"<{kind}") for name, kind in kinds.items()])
        for name, column in values.items():
            table[name] = column
        field = self._store.types["sensor_msgs/msg/PointField"]
        cloud.fields = [field(name, 4 * place, _DATATYPES[kind], 1) for place, (name, kind) in enumerate(kinds.items())]
        cloud.height, cloud.width, cloud.is_dense = 1, len(table), True
        cloud.point_step, cloud.row_step = table.itemsize, table.nbytes
        cloud.data = table.view(np.uint8)

    def _bytes(self, message: Any, kind: str) -> bytes:
        return bytes(self._store.serialize_cdr(message, kind))

    def _empty(self, kind: str) -> Any:
        """Return a message whose fields are zeros, empty texts and empty sequences."""
        _, fields = self._store.fielddefs[kind]
        return self._store.types[kind](**{name: self._zero(*what) for name, what in fields})

    def _zero(self, node: Nodetype, what: Any) -> Any:
        if node is Nodetype.NAME:
            return self._empty(what)
        if node is Nodetype.BASE:
            return {"string": "", "bool": False}.get(what[0], 0.0 if what[0].startswith("float") else 0)
        (kind, inner), count = what
        numbers = kind is Nodetype.BASE and inner[0] != "string"
        return np.zeros(count, dtype=inner[0]) if numbers else []


_FRAME = "base_link"


class LiveBag:
    """Records steps under the node's topic names; used by the stepping thread.

    Args:
        path: directory of the bag; it must not exist yet, or be empty.
        simulation: the recorded simulation; it must not be replaced while the bag is written.
        state: serialised state from which the first step starts; None: the initial state of the scene.
        dt: simulation time of a step [s], stored in the bag.

    Raises:
        RecordingError: the bag cannot be created.
    """

    def __init__(self, path: Path, simulation: Simulation, *, state: bytes | None, dt: float) -> None:
        self._messages = Messages(joints=[*simulation.actuator_names, *simulation.joint_goals])
        self._publication = Publication(simulation)
        self._specs = state_topics(simulation.scene)
        scene = simulation.scene
        texts = {topics.SCENE: scene.source}
        if touching := contact_names(scene.handles, scene.self_contact):
            texts[topics.CONTACT_NAMES] = json.dumps(touching)
        names = {**self._specs, **{spec.key(): spec for spec in texts}}
        self._recorder = Recorder(
            path,
            [self._messages.topic(_full(role), spec.type, role) for role, spec in names.items()],
            run=RunInfo.of(scene, node={"clock": "live", "dt": dt}, state=state),
            queue=QueueOptions(back_pressure=BackPressure.BLOCK, block_seconds=30.0),
        )
        for spec, text in texts.items():
            self._recorder.record(_full(spec.key()), self._messages.text(text), 0)

    @property
    def path(self) -> Path:
        """Directory of the bag."""
        return self._recorder.path

    def write(self, step: Step) -> None:
        """Record the last step of the simulation; after an error of the disk, do nothing."""
        if self._recorder.error is not None:
            return
        made = self._publication.values(step.result, step.record, self._specs)
        for role, values in made.items():
            kind = self._specs[role].type
            data = (
                self._messages.text(step.record.to_json())
                if role == "step_record"
                else self._messages.pack(kind, values, step.record.stamp, self._frame(role))
            )
            self._recorder.record(_full(role), data, step.log_time)

    def close(self) -> str:
        """Complete the bag and return a summary."""
        return self._recorder.close().summary(self.path)

    @staticmethod
    def _frame(role: str) -> str:
        """Return the name of the frame of a topic's messages, as in the node."""
        section, _, rest = role.partition("/")
        name, _, what = rest.partition("/")
        if section in topics.MOVED:
            return f"{name}_{'rest' if what == 'pose' else 'centre'}"
        return f"{name}_imu" if what == "imu" else f"{name}_sensor" if section == "sensors" else _FRAME


def _full(role: str) -> str:
    return f"/{NODE_NAME}/{role}"
