# SPDX-License-Identifier: Apache-2.0
"""A recorded run: the contents of a node's bag, as arrays."""

from __future__ import annotations

import re
from collections import Counter, deque
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.analysis.message_values import Values, cloud_values, message_values, record_values
from gdfe_ros.errors import RecordingError
from gdfe_ros.recording.bag_info import TopicInfo
from gdfe_ros.recording.reader import BagReader
from gdfe_ros.recording.step import StepRecord, to_nanoseconds
from gdfe_ros.results.contacts import total_forces
from gdfe_ros.scene import Scene, scene_from_text

_INPUTS = frozenset({"actuation", "attach", "commands", "joint_command", "release", "trajectory"})
_HANDLE_INPUTS = frozenset({"target", "velocity", "follow", "set"})
"""Last parts of the names of a handle's input topics, e.g. of ``handles/tip/velocity``. The topic with the whole name
``velocity`` is an output. Inputs are not compared, because the step record has the consumed commands.
"""
CONTACTS = "contacts"
"""Topic of the contact points. A message has a row for each point; the number of points changes from step to step."""
RECORD, JOINTS = "step_record", "joint_states"
"""Topics of the step records, and of the values of actuators and joints."""
_OTHERS = frozenset({"topology", "scene", "contact_names", "markers", "contact_markers", "jacobian", "/clock"})
"""Topics of the node that are published less or more often than once per step."""

StepKey = tuple[int, int]
"""Simulation time at the end of a step [ns], and the number of earlier steps of the run with the same time."""


@dataclass(frozen=True, eq=False)
class BagStep:
    """One step of a recorded run.

    Attributes:
        record: consumed commands and outcome.
        key: identifies the same step in different runs.
        samples: dict from topic, without the node's name, to dict from field to array; ``step_record`` is one of the
            topics.
        frames: dict from topic to the ``frame_id`` of its message, for messages with a header.
    """

    record: StepRecord
    key: StepKey
    samples: dict[str, Values] = field(default_factory=dict)
    frames: dict[str, str] = field(default_factory=dict)

    def add(self, topic: str, message: Any) -> None:
        """Add the message of a topic."""
        self.samples[topic] = message_values(message)
        if frame := getattr(getattr(message, "header", None), "frame_id", ""):
            self.frames[topic] = frame


def step_keys(records: Collection[StepRecord]) -> list[StepKey]:
    """Return the keys of a run's steps, in order."""
    seen: Counter[int] = Counter()
    keys = []
    for record in records:
        stamp = to_nanoseconds(record.time)
        keys.append((stamp, seen[stamp]))
        seen[stamp] += 1
    return keys


class BagSteps:
    """The steps of a bag, read one after the other, so that a long bag is never in memory as a whole.

    The messages of a step are consecutive in the bag, before and after the step's record, and have its log time. Two
    successive steps have the same log time after a reset, or if a state is published again. If a topic then occurs
    twice, its second message belongs to the second step.

    Args:
        run: the recorded run.
        topics: topic names without the node's name, e.g. ``mesh``; None for all topics published once per step.

    Attributes:
        topics: dict from role (see `BagRun`) to full name, of the topics that are read.
        foreign: topics of unknown type, which cannot be compared.
        strays: dict from topic to the number of messages read so far whose step has no record in the bag. Such a
            record was dropped or lost.
        tail: dict from topic to the number of messages after the last step. They belong to a step whose record is
            missing at the end of the recording.
    """

    def __init__(self, run: BagRun, *, topics: Collection[str] | None = None) -> None:
        self.run = run
        self._roles = {name: role for role, name in run.roles.items()}
        self.topics = {role: name for role, name in run.roles.items() if not (role.startswith("/") or _is_known(role))}
        known = {*self.topics.values(), *(name for role, name in run.roles.items() if _is_known(role))}
        self.foreign = sorted(name for name, count in run.reader.counts.items() if count and name not in known)
        if topics is not None:
            missing = sorted(set(topics) - set(self.topics))
            if missing:
                raise RecordingError(
                    f"bag {run.reader.path} has no topic {missing}; published once a step are {sorted(self.topics)}"
                )
            self.topics = {short: name for short, name in self.topics.items() if short in {*topics, RECORD}}
        self.strays: Counter[str] = Counter()
        self.tail: Counter[str] = Counter()

    def __iter__(self) -> Iterator[BagStep]:
        keys = iter(step_keys(self.run.records))
        current, moment, early = None, 0, []
        self.strays.clear()
        self.tail.clear()
        for message in self.run.reader.messages(list(self.topics.values())):
            short = self._roles[message.topic]
            content = self.run.decode(message.type, message.data)
            if short == RECORD:
                if current is not None:
                    yield current
                record, moment = StepRecord.from_json(content.data), message.log_time
                current = BagStep(record, next(keys), {RECORD: record_values(record)})
                for topic, message in self._of(moment, early):
                    current.add(topic, message)
                early = []
            elif current is None or message.log_time != moment or short in current.samples:
                early.append((short, message.log_time, content))
            else:
                current.add(short, content)
        if current is not None:
            yield current
        self.tail.update(short for short, _, _ in early)

    def _of(self, moment: int, early: list[tuple[str, int, Any]]) -> list[tuple[str, Any]]:
        """Return topic and content of ``early`` messages with log time ``moment`` [ns]; count all others as strays."""
        self.strays.update(short for short, time, _ in early if time != moment)
        return [(short, content) for short, time, content in early if time == moment]


