# SPDX-License-Identifier: Apache-2.0
"""Bag of a twin: the simulation's messages, and the measured and simulated positions, on the robot's clock."""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from gdfe_ros.errors import RecordingError
from gdfe_ros.live.interface import View
from gdfe_ros.node.interface import topics
from gdfe_ros.node.interface.scene_topics import state_topics
from gdfe_ros.recording.bag_info import TopicInfo
from gdfe_ros.recording.packing import Packer, pack_text, packing
from gdfe_ros.recording.provenance import RunInfo
from gdfe_ros.recording.published import PLACE, tables_of
from gdfe_ros.recording.recorder import Recorder
from gdfe_ros.recording.step import Demand, Step, observe
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
        kinds = {key: spec.type for key, spec in state_topics(scene).items() if spec is not topics.STEP_RECORD}
        self._topics = list(kinds)
        self._pack_from(simulation)
        pairs = [f"{kind}/{probe}" for kind in ("measured", "compared") for probe in scene.probes]
        kinds |= dict.fromkeys(pairs, _POINT) | {_MODULI: _TEXT, topics.SCENE.key(): _TEXT}
        self._recorder = Recorder(
            path.with_name(f"{path.name}.part"),
            [TopicInfo(name=_full(role), type=kind, role=role) for role, kind in kinds.items()],
            run=RunInfo.of(scene),
            waits=True,
        )
        self._recorder.record(_full(topics.SCENE.key()), pack_text(scene.source), time.time_ns())

    def write(self, view: View, simulation: Simulation, stamp: float) -> None:
        """Record the state after a step of ``simulation`` at a time [s]; after an error of the disk, do nothing."""
        if self._recorder.error is not None:
            return
        if simulation is not self._simulation:  # its moduli have changed
            self._pack_from(simulation)
        moment, given = _nanoseconds(stamp), observe(simulation, Demand())
        record = replace(view.record, stamp=moment)
        step = Step(record=record, result=simulation.result, log_time=moment, **given)
        for role, pack in self._packs.items():
            self._recorder.record(_full(role), pack(step), moment)

    def compare(self, found: Sequence[Deviation], moduli: Mapping[str, float]) -> None:
        """Record measurements beside the simulated positions, and the present moduli [Pa] of the fitted materials."""
        if self._recorder.error is not None or not found:
            return
        for each in found:
            for kind, place in (("measured", each.measured), ("compared", each.simulated)):
                moment = _nanoseconds(each.stamp)
                data = Packer(PLACE, FRAME).pack(moment, partial(np.copyto, src=place))
                self._recorder.record(_full(f"{kind}/{each.probe}"), data, moment)
        text = json.dumps(dict(moduli))
        self._recorder.record(_full(_MODULI), pack_text(text), _nanoseconds(found[-1].stamp))

    def close(self) -> str:
        """Complete the file and return a summary."""
        status, part = self._recorder.close(), self._recorder.path
        written = sorted(part.glob("*.mcap"))
        if status.error is not None or len(written) != 1:
            return f"{status.summary(part)}; remedy: gdfe recover {part}"
        written[0].replace(self._file)
        shutil.rmtree(part)
        return status.summary(self._file)

    def _pack_from(self, simulation: Simulation) -> None:
        """Make the messages from the tables of a simulation."""
        tables, rows = tables_of(simulation.scene), [*simulation.actuator_names, *simulation.joint_goals]
        self._packs = {role: packing(tables[role], FRAME, rows) for role in self._topics}
        self._simulation = simulation


def _full(role: str) -> str:
    return f"/{_NODE}/{role}"


def _nanoseconds(seconds: float) -> int:
    return round(1e9 * seconds)
