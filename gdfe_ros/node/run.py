# SPDX-License-Identifier: Apache-2.0
"""State of a configured node, common to its parts: simulation, frames, clock; and requests for several steps."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future, InvalidStateError
from contextlib import suppress

from rclpy.clock import JumpHandle, JumpThreshold, TimeJump
from rclpy.duration import Duration

from gdfe_ros.errors import GdfeError
from gdfe_ros.node.frames import Frames, Transforms
from gdfe_ros.node.managed import ManagedNode
from gdfe_ros.node.pace import ExternalPace, Pace, Timing
from gdfe_ros.node.parameters import NodeParameters
from gdfe_ros.node.refusals import RefusalLog
from gdfe_ros.node.stepper import SteppingThread
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

    def timing(self) -> Timing:
        """Return the present values of the parameters that determine the pace of the steps."""
        values = self.parameters
        return Timing(values["rate"], values["dt"], values["heartbeat"], values["publish_clock"])

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
        """Inform the pace and call ``wake`` whenever the external clock changes, until the handle is unregistered.

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
                self.pace.jumped(jump.delta.nanoseconds)
            wake()

        return self.node.get_clock().create_jump_callback(any_jump, post_callback=set_by_another)


class Walk:
    """Makes a number of steps; other tasks of the stepper run between two of them.

    Args:
        run: owner of the simulation.
        stepper: thread that makes the steps.
        flush: function that waits until the steps are published.
        count: number of steps.
        told: function that is called after each step with the number of steps made; None: not called.

    Attributes:
        done: number of steps made so far.
    """

    def __init__(
        self,
        run: Run,
        stepper: SteppingThread,
        flush: Callable[[], None],
        count: int,
        told: Callable[[int], None] | None = None,
    ) -> None:
        self._run, self._stepper, self._flush, self._count, self._told = run, stepper, flush, count, told
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
        if self._told is not None:
            self._told(self.done)
        if self.done < self._count:
            self._post()
            return
        self._flush()
        with suppress(InvalidStateError):  # it was ended during its last step
            self._future.set_result(f"{self._count} steps, time {self._run.simulation.time:.9g} s")
