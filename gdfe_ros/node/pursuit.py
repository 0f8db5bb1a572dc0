# SPDX-License-Identifier: Apache-2.0
"""Progress and result of an action client's trajectory."""

from __future__ import annotations

import threading
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.node.orders import ActuatorOrder, Order, TrajectoryOrder


class Code(IntEnum):
    """Result of a trajectory, as in ``control_msgs/action/FollowJointTrajectory``."""

    SUCCESSFUL = 0
    INVALID_GOAL = -1
    INVALID_JOINTS = -2
    OLD_HEADER_TIMESTAMP = -3
    PATH_TOLERANCE_VIOLATED = -4
    GOAL_TOLERANCE_VIOLATED = -5


@dataclass(frozen=True)
class Tolerances:
    """Allowed deviations of the present commands from a trajectory.

    Attributes:
        path: dict from name to deviation before the end, in the unit of the mode; other names are not checked.
        goal: dict from name to deviation at the end, in the unit of the mode; other names are not checked.
        time: time after the end within which ``goal`` must be met [s].
    """

    path: Mapping[str, float]
    goal: Mapping[str, float]
    time: float


class Pursuit:
    """An action client's trajectory in progress.

    Args:
        order: order of the trajectory.
        tolerances: allowed deviations from the trajectory.
        tell: function that is called after every step with the time since the start [s], the trajectory's commands
            (k,) and the present commands (k,).
        finish: function that is called once with the result and its reason.

    Attributes:
        going: whether the trajectory has not ended.
    """

    def __init__(
        self,
        order: TrajectoryOrder,
        tolerances: Tolerances,
        *,
        tell: Callable[[float, NDArray[np.float64], NDArray[np.float64]], object],
        finish: Callable[[Code, str], object],
    ) -> None:
        self.order, self.going = order, True
        self._tolerances, self._tell, self._finish = tolerances, tell, finish
        self._start, self._before, self._rates = order.start, np.array([]), np.array([])
        self._lock = threading.Lock()

    def begin(self, start: float, before: Collection[float], rates: Collection[float]) -> None:
        """Record the start of the trajectory [s], and the commands and velocities (k,) at that time."""
        self._start, self._before, self._rates = start, np.array(before), np.array(rates)

    def end(self, code: Code, reason: str) -> None:
        """End the trajectory, unless it has ended already."""
        with self._lock:
            going, self.going = self.going, False
        if going:
            self._finish(code, reason)

    def displace(self, later: Order) -> None:
        """End the trajectory if a later order commands one of its names."""
        names = later.values if isinstance(later, ActuatorOrder) else getattr(later, "names", ())
        if taken := sorted(set(names) & set(self.order.names)):
            self.end(Code.INVALID_GOAL, f"a later command of {', '.join(taken)} took its place")

    def look(self, time: float, present: Mapping[str, float]) -> None:
        """Report the progress after a step; end the trajectory if it is complete or out of tolerance.

        Args:
            time: simulation time [s].
            present: dict from name to the command of an actuator or load, after a rate limit, or a joint's position.
        """
        if not self.going or not len(self._before) or time < self._start:
            return
        order, elapsed = self.order, time - self._start
        actual = np.array([present[name] for name in order.names])
        desired = order.at(elapsed, self._before, self._rates)
        self._tell(elapsed, desired, actual)
        left = elapsed - order.times[-1]
        over = left >= -1e-9
        wrong = self._beyond(self._tolerances.goal if over else self._tolerances.path, desired, actual)
        if not over and wrong:
            self.end(Code.PATH_TOLERANCE_VIOLATED, f"{elapsed:.6g} s after its start, {wrong}")
        elif over and not wrong:
            self.end(Code.SUCCESSFUL, "")
        elif over and left > self._tolerances.time - 1e-9:
            self.end(Code.GOAL_TOLERANCE_VIOLATED, f"{left:.6g} s after its end, {wrong}")

    def _beyond(self, allowed: Mapping[str, float], desired: NDArray[np.float64], actual: NDArray[np.float64]) -> str:
        """Return a message about commands out of tolerance; empty if there are none."""
        rows = zip(self.order.names, desired, actual, strict=True)
        return ", ".join(
            f"{name} is at {there:.6g} instead of {wanted:.6g}; allowed: {allowed[name]:g} off"
            for name, wanted, there in rows
            if abs(there - wanted) > allowed.get(name, np.inf)
        )
