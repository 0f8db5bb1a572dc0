# SPDX-License-Identifier: Apache-2.0
"""Session of a page for a node in another process; steps come over topics, commands go over topics and services."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from dataclasses import replace

from diagnostic_msgs.msg import DiagnosticArray
from std_msgs.msg import String

from gdfe_ros.actuators.load import LOAD_FACTOR
from gdfe_ros.constraints import Pose
from gdfe_ros.errors import GdfeError
from gdfe_ros.live.interface import Ability, ShownRun, View
from gdfe_ros.live.remote.commander import Commander, Player
from gdfe_ros.live.remote.steps import NodeReport, Steps, Waiting, absence, full_name, view_of
from gdfe_ros.node.driving.orders import Order, require_order
from gdfe_ros.node.driving.remodelling import moduli_of, source_with
from gdfe_ros.node.interface import topics
from gdfe_ros.node.middleware.process import LoneNode
from gdfe_ros.node.middleware.ros_types import subscribe
from gdfe_ros.recording.step import Begin, StepRecord
from gdfe_ros.scene.building.arms import joint_starts
from gdfe_ros.scene.loader import scene_from_text
from gdfe_ros.scene.scene import Scene
from gdfe_ros.testing.published_state import PublishedState

LONGEST_WAIT = 5.0
"""Longest wait for a node's scene [s]."""
_SILENT = 3.5
"""A node counts as silent after this time [s] without a report; it reports once a second."""
_OWN = "gdfe_live"


