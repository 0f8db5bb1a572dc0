# SPDX-License-Identifier: Apache-2.0
"""State of a configured node, common to its parts: simulation, frames, clock, leaders; requests for several steps."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable
from concurrent.futures import Future, InvalidStateError
from contextlib import suppress
from dataclasses import dataclass, replace

from geometry_msgs.msg import PoseStamped
from rclpy.clock import JumpHandle, JumpThreshold, TimeJump
from rclpy.duration import Duration

from gdfe_ros.command import require_movable
from gdfe_ros.constraints import Handle
from gdfe_ros.errors import CommandError, GdfeError
from gdfe_ros.node.command_messages import make_pose_order, require_pose
from gdfe_ros.node.driving.orders import PoseOrder
from gdfe_ros.node.driving.pace import ExternalPace, Pace
from gdfe_ros.node.driving.stepping_thread import SteppingThread
from gdfe_ros.node.frames import Frames, Placement, Transforms
from gdfe_ros.node.interface import topics
from gdfe_ros.node.middleware.managed import ManagedNode
from gdfe_ros.node.parameters import NodeParameters
from gdfe_ros.node.refusals import Reason, Refusal, RefusalLog
from gdfe_ros.recording.step import Step, to_nanoseconds
from gdfe_ros.scene.scene import Scene
from gdfe_ros.simulation import Simulation


class Run:
    """Holds the simulation for stepping, commands, publishing and recording.

    Args:
        node: node of the topics.
        parameters: parameters of the node.
        simulation: simulation that is ready to step.
        refusals: log of refused commands.
        ending: event that is set by a request to end the process; requests of several steps then stop early.
        transforms: transforms of other frames; None: none are known.

    Attributes:
        node: the argument of this name; likewise ``parameters``, ``refusals`` and ``ending``.
        simulation: present simulation, replaced after a change of moduli. While the node is active, only the stepping
            thread uses it.
        frames: frames of the body.
        last: the last step, or None.
        log_time: log time of the last step in the bag [ns]; it never goes back.
        pace: pace of the steps; None while not active.
    """

    def __init__(
        self,
        node: ManagedNode,
        parameters: NodeParameters,
        simulation: Simulation,
        refusals: RefusalLog,
        ending: threading.Event,
        transforms: Transforms | None,
    ) -> None:
        self.node, self.parameters, self.refusals, self.ending = node, parameters, refusals, ending
        self.simulation = simulation
        self.frames = Frames(parameters["frame_id"], self.scene, transforms)
        self.frames.last = lambda: self.last
        self.last: Step | None = None
        self.log_time = 0
        self.pace: Pace | None = None

    @property
    def scene(self) -> Scene:
        """The scene that is simulated."""
        return self.simulation.scene

    def report(self, text: str) -> None:
        """Log an error."""
        self.node.get_logger().error(text)

    def clock(self) -> int:
        """Return the time on the node's clock [ns]; with ``use_sim_time`` it is 0 before the first /clock message."""
        return self.node.get_clock().now().nanoseconds

    def now(self) -> int:
        """Return the present time of stamps [ns]: simulation time if the node publishes /clock, else its own clock."""
        if self.parameters["publish_clock"]:
            return to_nanoseconds(self.simulation.time)
        return self.clock()

    def stamp(self, ending: float, early: float = 0.0) -> int:
        """Return the stamp [ns] of a step that begins now.

        Args:
            ending: simulation time at the end of the step [s].
            early: time by which the end of the step precedes the present time of an external clock [s].
        """
        if self.parameters["publish_clock"]:
            return to_nanoseconds(ending)
        return self.pace.moment - to_nanoseconds(early) if self.pace.moment else self.clock()

    def simulation_time(self, stamp: int) -> float:
        """Return the simulation time [s] for a stamp [ns], from the time and the stamp of the last step."""
        if self.last is None:
            return self.simulation.time + 1e-9 * (stamp - self.now())
        return self.last.record.time + 1e-9 * (stamp - self.last.record.stamp)

    def follow_clock(self, wake: Callable[[], object]) -> JumpHandle:
        """Inform the pace and call ``wake`` when /clock changes the time, until the returned handle is unregistered.

        Raises:
            GdfeError: the node does not follow the /clock of another node.
        """
        if not self.node.get_parameter("use_sim_time").value or self.parameters["publish_clock"]:
            raise GdfeError("clock external needs another node's /clock: set use_sim_time true and publish_clock false")
        any_jump = JumpThreshold(
            min_forward=Duration(nanoseconds=1), min_backward=Duration(nanoseconds=-1), on_clock_change=True
        )

        def set_by_another(jump: TimeJump) -> None:
            if isinstance(self.pace, ExternalPace):
                self.pace.record_jump(jump.delta.nanoseconds)
            wake()

        return self.node.get_clock().create_jump_callback(any_jump, post_callback=set_by_another)


