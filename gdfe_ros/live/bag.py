# SPDX-License-Identifier: Apache-2.0
"""Bags recorded without ROS, of a live session or of a twin; `gdfe replay` repeats the bag of a live session."""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from gdfe_ros.node.interface import FRAME, NODE_NAME, TopicSpec, topics
from gdfe_ros.node.interface.topics import state_topics
from gdfe_ros.recording.bag_info import TopicInfo
from gdfe_ros.recording.packing import pack_text, packers
from gdfe_ros.recording.provenance import RunInfo
from gdfe_ros.recording.recorder import Recorder
from gdfe_ros.recording.step import Step
from gdfe_ros.results.contacts import contact_names
from gdfe_ros.scene.scene import Scene


class StepBag:
    """Records steps under the topic names of a node.

    Args:
        path: directory of the bag; it must not exist yet, or be empty.
        scene: scene of the steps.
        node: name of the node.
        settings: keyword arguments of `RunInfo.of`: ``node`` and ``state``.
        texts: dict from latched topic to its text.
        start: log time of these texts [ns].
        others: dict from a further topic, without the node's name, to its type.
        left_out: topics of a step that are not recorded.

    Raises:
        RecordingError: the bag cannot be created.
    """

    def __init__(
        self,
        path: Path,
        scene: Scene,
        *,
        node: str,
        settings: Mapping[str, Any],
        texts: Mapping[TopicSpec, str],
        start: int = 0,
        others: Mapping[str, str] = {},
        left_out: Collection[TopicSpec] = (),
    ) -> None:
        kinds = {role: spec.type for role, spec in state_topics(scene).items() if spec not in left_out}
        packs = packers(scene, lambda name: name or FRAME)
        self._packs = {role: packs[role] for role in kinds}
        kinds |= {**others, **{spec.key(): spec.type for spec in texts}}
        self._prefix = f"/{node}/"
        infos = [TopicInfo(name=f"{self._prefix}{role}", type=kind, role=role) for role, kind in kinds.items()]
        self._recorder = Recorder(path, infos, run=RunInfo.of(scene, **settings), waits=True)
        for spec, text in texts.items():
            self.record(spec.key(), pack_text(text), start)

    @property
    def path(self) -> Path:
        """Directory of the bag."""
        return self._recorder.path

    def record(self, role: str, data: bytes, log_time: int) -> None:
        """Record a message with a log time [ns]; ``role`` is the topic without the node's name."""
        self._recorder.record(f"{self._prefix}{role}", data, log_time)

    def write(self, step: Step) -> None:
        """Record a step; after an error of the disk, do nothing."""
        if self._recorder.error is None:
            for role, pack in self._packs.items():
                self.record(role, pack(step), step.log_time)

    def close(self) -> str:
        """Complete the bag and return a summary."""
        return self._recorder.close().summary(self.path)


class LiveBag(StepBag):
    """The bag of a live session, with the contents of a node's bag.

    Args:
        path: directory of the bag; it must not exist yet, or be empty.
        scene: scene of the session.
        state: serialised state from which the first step starts; None: the initial state of the scene.
        dt: simulation time of a step [s], stored in the bag.

    Raises:
        RecordingError: the bag cannot be created.
    """

    def __init__(self, path: Path, scene: Scene, *, state: bytes | None, dt: float) -> None:
        texts, touching = {topics.SCENE: scene.source}, contact_names(scene.handles, scene.self_contact)
        if touching:
            texts[topics.CONTACT_NAMES] = json.dumps(touching)
        settings = {"node": {"clock": "live", "dt": dt}, "state": state}
        super().__init__(path, scene, node=NODE_NAME, settings=settings, texts=texts)
