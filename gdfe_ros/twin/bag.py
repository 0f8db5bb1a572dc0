# SPDX-License-Identifier: Apache-2.0
"""Bag of a twin: the simulation's messages, and the measured and simulated positions, on the robot's clock."""

from __future__ import annotations

import json
import shutil
import threading
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from gdfe_ros.analysis.message_values import Values
from gdfe_ros.analysis.published import Publication
from gdfe_ros.errors import RecordingError
from gdfe_ros.live.bag import Messages
from gdfe_ros.live.interface import View
from gdfe_ros.node.interface import topics
from gdfe_ros.node.interface.scene_topics import state_topics
from gdfe_ros.recording.provenance import RunInfo
from gdfe_ros.recording.recorder import BackPressure, QueueOptions, Recorder
from gdfe_ros.simulation import Simulation
from gdfe_ros.twin.comparison import FRAME, Deviation

_NODE = "gdfe_twin"
_POINT, _TEXT = "geometry_msgs/msg/PointStamped", "std_msgs/msg/String"
_MODULI = "moduli"


class TwinBag:
    """Records a twin into one MCAP file.

    The topics are those of a node with the name ``gdfe_twin``, without the step record: a replay could not repeat
    steps between which moduli change. ``measured/<probe>`` and ``compared/<probe>`` are the measured and the simulated
    position at the time of a measurement, and ``moduli`` has the present moduli [Pa] as JSON. All stamps are on the
    robot's clock.

    Args:
        path: the file; it must not exist yet. Until `close`, its contents are in the directory ``<path>.part``.
        simulation: the simulation that is recorded first.

    Raises:
        RecordingError: the file exists, or cannot be created.
    """

    def __init__(self, path: Path, simulation: Simulation) -> None:
        if path.exists():
            raise RecordingError(f"bag {path} exists: name another file or remove it")
        scene, self._file = simulation.scene, path
        self._messages = Messages(joints=[*simulation.actuator_names, *simulation.joint_goals])
        self._publication, self._simulation = Publication(simulation), simulation
        self._specs = {key: spec for key, spec in state_topics(scene).items() if spec is not topics.STEP_RECORD}
        pairs = [f"{kind}/{probe}" for kind in ("measured", "compared") for probe in scene.probes]
        kinds = {key: spec.type for key, spec in self._specs.items()}
        kinds |= dict.fromkeys(pairs, _POINT) | {_MODULI: _TEXT, topics.SCENE.key(): _TEXT}
        self._recorder = Recorder(
            path.with_name(f"{path.name}.part"),
            [self._messages.topic(_full(role), kind, role) for role, kind in kinds.items()],
            run=RunInfo.of(scene),
            queue=QueueOptions(back_pressure=BackPressure.BLOCK, block_seconds=30.0),
        )
        self._packing = threading.Lock()
        self._recorder.record(_full(topics.SCENE.key()), self._messages.text(scene.source), time.time_ns())

    def write(self, view: View, simulation: Simulation, stamp: float) -> None:
        """Record the state after a step of ``simulation`` at a time [s]; after an error of the disk, do nothing."""
        if self._recorder.error is not None:
            return
        if simulation is not self._simulation:  # its moduli have changed
            self._publication, self._simulation = Publication(simulation), simulation
        for role, values in self._publication.values(simulation.result, view.record, self._specs).items():
            self._put(role, self._specs[role].type, values, stamp)

    def compare(self, found: Sequence[Deviation], moduli: Mapping[str, float]) -> None:
        """Record measurements beside the simulated positions, and the present moduli [Pa] of the fitted materials."""
        if self._recorder.error is not None or not found:
            return
        for each in found:
            for kind, place in (("measured", each.measured), ("compared", each.simulated)):
                values = {f"point.{axis}": np.array([value]) for axis, value in zip("xyz", place, strict=True)}
                self._put(f"{kind}/{each.probe}", _POINT, values, each.stamp)
        with self._packing:
            text = self._messages.text(json.dumps(dict(moduli)))
        self._recorder.record(_full(_MODULI), text, _nanoseconds(found[-1].stamp))

    def close(self) -> str:
        """Complete the file and return a summary."""
        status, part = self._recorder.close(), self._recorder.path
        written = sorted(part.glob("*.mcap"))
        if status.error is not None or len(written) != 1:
            return f"{status.summary(part)}; remedy: gdfe recover {part}"
        written[0].replace(self._file)
        shutil.rmtree(part)
        return status.summary(self._file)

    def _put(self, role: str, kind: str, values: Values, stamp: float) -> None:
        moment = _nanoseconds(stamp)
        with self._packing:
            data = self._messages.pack(kind, values, moment, FRAME)
        self._recorder.record(_full(role), data, moment)


def _full(role: str) -> str:
    return f"/{_NODE}/{role}"


def _nanoseconds(seconds: float) -> int:
    return round(1e9 * seconds)
