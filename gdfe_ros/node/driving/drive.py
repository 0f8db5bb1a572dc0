# SPDX-License-Identifier: Apache-2.0
"""Assembly of a step's command from the received orders, and a rate limit that lets the steps converge."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from enum import Enum, auto
from typing import Any, Protocol

import numpy as np

from gdfe_ros.actuators import Actuator, Mode
from gdfe_ros.constraints import Pose
from gdfe_ros.node.driving.orders import (
    ActuatorOrder,
    Order,
    PlaceOrder,
    PoseOrder,
    TeleportOrder,
    TrajectoryOrder,
    TwistOrder,
    require_near,
)
from gdfe_ros.node.refusals import Refusal, RefusalLog
from gdfe_ros.recording.step import Step
from gdfe_ros.scene.scene import Scene
from gdfe_ros.simulation import Command, Simulation

_SLOWEST = 1.0 / 32.0
"""Smallest fraction of the full rate."""
_SLOWER, _FASTER = 0.5, 1.2
"""Factors on the fraction of the full rate: after a step that a deadline ended, and after any other step."""
_HELD, _BACK = 200, 2000
"""Largest numbers of iterations with a constant command, and after a return to the last converged command. A change
that converges needs 5 to 150 iterations.
"""
_LEAST = 4
"""A step counts as at least this number of iterations: near an instability, most of its time is other work."""


class _Phase(Enum):
    """Treatment of pending commands in the next step.

    GO: they change at the limited rate. HOLD: they stay constant. BACK: they go back to the last converged values.
    FREE: only ``slew_time`` limits them. STOP: they stay constant until another goal is given.
    """

    GO = auto()
    HOLD = auto()
    BACK = auto()
    FREE = auto()
    STOP = auto()


class Slew:
    """Limits the rate of actuator commands to a fraction of the full rate, range / slew_time.

    In a step an actuator's command changes by at most ``share`` * range / slew_time * dt. Initially ``share`` is 1. If
    a deadline ends a step before it converges, ``share`` is halved, and the command stays constant until a later step,
    which continues the solve, has converged. Each step that converges increases ``share`` by a fifth, up to 1. Only a
    step that a deadline ended counts as a step that did not converge.

    If the steps with the constant command do not converge within 200 iterations, the command goes back to its last
    converged value, and the next change is half as large. If a change with the smallest ``share``, 1/32, fails in the
    same manner, each following change is twice as large, to pass a limit of stability. If even a change to the goal
    fails, the command stays at its last converged value until another goal is given. If the steps back do not converge
    within 2000 iterations either, the command is not the cause. Then only ``slew_time`` limits it.

    Step records contain the limited commands, so that replays do not depend on this limit.

    Args:
        actuators: actuators of the scene; commands of grips, and of actuators without a finite range, are not limited.

    Attributes:
        goals: dict from actuator name to goal, for commands that have not reached their goals.
        share: present fraction of the full rate.
    """

    def __init__(self, actuators: Iterable[Actuator]) -> None:
        gradual = (actuator for actuator in actuators if actuator.mode is not Mode.GRIP)
        ranges = {actuator.name: actuator.high - actuator.low for actuator in gradual}
        self._ranges = {name: span for name, span in ranges.items() if math.isfinite(span)}
        self.clear()

    def clear(self) -> None:
        """Drop the goals of all commands, and return to the full rate."""
        self.goals: dict[str, float] = {}
        self._good: dict[str, float] = {}
        self._given: dict[str, float] = {}
        self._phase, self.share, self._effort = _Phase.GO, 1.0, 0
        self._leaping = self._missed = False

    @property
    def moving(self) -> bool:
        """Whether a command still changes towards its goal."""
        return bool(self.goals) and not self.stopped

    @property
    def stopped(self) -> bool:
        """Whether commands stay short of their goals because no further step converged within its deadline."""
        return self._phase is _Phase.STOP

    def limit(self, command: Command, present: Mapping[str, float], *, dt: float, slew_time: float) -> Command:
        """Return the limited command of a step.

        Args:
            command: command of this step.
            present: present commands, by name.
            dt: duration of the change [s].
            slew_time: time in which an actuator's command crosses its range [s]; 0: any change is made at once.
        """
        if not self.goals and not command.actuators:
            self._given = {}
            return command
        limited = self._ranges.keys() if slew_time > 0.0 else ()
        wanted = {**self.goals, **command.actuators}
        goals = {name: goal for name, goal in wanted.items() if name in limited}
        if not self.goals:
            self._good = {}
        self._good = {name: self._good.get(name, present[name]) for name in goals}
        if self.stopped and goals != self.goals:
            self._phase, self.share, self._leaping = _Phase.GO, _SLOWEST, False
        self.goals, self._given = goals, {}
        for name, goal in goals.items() if not self.stopped else ():
            reach = self.share * self._ranges[name] * dt / slew_time
            self._given[name] = self._next(name, goal, present[name], reach)
        unlimited = {name: value for name, value in wanted.items() if name not in goals}
        return replace(command, actuators={**unlimited, **self._given})

    def _next(self, name: str, goal: float, present: float, reach: float) -> float:
        """Return an actuator's command in the next step; towards the goal it changes by at most ``reach``."""
        if self._phase is _Phase.HOLD:
            return present
        if self._phase is _Phase.BACK:
            return self._good[name]
        change = goal - present
        return goal if abs(change) <= reach * (1.0 + 1e-9) else present + math.copysign(reach, change)

    def note(self, *, converged: bool, cut: bool, iterations: int) -> None:
        """Record the outcome of a step: whether it converged, whether a deadline ended it, and its iterations."""
        if not self._given:
            return
        self._effort = self._effort + max(_LEAST, iterations) if cut and not converged else 0
        if converged and self._phase is _Phase.BACK:
            self._try_again()
        elif converged or not cut:
            self._good |= self._given
            self.goals = {name: goal for name, goal in self.goals.items() if self._given[name] != goal}
            self._phase, self._leaping = _Phase.GO, False
            self.share = min(1.0, _FASTER * self.share)
        elif self._phase is _Phase.GO:
            self._phase, self._leaping = _Phase.HOLD, self._leaping or self.share < 1.01 * _SLOWEST
            self.share = self.share if self._leaping else max(_SLOWEST, _SLOWER * self.share)
        elif self._phase is _Phase.HOLD and self._effort >= _HELD:
            self._phase, self._effort, self._missed = _Phase.BACK, 0, self._given == self.goals
        elif self._phase is _Phase.BACK and self._effort >= _BACK:
            self._phase, self.share, self._leaping = _Phase.FREE, 1.0, False

    def _try_again(self) -> None:
        """Choose the change after a return to the last converged command: smaller, larger to pass a limit, or none."""
        self._phase = _Phase.STOP if self._leaping and self._missed else _Phase.GO
        self.share *= 2.0 if self._leaping else 1.0