class NodeSession(ShownRun):
    """Session for a node in another process; the constructor waits for the node's scene.

    Args:
        name: name of the node, e.g. ``gdfe_sim`` or ``/left/gdfe_sim``.
        patience: longest wait for the node's scene [s].
        say: function that receives texts about the wait.

    Raises:
        GdfeError: the name is invalid, the node does not exist (the message lists the nodes), or it is not configured.

    Attributes:
        failure: exception that ended the reception; None if there was none.
        outdated: whether the node has changed to another scene; a new session is then needed.
    """

    def __init__(
        self, name: str, *, patience: float = LONGEST_WAIT, say: Callable[[str], None] = lambda text: None
    ) -> None:
        self.name = full_name(name)
        self.failure: Exception | None = None
        self.outdated = False
        self._text: str | None = None
        self._report, self._heard = NodeReport(), time.monotonic()
        self.state: PublishedState | None = None
        self._commanded: dict[str, float] = {}
        self._led: dict[str, Pose] = {}
        self._steps: Steps | None = None
        self._thread: threading.Thread | None = None
        self._ending, self._watched, self._silent = threading.Event(), False, False
        self._ros = LoneNode(f"{_OWN}_{os.getpid()}")
        self._node, self._executor = self._ros.node, self._ros.executor
        try:
            self._scene = self._find(patience, say)
            self._commander = Commander(self._node, self.name, self._scene)
            self._player = Player(self._scene, self._commander.send)
        except BaseException:
            self.stop()
            raise

    @property
    def title(self) -> str:
        """Names of the scene and of the node."""
        return f"{self._scene.name} of {self.name}"

    @property
    def scene(self) -> Scene:
        """The scene that the node simulates."""
        return self._scene

    @property
    def commands(self) -> Mapping[str, float]:
        """Commands of actuators, loads and joints by name, as the node's steps have consumed them.

        An actuator without a known command has its present value. Loads and joints without a known command are left
        out.
        """
        state, known = self.state, {}
        for actuator in self._scene.actuators if state is not None else ():
            position, _, effort = state.joints[actuator.name]
            known[actuator.name] = effort if actuator.mode.by_effort else position
        return known | self._commanded

    @property
    def targets(self) -> Mapping[str, Pose]:
        """Targets of handles and obstacles by name, as the node's steps have consumed them, or else present poses."""
        poses = {handle.name: Pose() for handle in self._scene.handles}
        return poses | (self.state.poses if self.state is not None else {}) | self._led

    @property
    def moduli(self) -> Mapping[str, float]:
        """Present Young's moduli [Pa] by material."""
        return moduli_of(self._scene)

    @property
    def paused(self) -> bool:
        """Whether the node is paused."""
        return self._report.paused

    @property
    def recording(self) -> str | None:
        """Path of the bag that the node writes, or None."""
        return self._report.bag

    def start(self, *, on_view: Callable[[View], None], warn: Callable[[str], None]) -> None:
        """Begin to receive steps.

        Args:
            on_view: function that is called with the view of each shown step, in a separate thread.
            warn: function that receives texts for the user.
        """
        self._on_view, self._warn, self._heard = on_view, warn, time.monotonic()
        node, name = self._node, self.name
        subscribe(node, topics.DIAGNOSTICS, self._hear_report)
        self._steps = Steps(node, name, self._scene, consumed=self._keep, on_step=self._show_step, failed=self._fail)
        self._thread = threading.Thread(target=self._spin, name="gdfe-ros", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End the reception."""
        self._ending.set()
        if self._thread is not None:
            self._thread.join()
        if self._steps is not None:
            self._steps.close()
        self._ros.close()

    def __enter__(self) -> NodeSession:
        return self

    def __exit__(self, *error: object) -> None:
        self.stop()

    def watch(self, wanted: bool) -> None:
        """Receive whole steps if there are viewers (``wanted``), otherwise only the step records."""
        self._watched = wanted

    def doing(self) -> tuple[str, bool]:
        """Return a text about the node's activity, and whether it is a problem; empty while it only makes steps."""
        silence = time.monotonic() - self._heard
        if self.failure is not None:
            return f"the reception ended: {self.failure}", True
        if silence > _SILENT:
            return f"nothing heard of {self.name} for {silence:.0f} s", True
        if self._report.bad:
            return self._report.text, True
        if (text := self._player.text) and not self.paused:
            return text, False
        return self._report.text or ("paused" if self.paused else ""), False

    def command(self, name: str, order: Order) -> None:
        """Publish an order; the program stops commanding the same items.

        Raises:
            GdfeError: a number is not finite, or a target is too far from rest.
        """
        require_order(name, order, self._scene.mesh.size)
        self._player.leave(order.names)
        self._commander.send(name, order)

    def ask(self, ability: Ability) -> Future[str] | None:
        """Carry out a request: call its service, or play the program; return a ``Future`` of the answer, or None.

        Raises:
            GdfeError: the node does not offer the service at present.
        """
        if ability is Ability.PLAY:
            self._player.play()
            return self.ask(Ability.PAUSE) if self.paused else None
        if ability is Ability.RESET:
            self._player.stop()
        wanted = {Ability.PAUSE: not self.paused, Ability.RECORD: self.recording is None}.get(ability, False)
        answer = self._commander.call(ability, on=wanted)
        if ability is Ability.PAUSE:
            answer.add_done_callback(lambda done: done.exception() or self._note_pause(wanted))
        return answer

    def set_moduli(self, moduli: Mapping[str, float]) -> Future[str]:
        """Set parameters of the node: Young's moduli [Pa] by material; return a ``Future`` of the answer.

        Raises:
            GdfeError: the node does not answer at present.
        """
        return self._commander.set_moduli(moduli)

    def _find(self, patience: float, say: Callable[[str], None]) -> Scene:
        """Wait for the node's scene and return it; meanwhile report the node's lifecycle state."""
        subscribe(self._node, topics.SCENE, self._hear_scene, f"{self.name}/{topics.SCENE.key()}")
        end, waiting = time.monotonic() + patience, Waiting(self._node, self.name, say)
        while self._text is None:
            if time.monotonic() > end:
                raise GdfeError(absence(self._node, self.name, patience))
            self._executor.spin_once(timeout_sec=0.05)
            waiting.look()
        return scene_from_text(self._text, origin=f"of the node {self.name}")

    def _hear_scene(self, message: String) -> None:
        """Store the scene. A later scene replaces it if only moduli differ; otherwise the session is outdated."""
        before, self._text = self._text, message.data
        if before in (None, message.data):
            return
        later = scene_from_text(message.data, origin=f"of the node {self.name}")
        if source_with(self._scene, moduli_of(later)) == later.source:
            self._scene = later
        else:
            self.outdated = True

    def _hear_report(self, message: DiagnosticArray) -> None:
        report = NodeReport.of(message, self.name)
        if report is not None:
            self._report, self._heard = report, time.monotonic()

    def _keep(self, record: StepRecord) -> None:
        """Store the commands that a step has consumed; let the program command the next step."""
        try:
            self._player.follow(record)
        except GdfeError as error:
            self._player.stop()
            self._warn(f"the program ends here: {error}")
        if record.begin is Begin.REST:
            self._commanded, self._led = {load.name: LOAD_FACTOR for load in self._scene.loads}, {}
            self._commanded |= joint_starts(self._scene.arms)
        self._commanded = {**self._commanded, **record.actuators, **record.loads, **record.joints}
        self._led = {**self._led, **record.handles}

    def _show_step(self, state: PublishedState) -> None:
        """Store a received state, and show it on the page."""
        self.state = state
        self._on_view(view_of(state, self._scene))

    def _note_pause(self, paused: bool) -> None:
        """Store at once whether the node is paused; the node's own report comes up to a second later."""
        self._report = replace(self._report, paused=paused)

    def _spin(self) -> None:
        try:
            while not self._ending.is_set():
                self._steps.listen(self._watched)
                self._note_silence()
                if not self.paused:
                    self._player.remind()
                self._executor.spin_once(timeout_sec=0.1)
        except Exception as error:
            self._fail(error)

    def _note_silence(self) -> None:
        """Warn once if the node has become silent, and once when it is heard again."""
        silent = time.monotonic() - self._heard > _SILENT
        if silent and not self._silent:
            ended = f"nothing is heard of {self.name} any more: it has ended, was killed, or is out of reach"
            self._warn(f"{ended}; the page goes on once it is back")
        elif self._silent and not silent:
            self._warn(f"{self.name} is heard again")
        self._silent = silent

    def _fail(self, error: Exception) -> None:
        if not self._ending.is_set():
            self.failure = error
            self._warn(f"the reception from {self.name} ended: {error!r}")
