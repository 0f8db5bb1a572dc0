# SPDX-License-Identifier: Apache-2.0
"""Recording of a session's topics in bags."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

from gdfe_ros.errors import GdfeError
from gdfe_ros.node.inputs import Inputs
from gdfe_ros.node.outputs import TopicOutputs
from gdfe_ros.node.pace import ClockMode
from gdfe_ros.node.run import Run
from gdfe_ros.recording.provenance import RunInfo
from gdfe_ros.recording.recorder import Recorder, RecorderStatus
from gdfe_ros.regular_file import path_inside
from gdfe_ros.scene.scene import Scene


class Bags:
    """Records the topics of a session, one bag at a time.

    Args:
        run: the recorded run; its parameter ``bag_path`` is the directory of the next bag.
        inputs: command topics; their messages are recorded as received.
        outputs: output topics; their messages are recorded as published.

    Attributes:
        recorder: recorder of the bag in progress, or of the last bag; None before the first.
        active: whether a bag is being written.
    """

    def __init__(self, run: Run, inputs: Inputs, outputs: TopicOutputs) -> None:
        self._run, self._logger = run, run.node.get_logger()
        self._inputs, self._outputs = inputs, outputs
        self.recorder: Recorder | None = None
        self.active = False

    def require_none(self) -> None:
        """Raise an error while a bag is being written, because a replay could not follow a change from outside.

        Raises:
            GdfeError: a bag is being written.
        """
        if self.active:
            raise GdfeError("a bag is being written, and a replay could not follow; finish it first with ~/record")

    def begin(self, *, state: bytes | None) -> str:
        """Begin a bag in the directory ``bag_path`` (default: ``runs/<scene>_<time>``); return a text with its path.

        If the disk is too slow, messages are dropped and counted under the wall clock. Under other clocks the steps
        wait for the disk.

        Args:
            state: serialised state from which the first step starts; None: the initial state of the scene.

        Raises:
            RecordingError: the bag cannot be created.
        """
        topics = [*self._inputs.infos, *(channel.info for channel in self._outputs.channels if channel.recorded)]
        scene, parameters = self._run.scene, self._run.parameters.as_dict()
        waits = parameters["clock"] != ClockMode.WALL.value
        self.recorder = Recorder(
            _directory(scene, parameters["bag_path"]),
            topics,
            run=RunInfo.of(scene, node=parameters, state=state),
            waits=waits,
            failed=self._say_failed,
        )
        self._attach(self.recorder)
        self._outputs.publish_scene(self._run.log_time)
        text = f"recording to {self.recorder.path}"
        self._logger.info(text)
        return text

    def finish(self) -> str:
        """Finish the bag and return a summary; `failed` then states whether the recording ended early."""
        self._attach(None)
        status = self.recorder.close()
        text = status.summary(self.recorder.path)
        # On separate lines: rclpy binds a severity permanently to the line that logs.
        if status.error is None:
            self._logger.info(text)
        else:
            self._logger.error(text)
        return text

    @property
    def failed(self) -> bool:
        """Whether the recording of the bag in progress, or of the last bag, ended early because of an error."""
        return self.recorder is not None and self.recorder.error is not None

    def _say_failed(self, status: RecorderStatus) -> None:
        """Log that the recording has failed; called in the recorder's thread. The simulation continues."""
        self._logger.error(f"recording ended, the simulation goes on: {status.summary(self.recorder.path)}")

    def _attach(self, recorder: Recorder | None) -> None:
        self._outputs.attach(recorder)
        self._inputs.recorder = recorder
        self.active = recorder is not None


def _directory(scene: Scene, path: str) -> Path:
    return Path(path) if path else path_inside(Path("runs"), f"{scene.name}_{datetime.now():%Y%m%d_%H%M%S_%f}")