class Host(Protocol):
    """Owner of a simulation that is stepped.

    Attributes:
        simulation: present simulation, used by the stepping thread only; replaced after a change of moduli.
        scene: scene of the simulation.
        parameters: present parameter values by name.
        refusals: counts of refused commands.
        last: the last step, or None.
        log_time: log time of the last step in the bag [ns]; it never goes back.
    """

    simulation: Simulation
    parameters: Mapping[str, Any]
    refusals: RefusalLog
    last: Step | None
    log_time: int

    @property
    def scene(self) -> Scene:
        """The scene that is simulated."""

    def report(self, text: str) -> None:
        """Report an error message to the user."""

    def stamp(self, ending: float, early: float = 0.0) -> int:
        """Return the stamp [ns] of a step that ends at the simulation time ``ending`` [s].

        ``early`` [s] is the time by which this end precedes the present time of an external clock.
        """


class CommandAssembler:
    """Assembles one command per step from orders; used by the stepping thread only.

    A pose command ends the velocity command of its handle. A command for an actuator ends the trajectory of that
    actuator only.

    Args:
        run: owner of the commanded simulation.

    Attributes:
        slew: limits the rate of actuator commands under the wall clock or a deadline.
    """

    def __init__(self, run: Host) -> None:
        self._run, self.slew = run, Slew(run.scene.actuators)
        self._sources: dict[tuple[bool, str], str] = {}
        self.clear()

    def clear(self) -> None:
        """Drop every velocity and trajectory, and commands that have not reached their goals."""
        self.slew.clear()
        self._twists: dict[str, tuple[TwistOrder, float]] = {}
        self._courses: dict[str, _Course] = {}
        self._resting: Command | None = None

    def take_over(self, other: CommandAssembler, bodies: Collection[str]) -> None:
        """Continue the velocities, trajectories and resets of another assembler.

        Waiting teleports are kept only for the free bodies named in ``bodies``.
        """
        self._twists, self._courses, self._resting = other._twists, other._courses, other._resting
        self.slew, self._sources = other.slew, other._sources
        if self._resting is not None:
            kept = {name: pose for name, pose in self._resting.bodies.items() if name in bodies}
            self._resting = replace(self._resting, bodies=kept)

    def refuse(self, command: Command, refusal: Refusal) -> None:
        """Report that a step refuses a command, once for each topic or service that a part of it came from."""
        parts = vars(command).items()
        keys = {(section in ("handles", "bodies"), name) for section, values in parts for name in values}
        for source in sorted({self._sources.get(key, "") for key in keys} - {""}) or ["a step"]:
            self._run.refusals.refuse(source, refusal, late=True)

    def place(self, bodies: Mapping[str, Pose], source: str) -> None:
        """Teleport free bodies with the next command; ``source`` is the service that requests it."""
        self._sources |= {(True, name): source for name in bodies}
        resting = self._resting or Command()
        self._resting = replace(resting, bodies={**resting.bodies, **bodies})

    def rest(self) -> None:
        """Drop every velocity and trajectory. The next command is the initial command, changed only by new orders."""
        self.clear()
        self._resting = self._run.simulation.rest_command()

    @property
    def moving(self) -> bool:
        """Whether the next step changes a command even without a new order."""
        return bool(self._twists or self._courses) or self._resting is not None or self.slew.moving

    def command(self, orders: Iterable[Order], *, time: float, dt: float, slew_time: float) -> Command:
        """Return the command of a step.

        Args:
            orders: orders since the last step.
            time: simulation time at the end of the step [s].
            dt: time for which velocity commands act in this step [s].
            slew_time: shortest time in which an actuator's command crosses its range [s]; 0: no limit.
        """
        first, self._resting = self._resting or Command(), None
        poses: dict[str, Pose] = dict(first.handles)
        actuators: dict[str, float] = {**first.actuators, **first.loads, **first.joints}
        bodies: dict[str, Pose] = dict(first.bodies)
        for order in orders:
            placed = isinstance(order, PlaceOrder | TwistOrder)
            self._sources |= {(placed, name): order.source for name in order.names}
            match order:
                case PoseOrder():
                    self._twists.pop(order.name, None)
                    poses[order.name] = order.after(self._run.simulation.targets[order.name])
                case TwistOrder():
                    self._twists[order.name] = (order, self._run.parameters["velocity_timeout"])
                case TeleportOrder():
                    bodies[order.name] = order.pose
                case ActuatorOrder():
                    actuators.update(order.values)
                    for name in order.values:
                        self._courses.pop(name, None)
                case TrajectoryOrder() if order.ends:
                    for name in order.names:
                        self._courses.pop(name, None)
                case TrajectoryOrder():
                    self._begin_courses(order, actuators, time - dt)
        poses |= self._move_targets(dt, poses)
        values, loads = actuators | self._follow_courses(time), {load.name for load in self._run.simulation.scene.loads}
        joints = self._run.simulation.joint_goals.keys()
        command = Command(
            handles=poses,
            actuators={name: value for name, value in values.items() if name not in loads and name not in joints},
            loads={name: value for name, value in values.items() if name in loads},
            bodies=bodies,
            joints={name: value for name, value in values.items() if name in joints},
        )
        return self.slew.limit(command, self._run.simulation.commands, dt=dt, slew_time=slew_time)

    def _begin_courses(self, order: TrajectoryOrder, given: Mapping[str, float], now: float) -> None:
        """Begin a trajectory at the simulation time ``now`` [s], or refuse it; ``given`` are commands of this step."""
        start = now if order.start is None else order.start
        present = self._run.simulation.commands | self._run.simulation.joint_goals | given
        velocities = self._run.simulation.motor_velocities
        before = np.array([present[name] for name in order.names])
        rates = np.array([velocities.get(name, 0.0) for name in order.names])
        try:
            order.require_limits(before, rates)
        except Refusal as refusal:
            self._run.refusals.refuse(order.source, refusal, late=True)
            if order.refused is not None:
                order.refused(str(refusal))
            return
        for name, value, rate in zip(order.names, before, rates, strict=True):
            self._courses[name] = _Course(start, float(value), float(rate), order.only(name))
        if order.begun is not None:
            order.begun(start, before, rates)

    def _target(self, name: str, poses: Mapping[str, Pose]) -> Pose:
        """Return a handle's target before an order: the target set earlier in this step, or else the present target."""
        return poses.get(name) or self._run.simulation.targets[name]

    def _move_targets(self, dt: float, last: Mapping[str, Pose]) -> dict[str, Pose]:
        """Return the targets after their velocity commands have acted for ``dt`` [s].

        A velocity acts for ``velocity_timeout`` in total. It continues from the last target, even if the body has not
        reached this target.
        """
        poses = {}
        for name, (twist, left) in list(self._twists.items()):
            if twist.still or left - dt < -1e-9:
                del self._twists[name]
                continue
            self._twists[name] = (twist, left - dt)
            pose = twist.after(self._target(name, last), dt)
            try:
                require_near(pose.translation, self._run.simulation.mesh.size)
            except Refusal as refusal:
                del self._twists[name]
                self._run.refusals.refuse(twist.source or name, refusal, late=True)
                continue
            poses[name] = pose
        return poses

    def _follow_courses(self, time: float) -> dict[str, float]:
        """Return the trajectories' commands at a simulation time [s]; a trajectory that has ended is then removed."""
        begun = {name: course for name, course in self._courses.items() if time >= course.start}
        for name, course in begun.items():
            if time - course.start >= course.order.times[-1]:
                del self._courses[name]
        return {name: course.at(time) for name, course in begun.items()}


@dataclass(frozen=True, eq=False)
class _Course:
    """The trajectory of one actuator, load or joint.

    Attributes:
        start: simulation time at which the trajectory starts [s].
        before: command at the start, in the unit of the mode.
        rate: velocity of a joint at the start [rad/s] or [m/s]; 0 for actuators and loads.
        order: the trajectory, restricted to this actuator, load or joint.
    """

    start: float
    before: float
    rate: float
    order: TrajectoryOrder

    def at(self, time: float) -> float:
        """Return the command at a simulation time [s]; before the first point it is interpolated from ``before``."""
        return float(self.order.at(time - self.start, np.array([self.before]), np.array([self.rate]))[0])
