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
from gdfe_ros.live.bag import StepBag
from gdfe_ros.node.interface import FRAME, topics
from gdfe_ros.recording.message_tables import PLACE
from gdfe_ros.recording.packing import Packer, pack_text
from gdfe_ros.recording.step import Step, to_nanoseconds
from gdfe_ros.scene.scene import Scene
from gdfe_ros.twin.estimator import Deviation
from gdfe_ros.untrusted.regular_file import quote_path

_MODULI = "moduli"


class TwinBag(StepBag):
    """Recorder of a twin, with one MCAP file.

    The topics are those of a node with the name ``gdfe_twin``, without the step record, because a replay could not
    repeat steps between which moduli change. ``measured/<probe>`` and ``compared/<probe>`` are the measured and the
    simulated position at the time of a measurement. ``moduli`` has the present moduli [Pa] as JSON. All stamps are on
    the robot's clock.

    Args:
        path: the file; it must not exist yet. Until `close`, its contents are in the directory ``<path>.part``.
        scene: scene of the simulation; the scenes of later steps may differ in their moduli.

    Raises:
        RecordingError: the file exists, or cannot be created.
    """

    def __init__(self, path: Path, scene: Scene) -> None:
        if path.exists():
            raise RecordingError(f"bag {path} exists: name another file or remove it")
        self._file, pairs = path, [f"{kind}/{probe}" for kind in ("measured", "compared") for probe in scene.probes]
        super().__init__(
            path.with_name(f"{path.name}.part"),
            scene,
            node="gdfe_twin",
            settings={},
            texts={topics.SCENE: scene.source},
            start=time.time_ns(),
            others={**dict.fromkeys(pairs, "geometry_msgs/msg/PointStamped"), _MODULI: topics.SCENE.type},
            left_out=(topics.STEP_RECORD,),
        )

    def write_at(self, stamp: float, step: Step) -> None:
        """Record a step that ended at a time on the robot's clock [s]."""
        moment = to_nanoseconds(stamp)
        self.write(replace(step, record=replace(step.record, stamp=moment), log_time=moment))

    def compare(self, found: Sequence[Deviation], moduli: Mapping[str, float]) -> None:
        """Record measurements beside the simulated positions, and the present moduli [Pa] of the fitted materials."""
        if self._recorder.error is not None or not found:
            return
        for each in found:
            moment = to_nanoseconds(each.stamp)
            for kind, place in (("measured", each.measured), ("compared", each.simulated)):
                data = Packer(PLACE, FRAME).pack(moment, partial(np.copyto, src=place))
                self.record(f"{kind}/{each.probe}", data, moment)
        self.record(_MODULI, pack_text(json.dumps(dict(moduli))), to_nanoseconds(found[-1].stamp))

    def close(self) -> str:
        """Complete the file and return a summary."""
        status, part = self._recorder.close(), self._recorder.path
        written = sorted(part.glob("*.mcap"))
        if status.error is not None or len(written) != 1:
            return f"{status.summary(part)}; remedy: gdfe recover {quote_path(part)}"
        written[0].replace(self._file)
        shutil.rmtree(part)
        return status.summary(self._file)