class StepRequest:
    """Makes a number of steps; other tasks of the stepper run between two of them.

    Args:
        run: owner of the simulation.
        stepper: thread that makes the steps.
        flush: function that waits until the steps are published.
        count: number of steps.
        on_step: function that is called after each step with the number of steps made; None: not called.

    Attributes:
        done: number of steps made so far.
    """

    def __init__(
        self,
        run: Run,
        stepper: SteppingThread,
        flush: Callable[[], None],
        count: int,
        on_step: Callable[[int], None] | None = None,
    ) -> None:
        self._run, self._stepper, self._flush, self._count, self._on_step = run, stepper, flush, count, on_step
        self._future: Future[str] = Future()
        self.done = 0

    def __str__(self) -> str:
        return f"{self.done} of {self._count} steps"

    @property
    def going(self) -> bool:
        """Whether steps are still to be made."""
        return not self._future.done()

    def begin(self) -> Future[str]:
        """Queue the first step, and return a ``Future`` of a message with the number of steps and the time."""
        self._post()
        return self._future

    def end(self, reason: BaseException) -> None:
        """End the request after the step in progress, unless it has ended already; the ``Future`` raises ``reason``."""
        with suppress(InvalidStateError):  # it had ended already
            self._future.set_exception(reason)

    def interrupt(self, why: str) -> None:
        """End the request early; the ``Future`` raises a GdfeError whose text begins with ``why``."""
        self.end(GdfeError(f"{why}; {self} were made"))

    def _post(self) -> None:
        def look(step: Future[None]) -> None:
            if (error := step.exception()) is not None:
                self.end(error)

        self._stepper.post(self._step).add_done_callback(look)

    def _step(self) -> None:
        if self._run.ending.is_set():
            self.interrupt("the node is ending")
        if not self.going:
            return
        self._stepper.advance()
        self.done += 1
        if self._on_step is not None:
            self._on_step(self.done)
        if self.done < self._count:
            self._post()
            return
        self._flush()
        with suppress(InvalidStateError):  # it was ended during its last step
            self._future.set_result(f"{self._count} steps, time {self._run.simulation.time:.9g} s")


@dataclass(frozen=True)
class Leader:
    """The leader of a handle. Either ``topic`` or ``frame`` is its name; the other attribute is empty."""

    handle: Handle
    topic: str = ""
    frame: str = ""

    def __str__(self) -> str:
        return f"topic {self.topic}" if self.topic else f"frame {self.frame}"

    @property
    def key(self) -> str:
        """Key of the handle's input in ``command_set`` and in bags."""
        return f"{self.handle.section}/{self.handle.name}/follow"


def leaders_of(entries: Iterable[str], scene: Scene, *, listening: bool) -> dict[str, Leader]:
    """Return the leaders in the parameter ``follow``: dict from the name of a handle or obstacle to its leader.

    Args:
        entries: entries of the parameter.
        scene: scene with the handles and obstacles.
        listening: whether tf2_msgs is installed, so that the node receives /tf.

    Raises:
        GdfeError: an entry is malformed, names no movable handle or obstacle, names the same handle as another entry,
            or names a frame while tf2_msgs is not installed.
    """
    handles, found = {handle.name: handle for handle in scene.handles}, {}
    for entry in entries:
        name, _, leader = entry.partition("=")
        kind, _, source = leader.partition(":")
        start = f"parameter follow holds {entry!r}"
        if kind not in ("topic", "frame") or not source:
            raise GdfeError(f"{start}; allowed: handle=topic:/name or handle=frame:name")
        if name not in handles:
            raise GdfeError(f"{start}; the scene has no handle {name!r}, but {', '.join(handles) or 'none'}")
        try:
            require_movable(handle := handles[name])
        except CommandError as error:
            raise GdfeError(f"{start}; {error}") from error
        if kind == "frame" and not listening:
            raise GdfeError(f"{start}; frames need tf2_msgs, which is not installed: follow a topic, or install it")
        if name in found:
            raise GdfeError(f"{start}; {handle.noun} {name!r} follows {found[name]} already")
        found[name] = Leader(handle, **{kind: source})
    return found


def refuse_followed(message: object, leader: Leader) -> PoseOrder:
    """Refuse a command to a handle that follows a leader: always raise a ``Refusal``."""
    handle = leader.handle
    raise Refusal(Reason.FOLLOWS, f"{handle.noun} {handle.name!r} follows {leader} and takes no commands")


def make_follower_order(message: PoseStamped, leader: Leader, *, size: float, frames: Frames) -> PoseOrder:
    """Return the order for a handle from a message on its leader's topic; ``size`` is the body's size [m].

    Raises:
        Refusal: no transforms lead to the header's frame, a number is not finite, the quaternion is not of unit
            length, or the pose is farther from rest than ten times the body's size.
    """
    place = frames.place(message.header.frame_id)
    if place is None:
        raise Refusal(Reason.FRAME, f"no transforms lead from {message.header.frame_id!r} to {frames.frame_id!r}")
    return make_pose_order(leader.handle, place @ require_pose(message.pose), size=size, frames=frames)


class Followers:
    """Commands handles that follow a frame on /tf.

    Args:
        leaders: leaders that are frames.
        run: the run whose handles follow.
        put: function that receives the key of an input and its order.
    """

    def __init__(self, leaders: Iterable[Leader], run: Run, put: Callable[[str, PoseOrder], None]) -> None:
        self._leaders, self._run, self._put = list(leaders), run, put
        self._last: dict[str, PoseOrder] = {}

    def look(self, *, anew: bool = False) -> None:
        """Command each handle whose leader has moved since the last call.

        With ``anew``, command each handle whose leader's frame is known, whether or not it has moved.
        """
        if anew:
            self._last.clear()
        source = self._run.node.resolve_topic_name(topics.TF.name)
        for leader in self._leaders:
            frames, size = self._run.frames, self._run.scene.mesh.size
            place: Placement | None = frames.place(leader.frame)
            if place is None:
                continue
            try:
                order = make_pose_order(leader.handle, place, size=size, frames=frames)
                if order != self._last.get(leader.key):
                    self._put(leader.key, replace(order, source=source))
                    self._last[leader.key] = order
            except Refusal as refusal:
                text = f"{leader.handle.noun} {leader.handle.name!r} follows {leader}: {refusal}"
                self._run.refusals.refuse(source, Refusal(refusal.reason, text))
