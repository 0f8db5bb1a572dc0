# SPDX-License-Identifier: Apache-2.0
"""From orders to the command of each step: targets, velocities and trajectories in force."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from gdfe_ros.constraints import Pose
from gdfe_ros.node.handle_orders import require_near
from gdfe_ros.node.orders import ActuatorOrder, Order, PoseOrder, TrajectoryOrder, TwistOrder
from gdfe_ros.node.refusals import Refusal
from gdfe_ros.simulation import Command, Simulation


class Drive:
    """Turns orders into one command a step; used by the stepping thread only.

    A pose ends the velocity of its plate, an actuator's command ends its trajectory, a trajectory replaces the one
    before it.

    Args:
        simulation: that is driven.
        timeout: gives how long a velocity stays in force [s], simulation time.
        refuse: takes the refusal of a velocity that leads too far, with the handle's name.

    Attributes:
        simulation: that is driven.
    """

    def __init__(
        self, simulation: Simulation, *, timeout: Callable[[], float], refuse: Callable[[str, Refusal], None]
    ) -> None:
        self.simulation, self._timeout, self._refuse = simulation, timeout, refuse
        self.clear()

    def clear(self) -> None:
        """Forget every velocity and trajectory."""
        self._twists: dict[str, tuple[TwistOrder, float]] = {}
        self._trajectory: TrajectoryOrder | None = None
        self._start = 0.0
        self._before: dict[str, float] = {}

    @property
    def moving(self) -> bool:
        """Whether the next step changes a command without a new order."""
        return bool(self._twists) or self._trajectory is not None

    def command(self, orders: Iterable[Order], *, time: float, dt: float) -> Command:
        """Give what a step consumes.

        Args:
            orders: new ones.
            time: simulation time at the end of the step [s].
            dt: time over which velocities act [s].
        """
        poses: dict[str, Pose] = {}
        actuators: dict[str, float] = {}
        for order in orders:
            match order:
                case PoseOrder():
                    self._twists.pop(order.handle, None)
                    poses[order.handle] = order.after(self.simulation.targets[order.handle])
                case TwistOrder():
                    self._twists[order.handle] = (order, time - dt + self._timeout())
                case ActuatorOrder():
                    actuators.update(order.values)
                case TrajectoryOrder():
                    self._trajectory = order
                    self._start = time - dt if order.start is None else order.start
                    self._before = {name: self.simulation.commands[name] for name in order.names}
        poses |= self._moved(time, dt)
        values, loads = self._followed(time, actuators), {load.name for load in self.simulation.scene.loads}
        return Command(
            handles=poses,
            actuators={name: value for name, value in values.items() if name not in loads},
            loads={name: value for name, value in values.items() if name in loads},
        )

    def _moved(self, time: float, dt: float) -> dict[str, Pose]:
        poses = {}
        for name, (twist, until) in list(self._twists.items()):
            if twist.still or time > until + 1e-9:
                del self._twists[name]
                continue
            pose = twist.after(self.simulation.targets[name], dt)
            try:
                require_near(pose.translation, self.simulation.mesh.size)
            except Refusal as refusal:
                del self._twists[name]
                self._refuse(name, refusal)
                continue
            poses[name] = pose
        return poses

    def _followed(self, time: float, given: dict[str, float]) -> dict[str, float]:
        """Add what the trajectory says to the commands given, which win."""
        trajectory = self._trajectory
        if trajectory is None:
            return given
        elapsed = time - self._start
        if given or elapsed >= trajectory.times[-1]:
            self._trajectory = None
        if given or elapsed < 0.0:
            return given
        columns = zip(trajectory.names, trajectory.values.T, strict=True)
        return {name: float(self._at(name, elapsed, trajectory.times, column)) for name, column in columns}

    def _at(self, name: str, elapsed: float, times: np.ndarray, column: np.ndarray) -> float:
        """Interpolate; before the first point from the command that was in force."""
        if elapsed < times[0]:
            start = self._before[name]
            return start + (column[0] - start) * elapsed / times[0]
        return np.interp(elapsed, times, column)
