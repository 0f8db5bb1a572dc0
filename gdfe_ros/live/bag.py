# SPDX-License-Identifier: Apache-2.0
"""Bag of a live session, recorded without ROS; it has the contents of a node's bag, and `gdfe replay` repeats it."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

from gdfe_ros.analysis.published import Publication
from gdfe_ros.contacts import contact_names
from gdfe_ros.live.messages import Messages
from gdfe_ros.node.interface import NODE_NAME, topics
from gdfe_ros.node.interface.scene_topics import state_topics
from gdfe_ros.recording.backpressure import BackPressure, QueueOptions
from gdfe_ros.recording.provenance import STATE_FILE, RunInfo
from gdfe_ros.recording.recorder import Recorder
from gdfe_ros.recording.step import Step
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
        self._messages = Messages(joints=[*simulation.actuator_names, *simulation.joint_goals])
        self._publication = Publication(simulation)
        self._specs = state_topics(simulation.scene)
        scene = simulation.scene
        texts = {topics.SCENE: scene.source}
        if touching := contact_names(scene.handles, scene.self_contact):
            texts[topics.CONTACT_NAMES] = json.dumps(touching)
        names = {**self._specs, **{spec.key(): spec for spec in texts}}
        settings = {**asdict(scene.solver), "policy": scene.solver.policy.value, "node": {"clock": "live", "dt": dt}}
        self._recorder = Recorder(
            path,
            [self._messages.topic(_full(role), spec.type, role) for role, spec in names.items()],
            run=RunInfo(scene=scene.source, settings=settings, files={} if state is None else {STATE_FILE: state}),
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
        status = self._recorder.close()
        text = f"bag {self.path}: {status.written} messages, {status.dropped_total} dropped"
        return f"{text}; {status.error}; nothing later is in the bag" if status.error else text

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
