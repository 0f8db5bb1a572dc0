# SPDX-License-Identifier: Apache-2.0
"""A simulation that runs while it is looked at: stepped in a thread of its own, commanded through one inbox."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import Future
from datetime import datetime
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any

from gdfe_ros.checkpoint import save_state
from gdfe_ros.constraints import Pose
from gdfe_ros.errors import GdfeError
from gdfe_ros.live.interface import Ability
from gdfe_ros.live.orders import require_order
from gdfe_ros.live.programme import Programme
from gdfe_ros.live.view import View
from gdfe_ros.node.inbox import Inbox
from gdfe_ros.node.orders import ActuatorOrder, Order
from gdfe_ros.node.pace import ClockMode, FastPace, Timing, WallPace
from gdfe_ros.node.refusals import RefusalLog
from gdfe_ros.node.remodelling import moduli_of, with_moduli
from gdfe_ros.node.step import Demand, Step, to_nanoseconds
from gdfe_ros.node.stepper import Stepper
from gdfe_ros.recording.step_record import Begin
from gdfe_ros.scene.scene import Scene
from gdfe_ros.simulation import Simulation

if TYPE_CHECKING:
    from gdfe_ros.live.bag import LiveBag

_LONG = 0.3
"""Time after which it is told that a solve takes long [s]."""


class RestingPace(WallPace):
    """Steps in real time; while there is nothing to do, time stands.

    So what comes first after a rest, a slider's move or a program, covers one step, however long the rest was.
    """

    def begin(self) -> float:
        """Cover one dt after a rest, else as `WallPace` does."""
        if self._idle:
            self.restart()
        return super().begin()


class LiveSession:
    """Steps a simulation and tells of each step; the node's `Stepper` and `Drive` see it as their host.

    Args:
        simulation: ready to step; touched by the stepping thread only from now on.
        dt: simulation time of a step [s].
        clock: ``WALL`` steps in real time where the machine keeps up, ``FAST`` as fast as it goes.
        told: called in the stepping thread with what is shown of each step; it must be quick.
        warn: takes the text of a refused command, or of what else a user should know.

    Attributes:
        simulation: another one after a change of moduli.
        parameters: values in force, named as the node's.
        refusals: counts refused commands.
        last: the step made last, or None.
        log_time: of that step, for the bag [ns].
        stepper: the thread that steps.
    """

    def __init__(
        self,
        simulation: Simulation,
        *,
        dt: float = 0.01,
        clock: ClockMode = ClockMode.WALL,
        told: Callable[[View], None] = lambda view: None,
        warn: Callable[[str], None] = lambda text: None,
    ) -> None:
        self.simulation = simulation
        self.parameters: dict[str, Any] = {
            "dt": dt,
            "velocity_timeout": 0.5,
            "slew_time": 0.0,
            "deadline": 0.0,
            "cut_after": -1,
        }
        self.refusals = RefusalLog(warn)
        self.last: Step | None = None
        self.log_time = 0
        self._clock, self._told, self._warn = clock, told, warn
        self._programme: Programme | None = None
        self._bag: LiveBag | None = None
        self.stepper = Stepper(self, lambda: Demand(imus=False), deliver=self._deliver)
        self._inbox = Inbox(self.stepper.changed, queued=False)

    @property
    def scene(self) -> Scene:
        """The scene that is simulated."""
        return self.simulation.scene

    @property
    def playing(self) -> Programme | None:
        """The program that is played, or None."""
        return self._programme

    @property
    def recording(self) -> str | None:
        """The bag that is written, or None."""
        return None if self._bag is None else str(self._bag.path)

    @property
    def abilities(self) -> frozenset[Ability]:
        """All, but to play a program that the scene has not."""
        return frozenset(Ability) - ({Ability.PLAY} if self.scene.program is None else frozenset())

    @property
    def title(self) -> str:
        """The scene's name."""
        return self.scene.name

    @property
    def commands(self) -> Mapping[str, float]:
        """Commands in force of actuators and loads."""
        return self.simulation.commands

    @property
    def targets(self) -> Mapping[str, Pose]:
        """Targets in force."""
        return self.simulation.targets

    @property
    def moduli(self) -> Mapping[str, float]:
        """Young's moduli in force [Pa] by material."""
        return moduli_of(self.scene)

    @property
    def paused(self) -> bool:
        """Whether only `advance` makes steps."""
        return self.stepper.paused

    def watch(self, wanted: bool) -> None:
        """Tell of steps whether anybody looks or not: plots show what was before."""

    def doing(self) -> tuple[str, bool]:
        """Say what it does and whether that is bad; nothing where it follows commands or rests."""
        if self.stepper.failure:
            return f"paused: {self.stepper.failure}", True
        work, playing = self.stepper.work, self._programme
        if work is not None and monotonic() - work[1] > _LONG:
            return f"{work[0]}, since {monotonic() - work[1]:.1f} s", False
        if self.paused:
            return "paused", False
        if playing is None:
            return "", False
        moment = max(0.0, self.last.record.time - playing.start)
        return f"plays the program, {moment:.2f} of {playing.duration:g} s", False

    def ask(self, ability: Ability) -> Future[str] | None:
        """Do what a button asks for."""
        match ability:
            case Ability.PLAY:
                self.play()
            case Ability.PAUSE:
                self.pause(not self.paused)
            case Ability.STEP:
                self.advance()
            case Ability.RESET:
                self.reset()
            case Ability.RECORD:
                name = f"{self.scene.name}_{datetime.now():%Y%m%d_%H%M%S_%f}"
                return self.record(Path("runs") / name if self._bag is None else None)
        return None

    def start(self) -> None:
        """Start the thread; it tells of the present state at once."""
        dt = self.parameters["dt"]
        kind = FastPace if self._clock is ClockMode.FAST else RestingPace
        self.stepper.start(kind(lambda: Timing(1.0 / dt, dt, 0.0, False)), self._inbox)

    def stop(self) -> None:
        """End the thread after the step in progress, and complete the bag."""
        self.stepper.stop()
        if self._bag is not None:
            self._bag, bag = None, self._bag
            bag.close()

    def stamp(self, ending: float, early: float = 0.0) -> int:
        """Give the stamp [ns] of a step that ends at a simulation time [s]: that time."""
        return to_nanoseconds(ending)

    def command(self, name: str, order: Order) -> None:
        """Give an order to the next step; what it commands leaves the program that is played.

        Raises:
            Refusal: a number is not finite, or something is led too far away.
        """
        require_order(name, order, self.simulation.mesh.size)
        if self._programme is not None:
            self._programme.leave(order.values if isinstance(order, ActuatorOrder) else (name,))
        self._inbox.put(name, order)

    def play(self) -> None:
        """Play the scene's program from its beginning, from the present state on.

        Raises:
            GdfeError: the scene has none.
        """
        program = self.scene.program
        if program is None:
            raise GdfeError(f"scene {self.scene.name!r} has no program to play; add the key 'program'")

        def begin() -> None:
            self._programme = Programme(program, self.simulation.time)
            self._feed(self.simulation.time)
            self.stepper.pause(False)

        self.stepper.post(begin)

    def pause(self, paused: bool) -> None:
        """Hold the stepping, or let it go on."""
        self.stepper.pause(paused)

    def advance(self) -> None:
        """Make one step, whatever a pause says."""
        self.stepper.post(self.stepper.advance)

    def reset(self) -> None:
        """Go back to rest at time 0; the program ends."""

        def back() -> None:
            self._programme = None
            self.stepper.reset()

        self.stepper.post(back, urgent=True)

    def record(self, path: Path | None) -> Future[str]:
        """Begin a bag in a new directory, or with None complete the one that is written; tell how it went.

        The answer raises a GdfeError where it is so already, or the bag cannot be begun.
        """
        return self.stepper.post(lambda: self._end_bag() if path is None else self._begin_bag(path))

    def set_moduli(self, moduli: Mapping[str, float]) -> Future[None]:
        """Give materials other Young's moduli [Pa]; the body goes to its new equilibrium, or moves on from here.

        The answer raises a GdfeError while a bag is written, which a replay could not follow, or for a bad value.
        """

        def swap() -> None:
            if self._bag is not None:
                raise GdfeError("a bag is being written, and a replay could not follow; finish it first")
            self.simulation = with_moduli(self.simulation, moduli, interrupted=self.stepper.must_end)
            self.stepper.resume()

        texts = ", ".join(f"{name} {young:g} Pa" for name, young in moduli.items())
        return self.stepper.post(swap, f"going to the equilibrium with {texts}")

    def _begin_bag(self, path: Path) -> str:
        from gdfe_ros.live.bag import LiveBag  # a run that is not recorded starts without it

        if self._bag is not None:
            raise GdfeError(f"{self._bag.path} is being written already")
        state = None if self.stepper.begin is Begin.REST else save_state(self.simulation)
        self._bag = LiveBag(path, self.simulation, state=state, dt=self.parameters["dt"])
        self.stepper.repeat(self.stepper.begin if state is None else Begin.LOADED)
        return f"recording to {path}"

    def _end_bag(self) -> str:
        if self._bag is None:
            raise GdfeError("no bag is being written")
        self._bag, bag = None, self._bag
        return bag.close()

    def _deliver(self, step: Step) -> None:
        """Record a step, tell of it, and have the program command the next one."""
        if self._bag is not None:
            self._bag.write(step)
        self._told(View.of(step))
        self._feed(step.record.time)

    def _feed(self, time: float) -> None:
        """Give the program's orders for the step after a simulation time [s]."""
        if self._programme is None:
            return
        if self._programme.over(time):
            self._programme = None
            return
        self._programme.give(time + self.parameters["dt"], self._inbox.put)

    def report(self, text: str) -> None:
        """Tell of a step that failed."""
        self._warn(text)
