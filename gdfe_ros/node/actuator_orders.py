# SPDX-License-Identifier: Apache-2.0
"""Convert command messages for actuators, loads and joints to orders, and refuse invalid messages with a reason."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from trajectory_msgs.msg import JointTrajectory

from gdfe_ros.actuators import Actuator, Mode
from gdfe_ros.arms.description import Joint
from gdfe_ros.errors import CommandError, RangeError
from gdfe_ros.node.orders import ActuatorOrder, TrajectoryOrder
from gdfe_ros.node.refusals import Reason, Refusal
from gdfe_ros.real_number import require_command

EFFORTS = (Mode.TENSION, Mode.PRESSURE)
"""Modes whose command is in the field ``effort`` of a JointState. All other modes have it in ``position``."""

LONGEST = 80
"""Largest number of characters of an unknown name in a refusal."""
LATEST_START = 60.0
"""Longest allowed time [s] until a trajectory starts. Meanwhile the node makes steps, even without other commands."""


class ActuatorOrders:
    """Converts command messages to orders, after a check against the actuators, loads and joints of a scene.

    Args:
        actuators: actuators of the scene, in the order of ``~/commands``.
        loads: names of the loads, which are commanded by a factor.
        joints: joints of all arms, which are commanded by position.
    """

    def __init__(self, actuators: Iterable[Actuator], loads: Iterable[str] = (), joints: Iterable[Joint] = ()) -> None:
        self._joints: Mapping[str, Joint] = {joint.name: joint for joint in joints}
        self._actuators: Mapping[str, Actuator] = {actuator.name: actuator for actuator in actuators}
        self._loads = tuple(loads)

    def from_joint_state(self, message: JointState) -> ActuatorOrder:
        """Return the commands of a JointState: tension [N] and pressure [Pa] from ``effort``, others from ``position``.

        The ``position`` of a load is its factor [1], that of a joint is its position [rad] or [m]. A value of NaN
        commands nothing.

        Raises:
            Refusal: a name is unknown or repeated, an array has the wrong size, or a value is infinite or out of range.
        """
        self._require_known(message.name)
        values = {}
        for place, name in enumerate(message.name):
            forced = name in self._actuators and self._actuators[name].mode in EFFORTS
            field = "effort" if forced else "position"
            array = getattr(message, field)
            if len(array) != len(message.name):
                text = (
                    f"{field} has {len(array)} entries for {len(message.name)} names; {name!r} is commanded by {field}"
                )
                raise Refusal(Reason.WRONG_SIZE, text)
            if not math.isnan(array[place]):  # ros2_control's "no command"
                values[name] = self._checked(name, array[place])
        return ActuatorOrder(values)

    def from_grip(self, message: String, *, holds: float, present: Callable[[], Mapping[str, float]]) -> ActuatorOrder:
        """Return the order by which the named grip takes hold (``holds`` 1) or lets go (0).

        Args:
            message: name of the grip.
            holds: the command.
            present: function that returns the commands of the last step.

        Raises:
            Refusal: there is no such grip, or it holds already, or it holds nothing.
        """
        grips = [name for name, actuator in self._actuators.items() if actuator.mode is Mode.GRIP]
        name = message.data
        if name not in grips:
            raise Refusal(Reason.UNKNOWN, f"no grip {name[:LONGEST]!r}; grips: {', '.join(grips)}")
        if present()[name] == holds:
            text = "is attached already; remedy: ~/release first" if holds else "is attached to nothing"
            raise Refusal(Reason.OUT_OF_ORDER, f"grip {name!r} {text}")
        return ActuatorOrder({name: holds})

    def from_array(self, message: Float64MultiArray) -> ActuatorOrder:
        """Return the commands of an array with one value for each actuator, in the scene's order and each mode's unit.

        Raises:
            Refusal: the array has the wrong size, or a value is not finite or out of range.
        """
        names = list(self._actuators)
        if len(message.data) != len(names):
            text = f"{len(message.data)} values for {len(names)} actuators; allowed: one for each of {', '.join(names)}"
            raise Refusal(Reason.WRONG_SIZE, text)
        pairs = zip(names, message.data, strict=True)
        return ActuatorOrder({name: self._checked(name, value) for name, value in pairs})

    def from_trajectory(
        self, message: JointTrajectory, *, now: float, convert: Callable[[int], float]
    ) -> TrajectoryOrder:
        """Return the order of a trajectory; ``positions`` are in the unit of each mode, ``effort`` is ignored.

        A trajectory without points ends the running trajectories of the named actuators, loads and joints. If it has
        no names either, it ends all trajectories. The present commands stay in force, as in
        joint_trajectory_controller.

        Args:
            message: trajectory; its header's stamp is its start, and a stamp of 0 starts it when it is consumed.
            now: present simulation time [s].
            convert: function that returns the simulation time [s] of a stamp [ns].

        Raises:
            Refusal: a name is unknown or repeated, a point has the wrong size, a time is negative, the times do not
                ascend, the end is in the past, the start is too far ahead, or a value is not finite or out of range.
        """
        names = tuple(message.joint_names)
        if not message.points:
            names = names or (*self._actuators, *self._loads, *self._joints)
            self._require_known(names)
            return TrajectoryOrder(names, None, np.zeros(0), np.zeros((0, len(names))))
        self._require_known(names)
        times = np.array([_seconds(point.time_from_start) for point in message.points])
        if times[0] < 0.0 or (np.diff(times) <= 0.0).any():
            raise Refusal(Reason.OUT_OF_ORDER, f"time_from_start {times.tolist()} s must ascend from 0 on")
        rows = []
        for place, point in enumerate(message.points):
            if len(point.positions) != len(names):
                text = f"point {place} has {len(point.positions)} positions for {len(names)} joint_names"
                raise Refusal(Reason.WRONG_SIZE, text)
            rows.append([self._checked(name, value) for name, value in zip(names, point.positions, strict=True)])
        stamp = message.header.stamp
        start = convert(stamp.sec * 10**9 + stamp.nanosec) if stamp.sec or stamp.nanosec else None
        if start is not None and start > now + LATEST_START:
            text = (
                f"the trajectory starts at {start:.9g} s, but the time is {now:.9g} s; allowed: {LATEST_START:g} s "
                "ahead, or stamp 0"
            )
            raise Refusal(Reason.AHEAD, text)
        if start is not None and start + times[-1] < now:
            raise Refusal(Reason.STALE, f"the trajectory ended at {start + times[-1]:.9g} s; the time is {now:.9g} s")
        slopes = _table(message, "velocities")
        bends = _table(message, "accelerations") if slopes is not None else None
        return TrajectoryOrder(names, start, times, np.array(rows), slopes, bends)

    def _require_known(self, names: Sequence[str]) -> None:
        unknown = sorted(set(names) - set(self._actuators) - set(self._loads) - set(self._joints))
        if unknown or not names:
            known = ", ".join(self._actuators) or "none"
            loads = f"; loads: {', '.join(self._loads)}" if self._loads else ""
            loads += f"; joints: {', '.join(self._joints)}" if self._joints else ""
            text = f"no actuator {', '.join(unknown) or 'is named'}; actuators: {known}{loads}"
            raise Refusal(Reason.UNKNOWN, text)
        if len(set(names)) != len(names):
            raise Refusal(Reason.MALFORMED, f"names {list(names)} contain a name twice")

    def _checked(self, name: str, value: float) -> float:
        try:
            if name in self._loads:
                return require_command(f"load {name!r}: factor", value)
            return (self._joints.get(name) or self._actuators[name]).require(value)
        except CommandError as error:
            reason = Reason.OUT_OF_RANGE if isinstance(error, RangeError) else Reason.NOT_FINITE
            raise Refusal(reason, str(error)) from error


def _table(message: JointTrajectory, field: str) -> NDArray[np.float64] | None:
    """Return the values (k, n) of a field, velocities or accelerations, at all k points; None if a point lacks them.

    Raises:
        Refusal: a point has the wrong number of values, or a value is not finite.
    """
    rows = [list(getattr(point, field)) for point in message.points]
    if not all(rows):
        return None
    for place, row in enumerate(rows):
        if len(row) != len(message.joint_names):
            text = f"point {place} has {len(row)} {field} for {len(message.joint_names)} joint_names"
            raise Refusal(Reason.WRONG_SIZE, text)
        if not all(map(math.isfinite, row)):
            raise Refusal(Reason.NOT_FINITE, f"point {place} has the {field} {row}; allowed: finite numbers")
    return np.array(rows)


def _seconds(time: object) -> float:
    """Return the seconds of a Duration message."""
    return time.sec + 1e-9 * time.nanosec
