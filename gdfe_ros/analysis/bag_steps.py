# SPDX-License-Identifier: Apache-2.0
"""A recorded run step by step: the commands that each step consumed, and its published arrays."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from typing import Any

from gdfe_ros.analysis.bag_run import RECORD, BagRun
from gdfe_ros.analysis.message_values import Values, message_values, record_values
from gdfe_ros.errors import RecordingError
from gdfe_ros.recording.decoding import array_decoder
from gdfe_ros.recording.step_record import StepRecord

_INPUTS = frozenset({"actuation", "commands", "trajectory"})
_HANDLE_INPUTS = frozenset({"target", "velocity", "follow", "set"})
"""Last parts of the names of a handle's input topics, e.g. of ``handles/tip/velocity``. The topic with the whole name
``velocity`` is an output. Inputs are not compared, because the step record has the consumed commands.
"""
CONTACTS = "contacts"
"""Topic of the contact points. A message has a row for each point; the number of points changes from step to step."""
_OTHERS = frozenset({"topology", "scene", "contact_names", "markers", "contact_markers", "jacobian", "/clock"})
"""Topics of the node that are published less or more often than once per step."""

StepKey = tuple[int, int]
"""Stamp [ns] of a step, and the number of earlier steps of the run with the same stamp."""


@dataclass(frozen=True, eq=False)
class BagStep:
    """One step of a recorded run.

    Attributes:
        record: consumed commands and outcome.
        key: identifies the same step in different runs.
        samples: dict from topic (its role) to dict from field to array, with ``step_record`` as one of the topics.
        frames: dict from topic to the ``frame_id`` of its message, for messages with a header.
    """

    record: StepRecord
    key: StepKey
    samples: dict[str, Values] = field(default_factory=dict)
    frames: dict[str, str] = field(default_factory=dict)

    def take(self, topic: str, message: Any) -> None:
        """Add the message of a topic."""
        self.samples[topic] = message_values(message)
        if frame := getattr(getattr(message, "header", None), "frame_id", ""):
            self.frames[topic] = frame


def stamp_of(record: StepRecord) -> int:
    """Return the stamp [ns] of all messages of a step."""
    return round(record.time * 1e9)


def step_keys(records: Collection[StepRecord]) -> list[StepKey]:
    """Return the keys of a run's steps, in order."""
    seen: Counter[int] = Counter()
    keys = []
    for record in records:
        stamp = stamp_of(record)
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
        topics: dict from role to full name, of the topics that are read.
        foreign: topics of unknown type, which cannot be compared.
        strays: dict from topic to the number of messages read so far whose step has no record in the bag. Such a
            record was dropped or lost.
        tail: dict from topic to the number of messages after the last step. They belong to a step whose record is
            missing at the end of the recording.
    """

    def __init__(self, run: BagRun, *, topics: Collection[str] | None = None) -> None:
        self.run = run
        self._roles = {name: role for role, name in run.roles.items()}
        self.topics = {role: name for role, name in run.roles.items() if _is_step_topic(role)}
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
        decode = array_decoder(self.run.reader.topics.values())
        keys = iter(step_keys(self.run.records))
        current, moment, early = None, 0, []
        self.strays.clear()
        self.tail.clear()
        for message in self.run.reader.messages(list(self.topics.values())):
            short = self._roles[message.topic]
            content = decode(message.type, message.data)
            if short == RECORD:
                if current is not None:
                    yield current
                record, moment = StepRecord.from_json(content.data), message.log_time
                current = BagStep(record, next(keys), {RECORD: record_values(record)})
                for topic, message in self._of(moment, early):
                    current.take(topic, message)
                early = []
            elif current is None or message.log_time != moment or short in current.samples:
                early.append((short, message.log_time, content))
            else:
                current.take(short, content)
        if current is not None:
            yield current
        self.tail.update(short for short, _, _ in early)

    def _of(self, moment: int, early: list[tuple[str, int, Any]]) -> list[tuple[str, Any]]:
        """Return topic and message of the ``early`` ones with log time ``moment`` [ns]; count the others as strays."""
        self.strays.update(short for short, time, _ in early if time != moment)
        return [(short, content) for short, time, content in early if time == moment]


def _is_step_topic(role: str) -> bool:
    return not role.startswith("/") and not _is_known(role)


def _is_known(role: str) -> bool:
    """Return whether a topic is an input of the node, or is not published once per step."""
    owner, _, last = role.rpartition("/")
    is_input = last in _INPUTS or ("/" in owner and last in _HANDLE_INPUTS)
    return role in _OTHERS or (is_input and not role.startswith("/"))
