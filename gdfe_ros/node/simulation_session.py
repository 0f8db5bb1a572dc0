# SPDX-License-Identifier: Apache-2.0
"""The node's resources from configure to cleanup: a simulation, its topics, and its threads."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from dataclasses import replace
from functools import partial
from typing import NamedTuple

from rclpy.clock import JumpHandle

from gdfe_ros.constraints import Pose
from gdfe_ros.errors import GdfeError
from gdfe_ros.node.driving.orders import Inbox
from gdfe_ros.node.driving.pace import ClockMode, Lateness, Pace, Solves, make_pace
from gdfe_ros.node.driving.remodelling import with_moduli
from gdfe_ros.node.driving.stepping_thread import SteppingThread
from gdfe_ros.node.frames import Transforms
from gdfe_ros.node.inputs import Inputs
from gdfe_ros.node.interface import MODULUS, RESET_BODIES, topics
from gdfe_ros.node.middleware.channel import StepPublisher, UnmatchedTopics
from gdfe_ros.node.middleware.managed import ManagedNode
from gdfe_ros.node.middleware.ros_types import is_installed
from gdfe_ros.node.outputs import Bags, TopicOutputs
from gdfe_ros.node.parameters import Moduli, NodeParameters
from gdfe_ros.node.refusals import RefusalLog
from gdfe_ros.node.run import Run, StepRequest, leaders_of
from gdfe_ros.recording.step import Begin, Step, observe
from gdfe_ros.scene.scene import Scene
from gdfe_ros.simulation import Simulation


class Handover(NamedTuple):
    """Parts of a started session with which another one continues.

    Attributes:
        pace: pace of the steps.
        inbox: commands that wait for their step.
        paused: whether only requests make further steps.
    """

    pace: Pace
    inbox: Inbox
    paused: bool


class SimulationSession:
    """A configured simulation with its topics; `start` and `stop` serve the transitions activate and deactivate.

    Args:
        node: node that offers the topics.
        parameters: parameters of the node.
        simulation: simulation in its initial state.
        refusals: log of refused commands.
        ending: event that is set by a request to end the process; requests of several steps then stop early.

    Attributes:
        run: holder of the simulation, used by all parts of the session.
        outputs: publishers of the steps.
        stepper: thread that makes the steps.
        inputs: subscriptions of the commands.
        bags: recorder of inputs and outputs.
        strays: search for publishers of commands to unknown names.
        mode: clock that triggers the steps.
        step_publisher: thread that publishes; None while not active.
        step_request: the last request of ~/step, or None.
    """

    def __init__(
        self,
        node: ManagedNode,
        parameters: NodeParameters,
        simulation: Simulation,
        refusals: RefusalLog,
        *,
        ending: threading.Event,
    ) -> None:
        listening = is_installed(topics.TF.type)
        leaders = leaders_of(parameters.entries("follow"), simulation.scene, listening=listening)
        given = {"now": lambda: self.run.now(), "limits": parameters, "refuse": refusals.refuse}
        self._transforms = Transforms(node, lambda: self.inputs.followers.look(), **given) if listening else None
        self.run = run = Run(node, parameters, simulation, refusals, ending, self._transforms)
        self.outputs = TopicOutputs(run)
        store = node.guard(partial(self._deliver_again, stored=True), "publishing a step for later subscribers")
        self.stepper = SteppingThread(run, deliver=self._deliver, store=store)
        self.inputs = Inputs(run, leaders)
        self.bags = Bags(run, self.inputs, self.outputs)
        self._moduli = Moduli(node, self.scene, locked=lambda: self.bags.active, changed=self._change_moduli)
        self.strays = UnmatchedTopics(node, self.scene.handles, refusals)
        self.mode = ClockMode.WALL
        self.step_publisher: StepPublisher | None = None
        self.step_request: StepRequest | None = None
        self._lateness, self._solves = Lateness(), Solves()
        self._jumps: JumpHandle | None = None
        self.outputs.publish_scene(0)

    @property
    def simulation(self) -> Simulation:
        """The simulation; while the node is active, only the stepping thread uses it."""
        return self.run.simulation

    @property
    def scene(self) -> Scene:
        """The scene that is simulated."""
        return self.simulation.scene

    def start(self, before: Handover | None = None, *, paused: bool = False) -> None:
        """Start the threads; the present state is published at once.

        Args:
            before: parts of the session that ran before; no new bag then begins.
            paused: whether only requests make steps; ``before.paused`` has the same effect.

        Raises:
            GdfeError: the bag cannot be created, ``command_set`` names an unknown input, or the external clock is not
                set up.
        """
        self._telling = False
        self.mode, command_set = ClockMode(self.run.parameters["clock"]), self._command_set()
        if self.mode is ClockMode.EXTERNAL:
            self._jumps = self._jumps or self.run.follow_clock(self.stepper.wake)
        if self.run.parameters["record"] and before is None:
            self.stepper.begin_bag(self.bags.begin)
        inbox = Inbox(self.stepper.changed, queued=self.mode is ClockMode.LOCKSTEP, command_set=command_set)
        if before is None:
            pace = make_pace(self.mode, self.run.parameters, self.run.clock, self._warn)
        else:
            pace = before.pace
            inbox.take_over(before.inbox, self._bodies)
        self.run.pace = pace
        self.step_publisher = StepPublisher(self.run.node.guard(self.outputs.publish_step, "publishing a step"))
        # Before the first state is published, because a client may send commands as soon as it has received it.
        self.inputs.inbox = inbox
        self.stepper.start(pace, inbox, paused=paused or (before is not None and before.paused))
        self.inputs.followers.look(anew=True)

    def halt(self) -> Handover | None:
        """End the threads but keep all commands; return the parts with which another session continues.

        Functions that wait to run between two steps run first. The result is None if the session is not started.
        """
        if self.inputs.inbox is None:
            return None
        self.stepper.stop(drain=True)
        found = Handover(self.run.pace, self.inputs.inbox, self.stepper.paused)
        self._end()
        return found

    def take_over(self, other: SimulationSession) -> None:
        """Continue the commands of another session, after it has halted."""
        self.stepper.take_over(other.stepper, self._bodies)
        self.inputs.take_over(other.inputs)
        self._lateness = other._lateness

    @property
    def _bodies(self) -> set[str]:
        """Names of the free bodies: rigid bodies, and soft bodies beside the scene's body."""
        return {body.name for body in self.scene.rigid_bodies} | set(self.scene.soft_bodies)

    def stop(self) -> None:
        """End the threads after the step in progress, publish queued steps, and finish the bag."""
        self.stepper.stop()
        self.inputs.give_up("the node was deactivated")
        self._end()

    def _end(self) -> None:
        """End the remaining parts after the stepping has ended."""
        self.inputs.inbox = None
        if self.step_publisher is not None:
            self.step_publisher.stop()
        if self._jumps is not None:
            self._jumps.unregister()
        self.step_publisher = self.run.pace = self._jumps = None
        if self.bags.active:
            self.bags.finish()

    def close(self) -> None:
        """Remove topics and parameters of a session without threads."""
        self._moduli.destroy()
        self.inputs.destroy()
        if self._transforms is not None:
            self._transforms.destroy()
        self.outputs.destroy()

    def connections(self) -> dict[str, int]:
        """Return a dict from topic to the number of other endpoints that the middleware has connected to it."""
        found = {channel.info.name: channel.subscribers for channel in self.outputs.channels}
        return found | self.inputs.connections()

    def look(self) -> None:
        """Check for commands to unknown names, late, long and failed steps, and subscribers without the last state."""
        self.strays.look()
        text = self._lateness.look(
            self.run.pace,
            steps=self.stepper.count,
            rate=self.run.parameters["rate"],
            at=self.simulation.time,
            slewing=self.stepper.drive.slew.moving,
        )
        for each in (text, self._solves.look(self.run.last), self._solves.wait(self.stepper.work)):
            if each is not None:
                self._warn(each)
        self.greet(thorough=True)

    def greet(self, *, thorough: bool = False) -> None:
        """Publish the last state again if subscribers lack it; ``thorough``: see `Channel.look_for_newcomers`."""
        if self.outputs.look_for_newcomers(thorough=thorough) and self.stepper.running and not self._telling:
            self._telling = True
            self.stepper.post_reading(self.run.node.guard(self._deliver_again, "publishing to late subscribers"))

    def waiting(self) -> str:
        """Return a text with the inputs that a lockstep step waits for."""
        with self.stepper.changed:
            missing = self.inputs.inbox.missing() if self.inputs.inbox is not None else []
        return ", ".join(f"~/{key}" for key in missing) or "any command"

    def has_arrived(self) -> bool:
        """Return whether the last step's error estimate is within the tolerance and every handle is at its target.

        The result can be True for a step that is not marked as converged: a deadline may end a solve after it has
        converged and before it is checked.
        """
        result, solver, mesh = self.run.last.result, self.scene.solver, self.scene.mesh
        reach, targets = solver.tolerance * mesh.size, self.simulation.targets
        off = (each.error(targets[each.name], mesh.vertices, result.positions) for each in self.scene.handles)
        return result.error_estimate <= solver.tolerance and max(off, default=0.0) <= reach

    def interrupt(self, why: str) -> None:
        """End the request of ~/step in progress, if any; its answer states the reason ``why``."""
        if self.step_request is not None:
            self.step_request.interrupt(why)

    def play(self) -> None:
        """Resume the stepping.

        Raises:
            GdfeError: a request of ~/step is in progress; the clock's own steps would interfere with it.
        """
        self.require_no_step_request("cancel it, or end it with ~/pause true or ~/reset, and try again")
        self.stepper.pause(False)

    def require_no_step_request(self, remedy: str) -> None:
        """Raise a GdfeError with a remedy if a request of ~/step is in progress."""
        if self.step_request is not None and self.step_request.going:
            raise GdfeError(f"a request has made {self.step_request}; {remedy}")

    def reset(self) -> str:
        """Set the simulation to its initial state at time 0, and return a message; followers then go to their leaders.

        Called between steps.
        """
        self.stepper.reset()
        self.forget_commands("the simulation was reset")
        self.flush()
        return "at rest, time 0"

    def reset_commands(self) -> str:
        """Set all commands to their initial values with the next step, and return a message.

        Followers stay with their leaders. Called between steps.
        """
        self.stepper.drive.rest()
        if self.inputs.inbox is not None:
            self.inputs.inbox.clear()
        self.forget_commands("the commands were reset")
        return "the next step goes back to the commands of rest"

    def forget_commands(self, why: str) -> None:
        """End trajectories for the reason ``why``, accept any stamp, and send followers to their leaders again."""
        self.inputs.give_up(why)
        self.inputs.freshness.reset()
        self.inputs.followers.look(anew=True)

    def reset_bodies(self) -> str:
        """Put every rigid body back to its rest pose with the next step, and return a message with their names.

        Raises:
            GdfeError: the scene has no rigid bodies.
        """
        names = [body.name for body in self.scene.rigid_bodies]
        if not names:
            raise GdfeError(f"scene {self.scene.name!r} has no rigid bodies; ~/reset goes back to rest as a whole")
        source = self.run.node.resolve_service_name(RESET_BODIES.name)
        self.stepper.drive.place(dict.fromkeys(names, Pose()), source)
        return f"the next step puts back {', '.join(names)}"

    def continue_from(self, reset: Callable[[], None], why: str) -> None:
        """Continue from the state after a partial ``reset``; ``why`` is the reason that ends trajectories.

        Called between steps.

        Raises:
            GdfeError: a bag is being written, or the simulation cannot be reset so.
        """
        self.bags.require_none()
        reset()
        self.stepper.restart(Begin.LOADED)
        if self._transforms is not None:
            self._transforms.reset()
        self.forget_commands(why)
        self.flush()

    def take_steps(self, count: int, on_step: Callable[[int], None] | None = None) -> Future[str]:
        """Start a requested number of steps, and return a ``Future`` of a text with their number and the time.

        Args:
            count: number of steps.
            on_step: function that is called after each step with the number of steps made; None: not called.

        Raises:
            GdfeError: the clock makes steps by itself, or another request is in progress.
        """
        if self.mode is not ClockMode.LOCKSTEP and not self.stepper.paused:
            raise GdfeError(f"clock {self.mode.value} is running; pause it with ~/pause, or use clock lockstep")
        self.require_no_step_request("~/pause or ~/reset ends it")
        self.step_request = StepRequest(self.run, self.stepper, self.flush, count, on_step)
        return self.step_request.begin()

    def flush(self) -> None:
        """Wait until every step made so far is published and recorded."""
        if self.step_publisher is not None:
            self.step_publisher.flush()

    def record(self, wanted: bool) -> str:
        """Begin or finish a bag, and return a message with its path or summary. Called between steps, while active.

        Raises:
            GdfeError: the bag to begin cannot be created, another bag is being written, there is no bag to finish, or
                its recording ended early.
        """
        if wanted == self.bags.active:
            raise GdfeError(f"the node is {'recording' if wanted else 'not recording'} already")
        self.flush()
        if self.bags.active:
            text = self.bags.finish()
            if self.bags.failed:
                raise GdfeError(text)
            return text
        text = self.stepper.begin_bag(self.bags.begin)
        self.stepper.repeat(self.stepper.begin)
        return text

    def _warn(self, text: str) -> None:
        self.run.node.get_logger().warning(text)

    def _deliver(self, step: Step) -> None:
        """Report a step to trajectories, and queue it for publishing if a subscriber or a bag needs a part of it."""
        self.inputs.look(step)
        if step.first or step.stored or self.outputs.wanted:
            self.step_publisher.put(step)

    def _deliver_again(self, *, stored: bool = False) -> None:
        """Publish the last step again, e.g. to a new subscriber, even while the next step is being made.

        Joints of arms move at the start of a step; during it, their positions are taken from the last step. If
        ``stored``, the last step is published on all topics that lack it, for subscribers that come later.
        """
        self._telling, last = False, self.run.last
        if last is None:
            return
        again = observe(self.simulation)
        if self.stepper.stepping:
            again |= {"joints": last.joints, "links": last.links}
        self.step_publisher.put(replace(last, first=False, again=True, stored=stored, **again))

    def _change_moduli(self, moduli: Mapping[str, float]) -> None:
        """Replace the simulation by one with other moduli that is solved at the present commands, or goes on moving."""

        def swap() -> None:
            self.run.simulation = with_moduli(self.simulation, moduli, interrupted=self.stepper.must_end)
            self.outputs.publish_scene(self.run.log_time)
            self.stepper.repeat(Begin.LOADED)

        # Later commands are consumed after the change. The steps wait for it, but the node's other callbacks do not.
        parameters = ", ".join(f"{MODULUS.name.format(material=name)}={young:g}" for name, young in moduli.items())
        what = f"going to the equilibrium with {parameters}"
        self.stepper.post(self.run.node.guard(swap, "a change of moduli"), what)

    def _command_set(self) -> list[str]:
        keys = self.run.parameters.entries("command_set")
        unknown = sorted(set(keys) - set(self.inputs.keys))
        if unknown:
            raise GdfeError(
                f"parameter command_set names {', '.join(unknown)}; the inputs of scene {self.scene.name!r} are "
                f"{', '.join(self.inputs.keys) or 'none'}"
            )
        return keys
