# SPDX-License-Identifier: Apache-2.0
"""A run in the page's own process, without ROS, and conversion of the scene's program to orders for each step."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Future
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any

from gdfe_ros.constraints import Pose
from gdfe_ros.errors import CommandError, GdfeError
from gdfe_ros.live.interface import Ability, ShownRun, View
from gdfe_ros.node.driving.orders import ActuatorOrder, Inbox, Order, PoseOrder, require_order
from gdfe_ros.node.driving.pace import ClockMode, FastPace, WallPace
from gdfe_ros.node.driving.remodelling import moduli_of, with_moduli
from gdfe_ros.node.driving.stepping_thread import SteppingThread
from gdfe_ros.node.refusals import RefusalLog
from gdfe_ros.recording.bag_info import make_run_folder
from gdfe_ros.recording.step import Begin, Step, to_nanoseconds
from gdfe_ros.scene.program import Program
from gdfe_ros.scene.scene import Scene
from gdfe_ros.simulation import Simulation


class Programme:
    """Plays a program from a given simulation time on, except for items that another source commands.

    One thread may call `leave` while another thread calls `give`. After `leave` has returned, no more orders for the
    given names are sent.

    Args:
        program: program of the scene.
        start: simulation time at which the program begins [s].
        targets: present targets of the handles; None: those at the beginning of the program.

    Attributes:
        start: simulation time at which the program begins [s].
    """

    def __init__(self, program: Program, start: float, targets: Mapping[str, Pose] | None = None) -> None:
        self._program, self.start = program, start
        self._left: set[str] = set()
        self._last = dict(program.handle_poses(0.0) if targets is None else targets)
        self._giving = threading.Lock()

    def progress(self, time: float) -> str:
        """Return a text with the progress of the program at a simulation time [s]."""
        return f"plays the program, {max(0.0, time - self.start):.2f} of {self._program.duration:g} s"

    def leave(self, names: Iterable[str]) -> None:
        """Stop commanding the named handles, actuators, loads and joints, because another source commands them now."""
        with self._giving:
            self._left.update(names)

    def over(self, time: float) -> bool:
        """Return whether the program has ended at a simulation time [s]."""
        return time - self.start >= self._program.duration

    def give(self, time: float, send: Callable[[str, Order], None]) -> None:
        """Send the orders for a step that ends at a simulation time [s]; ``send`` receives the name and the order.

        Raises:
            CommandError: a handle would turn by more than pi since the last call.
        """
        with self._giving:
            for name, order in self._orders(time):
                send(name, order)

    def _orders(self, time: float) -> list[tuple[str, Order]]:
        moment = time - self.start
        poses = self._program.handle_poses(moment)
        orders: list[tuple[str, Order]] = [
            (name, PoseOrder.toward(name, pose, self._last[name]))
            for name, pose in poses.items()
            if name not in self._left
        ]
        self._last |= poses
        values = self._program.actuator_values(moment) | self._program.load_factors(moment)
        values |= self._program.joint_positions(moment)
        values = {name: value for name, value in values.items() if name not in self._left}
        return [*orders, *([("program", ActuatorOrder(values))] if values else [])]


if TYPE_CHECKING:
    from gdfe_ros.live.bag import LiveBag

_LONG = 0.3
"""A solve is reported if it takes longer than this time [s]."""


class RestingPace(WallPace):
    """Makes steps in real time; while idle, simulation time does not advance.

    Therefore the first step after an idle time, e.g. for a slider's move or a program, always has the duration dt.
    """

    def begin(self) -> float:
        """Begin a step and return its simulation time [s]: dt after an idle time, otherwise as `WallPace`."""
        if self._idle:
            self.restart()
        return super().begin()


class LiveSession(ShownRun):
    """Steps a simulation and passes on each step; owner of the simulation for `SteppingThread` and `CommandAssembler`.

    Args:
        simulation: simulation that is ready to step; from now on, only the stepping thread may use it.
        dt: simulation time of a step [s].
        clock: ``WALL``: steps in real time, if the machine is fast enough; ``FAST``: steps as fast as possible.
        on_view: function that is called in the stepping thread with the view of each step; it must be fast.
        warn: function that receives texts about refused commands and other texts for the user.

    Attributes:
        simulation: present simulation, replaced after a change of moduli.
        parameters: dict from a name of the node's parameters to its value here.
        refusals: counts of refused commands.
        last: the last step, or None.
        log_time: log time of the last step in the bag [ns].
        playing: the program in progress, or None.
        stepper: the stepping thread.
    """

    def __init__(
        self,
        simulation: Simulation,
        *,
        dt: float = 0.01,
        clock: ClockMode = ClockMode.WALL,
        on_view: Callable[[View], None] = lambda view: None,
        warn: Callable[[str], None] = lambda text: None,
    ) -> None:
        self.simulation = simulation
        self.parameters: dict[str, Any] = {
            "dt": dt,
            "rate": 1.0 / dt,
            "heartbeat": 0.0,
            "publish_clock": False,
            "velocity_timeout": 0.5,
            "slew_time": 0.0,
            "deadline": 0.0,
            "cut_after": -1,
        }
        self.refusals = RefusalLog(warn)
        self.last: Step | None = None
        self.log_time = 0
        self._clock, self._on_view, self._warn = clock, on_view, warn
        self.playing: Programme | None = None
        self._bag: LiveBag | None = None
        self.stepper = SteppingThread(self, deliver=self._deliver)
        self._inbox = Inbox(self.stepper.changed, queued=False)

    @property
    def scene(self) -> Scene:
        """The scene that is simulated."""
        return self.simulation.scene

    @property
    def recording(self) -> str | None:
        """Path of the bag that is being written, or None."""
        return None if self._bag is None else str(self._bag.path)

    @property
    def title(self) -> str:
        """The scene's name."""
        return self.scene.name

    @property
    def commands(self) -> Mapping[str, float]:
        """Present commands of actuators, loads and joints, by name."""
        return self.simulation.commands | self.simulation.joint_goals

    @property
    def targets(self) -> Mapping[str, Pose]:
        """Present targets of handles and obstacles by name, relative to rest."""
        return self.simulation.targets

    @property
    def moduli(self) -> Mapping[str, float]:
        """Present Young's moduli [Pa] by material."""
        return moduli_of(self.scene)

    @property
    def paused(self) -> bool:
        """Whether steps are made only on request."""
        return self.stepper.paused

    def doing(self) -> tuple[str, bool]:
        """Return a text about the activity and whether it is a problem; empty while idle or following commands."""
        if self.stepper.failure:
            return f"paused: {self.stepper.failure}", True
        work, playing = self.stepper.work, self.playing
        if work is not None and monotonic() - work[1] > _LONG:
            return f"{work[0]}, since {monotonic() - work[1]:.1f} s", False
        if self.paused:
            return "paused", False
        return "" if playing is None else playing.progress(self.last.record.time), False

    def ask(self, ability: Ability) -> Future[str] | None:
        """Carry out a request; return a ``Future`` of a text for users if it begins or completes a bag, else None."""
        match ability:
            case Ability.PLAY:
                self.play()
            case Ability.PAUSE:
                self.stepper.pause(not self.paused)
            case Ability.STEP:
                self.stepper.post(self.stepper.advance)
            case Ability.RESET:
                self.reset()
            case Ability.RECORD:
                return self.record(make_run_folder(self.scene.name) if self._bag is None else None)
        return None

    def start(self) -> None:
        """Start the stepping thread; it passes on the present state at once."""
        kind = FastPace if self._clock is ClockMode.FAST else RestingPace
        self.stepper.start(kind(self.parameters), self._inbox)

    def stop(self) -> None:
        """End the thread after the step in progress, and complete the bag."""
        self.stepper.stop()
        if self._bag is not None:
            self._bag, bag = None, self._bag
            bag.close()

    def stamp(self, ending: float, early: float = 0.0) -> int:
        """Return the stamp [ns] of a step: its simulation time ``ending`` [s]."""
        return to_nanoseconds(ending)

    def command(self, name: str, order: Order) -> None:
        """Queue an order for the next step; the program stops commanding the same items.

        Raises:
            Refusal: a number is not finite, or a target is too far from rest.
        """
        require_order(name, order, self.simulation.mesh.size)
        if self.playing is not None:
            self.playing.leave(order.names)
        self._inbox.put(name, order)

    def play(self) -> None:
        """Play the scene's program from its beginning, starting at the present state.

        Raises:
            GdfeError: the scene has no program.
        """
        program = self.scene.program
        if program is None:
            raise GdfeError(f"scene {self.scene.name!r} has no program to play; add the key 'program'")

        def begin() -> None:
            self.playing = Programme(program, self.simulation.time, self.simulation.targets)
            self._feed(self.simulation.time)
            self.stepper.pause(False)

        self.stepper.post(begin)

    def reset(self) -> None:
        """Set the simulation to its initial state at time 0, and end the program."""

        def back() -> None:
            self.playing = None
            self.stepper.reset()

        self.stepper.post(back, urgent=True)

    def record(self, path: Path | None) -> Future[str]:
        """Begin a bag in the directory ``path``; None: complete the present bag. Return a ``Future`` of a message.

        The ``Future`` raises a GdfeError in three cases: another bag is being written, there is no bag to complete, or
        the bag cannot be created.
        """
        return self.stepper.post(lambda: self._end_bag() if path is None else self._begin_bag(path))

    def set_moduli(self, moduli: Mapping[str, float]) -> Future[None]:
        """Set Young's moduli [Pa] by material. The body goes to its new equilibrium or, with dynamics, keeps moving.

        The ``Future`` raises a GdfeError for an invalid value, and while a bag is written, because a replay could not
        repeat the change.
        """

        def swap() -> None:
            if self._bag is not None:
                raise GdfeError("a bag is being written, and a replay could not follow; finish it first")
            self.simulation = with_moduli(self.simulation, moduli, interrupted=self.stepper.must_end)
            self.stepper.repeat(Begin.LOADED)

        texts = ", ".join(f"{name} {young:g} Pa" for name, young in moduli.items())
        return self.stepper.post(swap, f"going to the equilibrium with {texts}")

    def _begin_bag(self, path: Path) -> str:
        from gdfe_ros.live.bag import LiveBag  # imported here, so that a run without recording starts faster

        if self._bag is not None:
            raise GdfeError(f"{self._bag.path} is being written already")
        dt = self.parameters["dt"]
        self._bag = self.stepper.begin_bag(lambda state: LiveBag(path, self.scene, state=state, dt=dt))
        self.stepper.repeat(self.stepper.begin)
        return f"recording to {path}"

    def _end_bag(self) -> str:
        if self._bag is None:
            raise GdfeError("no bag is being written")
        self._bag, bag = None, self._bag
        return bag.close()

    def _deliver(self, step: Step) -> None:
        """Record a step, pass it on, and let the program command the next step."""
        if self._bag is not None:
            self._bag.write(step)
        self._on_view(View.of(step))
        self._feed(step.record.time)

    def _feed(self, time: float) -> None:
        """Queue the program's orders for the step after a simulation time [s]."""
        if self.playing is None:
            return
        if self.playing.over(time):
            self.playing = None
            return
        try:
            self.playing.give(time + self.parameters["dt"], self._inbox.put)
        except CommandError as error:
            self.playing = None
            self._warn(f"the program ends here: {error}")

    def report(self, text: str) -> None:
        """Report a failed step."""
        self._warn(text)