def _is_known(role: str) -> bool:
    """Return whether a topic is an input of the node, or is not published once per step."""
    owner, _, last = role.rpartition("/")
    of_handle = "/" in owner and last in _HANDLE_INPUTS and not role.startswith("/")
    return role in _OTHERS or role in _INPUTS or of_handle


class BagRun:
    """The run in a bag that a node recorded.

    Args:
        path: directory of the bag, or one of its MCAP files.

    Raises:
        RecordingError: there is no bag, or it was not recorded by this package's node.

    Attributes:
        reader: reader of the bag.
        roles: dict from role to topic name. The role is the topic's default name in the node, such as
            ``handles/tip/pose``; remapping does not change it. If the bag states no role for a topic, its role is the
            topic's name without the node's name; for a topic of another node, it is the full name.
    """

    def __init__(self, path: str | Path) -> None:
        self.reader = BagReader(path)
        self.decode = self.reader.decoder()
        self.roles = _roles(self.reader.topics.values())
        if self.reader.run is None or RECORD not in self.roles:
            raise RecordingError(f"bag {path} {_what_it_is(self.reader.topics)}")

    @cached_property
    def scene(self) -> Scene:
        """Scene that was simulated."""
        return scene_from_text(self.reader.run.scene, origin=f"of bag {self.reader.path}")

    @cached_property
    def records(self) -> list[StepRecord]:
        """Records of all steps, in order."""
        return [StepRecord.from_json(message.data) for message in self.messages(RECORD)]

    def messages(self, role: str) -> Iterator[Any]:
        """Yield the decoded messages of the topic with a role; none if the bag does not have the topic."""
        if role in self.roles:
            for message in self.reader.messages([self.roles[role]]):
                yield self.decode(message.type, message.data)

    def last_wrenches(self) -> dict[str, tuple[tuple[float, ...], tuple[float, ...]]]:
        """Return the last force (3,) [N] and moment (3,) [N m] on the body, as a dict from handle or obstacle.

        Wrenches of contact sensors are included, with the keys ``sensor <name>``.
        """
        wrenches = {}
        for role in sorted(self.roles):
            section, _, item = role.partition("/")
            name, _, quantity = item.partition("/")
            if quantity == "wrench":
                wrench = _last(self.messages(role)).wrench
                force, torque = wrench.force, wrench.torque
                name = f"sensor {name}" if section == "sensors" else name
                wrenches[name] = (force.x, force.y, force.z), (torque.x, torque.y, torque.z)
        return wrenches

    def last_places(self, pattern: str) -> dict[str, tuple[float, float, float]]:
        """Return the last position (3,) [m] of each topic of poses whose role matches a pattern, e.g. ``probe/*``.

        Returns:
            Dict from the part of the role that matches ``*`` to the position.
        """
        names = {role: re.fullmatch(pattern.replace("*", "([^/]+)"), role) for role in sorted(self.roles)}
        places = {}
        for role, found in names.items():
            if found:
                place = _last(self.messages(role)).pose.position
                places[found[1]] = place.x, place.y, place.z
        return places

    def last_total_forces(self) -> dict[str, NDArray[np.float64]]:
        """Return the last total contact force (3,) [N] on each obstacle and rigid body; empty without contact."""
        if CONTACTS not in self.roles:
            return {}
        return total_forces(cloud_values(_last(self.messages(CONTACTS))), self.scene.handles)


def _roles(topics: Iterable[TopicInfo]) -> dict[str, str]:
    """Return a dict from role to topic name."""
    known = {topic.name: topic.role for topic in topics}
    record = next((name for name in known if name.endswith(f"/{RECORD}")), "")
    prefix = record.removesuffix(RECORD) or "//"
    return {role or name.removeprefix(prefix): name for name, role in known.items()}


def _last(items: Iterator[Any]) -> Any:
    kept = deque(items, maxlen=1)
    if not kept:
        raise RecordingError("the bag holds no message of this topic")
    return kept[0]


def _what_it_is(topics: Collection[str]) -> str:
    """Return a text about the origin of a bag without step records, and about programs that can read it."""
    if any(name.startswith("/gdfe_twin/") for name in topics):
        text = "was recorded by gdfe twin, whose moduli change between steps, so that it has no step records"
        return f"{text}; remedy: Foxglove, PlotJuggler or `gdfe fit SCENE BAG --match FILE` read its topics"
    shown = [name[:80] for name in sorted(topics)[:8]] + [f"{len(topics) - 8} more"] * (len(topics) > 8)
    remedy = "remedy: a bag of sim_node, gdfe demo or gdfe live; `gdfe fit` reads bags of other recorders"
    return f"was not recorded by sim_node; its topics: {', '.join(shown) or 'none'}; {remedy}"
