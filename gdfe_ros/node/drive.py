# SPDX-License-Identifier: Apache-2.0
"""Assembly of the command of each step from orders, velocities and trajectories."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from gdfe_ros.constraints import Pose
from gdfe_ros.node.host import Host
from gdfe_ros.node.orders import (
    ActuatorOrder,
    Order,
    PoseOrder,
    TeleportOrder,
    TrajectoryOrder,
    TwistOrder,
    require_near,
)
from gdfe_ros.node.refusals import Refusal
from gdfe_ros.node.slew import Slew
from gdfe_ros.simulation import Command


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
        self.clear()

    def clear(self) -> None:
        """Drop every velocity and trajectory, and commands on their way to their goals."""
        self.slew.clear()
        self._twists: dict[str, tuple[TwistOrder, float]] = {}
        self._courses: dict[str, _Course] = {}
        self._resting: Command | None = None

    def take_over(self, other: CommandAssembler, bodies: Collection[str]) -> None:
        """Continue the velocities, trajectories and requests of another assembler; only ``bodies`` are teleported."""
        self._twists, self._courses, self._resting = other._twists, other._courses, other._resting
        self.slew = other.slew
        if self._resting is not None:
            kept = {name: pose for name, pose in self._resting.bodies.items() if name in bodies}
            self._resting = replace(self._resting, bodies=kept)

    def place(self, bodies: Mapping[str, Pose]) -> None:
        """Teleport free bodies with the next command."""
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
            match order:
                case PoseOrder():
                    self._twists.pop(order.handle, None)
                    poses[order.handle] = order.after(self._target(order.handle, poses))
                case TwistOrder():
                    self._twists[order.handle] = (order, self._run.parameters["velocity_timeout"])
                case TeleportOrder():
                    bodies[order.body] = order.pose
                case ActuatorOrder():
                    actuators.update(order.values)
                    for name in order.values:
                        self._courses.pop(name, None)
                case TrajectoryOrder() if order.ends:
                    for name in order.names:
                        self._courses.pop(name, None)
                case TrajectoryOrder():
                    start = time - dt if order.start is None else order.start
                    present = self._run.simulation.commands | self._run.simulation.joint_goals
                    before = [actuators.get(name, present[name]) for name in order.names]
                    rates = self._run.simulation.motor_velocities
                    for name, value in zip(order.names, before, strict=True):
                        self._courses[name] = _Course(start, value, rates.get(name, 0.0), order.only(name))
                    if order.begun is not None:
                        order.begun(start, before, [rates.get(name, 0.0) for name in order.names])
        poses |= self._moved(dt, poses)
        values, loads = actuators | self._followed(time), {load.name for load in self._run.simulation.scene.loads}
        joints = self._run.simulation.joint_goals.keys()
        command = Command(
            handles=poses,
            actuators={name: value for name, value in values.items() if name not in loads and name not in joints},
            loads={name: value for name, value in values.items() if name in loads},
            bodies=bodies,
            joints={name: value for name, value in values.items() if name in joints},
        )
        return self.slew.limit(command, self._run.simulation.commands, dt=dt, slew_time=slew_time)

    def _target(self, name: str, poses: Mapping[str, Pose]) -> Pose:
        """Return a handle's target before an order: the target set earlier in this step, or else the present target."""
        return poses.get(name) or self._run.simulation.targets[name]

    def _moved(self, dt: float, last: Mapping[str, Pose]) -> dict[str, Pose]:
        """Return the targets after their velocity commands have acted for ``dt`` [s].

        A velocity acts for ``velocity_timeout`` in all. It moves the target from the last target, even if the body has
        not reached the last target.
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
                self._run.refusals.refuse(name, refusal)
                continue
            poses[name] = pose
        return poses

    def _followed(self, time: float) -> dict[str, float]:
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
