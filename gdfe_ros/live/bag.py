# SPDX-License-Identifier: Apache-2.0
"""Bag of a live session, recorded without ROS; it has the contents of a node's bag, and `gdfe replay` repeats it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

from gdfe_ros.contacts import contact_names
from gdfe_ros.node.interface import NODE_NAME, topics
from gdfe_ros.node.interface.scene_topics import state_topics
from gdfe_ros.recording.bag_info import TopicInfo
from gdfe_ros.recording.packing import pack_text, packing
from gdfe_ros.recording.provenance import RunInfo
from gdfe_ros.recording.published import tables_of
from gdfe_ros.recording.recorder import Recorder
from gdfe_ros.recording.step import Demand, Step, observe
from gdfe_ros.simulation import Simulation

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
        scene, self._simulation = simulation.scene, simulation
        specs, rows = state_topics(scene), [*simulation.actuator_names, *simulation.joint_goals]
        tables = {role: table for role, table in tables_of(scene).items() if role in specs}
        self._packs = {role: packing(table, table.frame or _FRAME, rows) for role, table in tables.items()}
        self._packs[topics.STEP_RECORD.key()] = lambda step: pack_text(step.record.to_json())
        texts = {topics.SCENE: scene.source}
        if touching := contact_names(scene.handles, scene.self_contact):
            texts[topics.CONTACT_NAMES] = json.dumps(touching)
        kinds = {role: spec.type for role, spec in specs.items()} | {spec.key(): spec.type for spec in texts}
        self._recorder = Recorder(
            path,
            [TopicInfo(name=_full(role), type=kind, role=role) for role, kind in kinds.items()],
            run=RunInfo.of(scene, node={"clock": "live", "dt": dt}, state=state),
            waits=True,
        )
        for spec, text in texts.items():
            self._recorder.record(_full(spec.key()), pack_text(text), 0)

    @property
    def path(self) -> Path:
        """Directory of the bag."""
        return self._recorder.path

    def write(self, step: Step) -> None:
        """Record the last step of the simulation; after an error of the disk, do nothing."""
        if self._recorder.error is not None:
            return
        whole = replace(step, **observe(self._simulation, Demand()))
        for role, pack in self._packs.items():
            self._recorder.record(_full(role), pack(whole), step.log_time)

    def close(self) -> str:
        """Complete the bag and return a summary."""
        return self._recorder.close().summary(self.path)


def _full(role: str) -> str:
    return f"/{NODE_NAME}/{role}"
