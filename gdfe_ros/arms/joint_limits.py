# SPDX-License-Identifier: Apache-2.0
"""Motion of joints towards their commanded positions within their limits, and springs of joints that yield."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.arms.description import UrdfLimits

Vector = NDArray[np.float64]
SHORTFALL = 1e-9
"""Relative difference up to which two velocities count as equal. It decides whether a joint reaches its goal, and
whether it is at a limit.
"""


class JointMotion(NamedTuple):
    """Joints of an arm at an instant, (n,) each.

    Attributes:
        goals: commanded positions [rad] or [m].
        positions: present positions [rad] or [m].
        velocities: mean velocities in the last step [rad/s] or [m/s]; 0 for joints that stopped at their goals in it.
        accelerations: changes of the velocities divided by the duration of the step [rad/s^2] or [m/s^2].
    """

    goals: Vector
    positions: Vector
    velocities: Vector
    accelerations: Vector

    @classmethod
    def at(cls, positions: Sequence[float]) -> JointMotion:
        """Return joints that do not move, at ``positions`` (n,) [rad] or [m]."""
        q = np.array(positions, dtype=np.float64)
        return cls(q, q.copy(), np.zeros(len(q)), np.zeros(len(q)))

    @property
    def arrived(self) -> bool:
        """Whether all joints are at their commanded positions and do not move."""
        return bool((self.goals == self.positions).all() and not self.velocities.any() and not self.accelerations.any())


class Cut(NamedTuple):
    """Whether the velocity (n,) or the acceleration (n,) of each joint was limited in a step."""

    velocity: NDArray[np.bool_]
    acceleration: NDArray[np.bool_]


class JointLimits:
    """Limits of an arm's joints.

    A joint follows a moving goal if the goal's velocity is within the limits. It stops at a goal that does not move,
    without overshoot. Let e be the distance to the goal [rad] or [m], h the time step [s] and a the largest
    acceleration. Whatever the lengths of the later steps, a joint can stop within the distance that is left after the
    step, e - u h, if this is the distance u^2 / (2 a) of steady braking. Its velocity in the step is therefore at most

        u(e) = a (sqrt(h^2 + 2 |e| / a) - h) = 2 |e| / (h + sqrt(h^2 + 2 |e| / a)).

    The velocity v of the step is sign(e) u(e) plus the goal's velocity. It is limited to +-v_max, and to the previous
    velocity +-a h. The position advances by v h. As soon as a joint can stop at a goal within the step, it does.

    Args:
        limits: limits of each joint.
    """

    def __init__(self, limits: Sequence[UrdfLimits]) -> None:
        self.lower, self.upper, self._velocity, self._acceleration, self.effort = (
            np.array([getattr(each, name) for each in limits], dtype=np.float64)
            for name in ("lower", "upper", "velocity", "acceleration", "effort")
        )

    def advance(self, last: JointMotion, goals: Vector, dt: float) -> tuple[JointMotion, Cut]:
        """Return the joints after a step of ``dt`` [s], and the limits that restricted their motion.

        If ``dt`` is 0 (in a scene without dynamics), the joints are at their goals at once.
        """
        none = np.zeros(len(goals), dtype=bool)
        if dt <= 0.0:
            return JointMotion.at(goals), Cut(none, none)
        own = (goals - last.goals) / dt
        own = np.where(np.abs(own) <= self._velocity, own, 0.0)  # a faster goal is a jump, which has no velocity
        left = goals - last.positions
        wanted = left / dt
        eager = np.clip(own + self._braking(left - own * dt, dt), -self._velocity, self._velocity)
        change = self._acceleration * dt
        velocity = np.clip(eager, last.velocities - change, last.velocities + change)
        stops = (own == 0.0) & self._can_stop(last.velocities, left, dt)
        there = stops | (np.abs(velocity - wanted) <= SHORTFALL * np.abs(wanted))
        positions = np.where(there, goals, last.positions + velocity * dt)
        positions = np.clip(positions, self.lower, self.upper)
        velocity = np.where(stops, 0.0, (positions - last.positions) / dt)
        found = JointMotion(goals.copy(), positions, velocity, (velocity - last.velocities) / dt)
        most = np.clip(wanted, -self._velocity, self._velocity)
        return found, Cut(
            ~there & (np.abs(velocity) >= (1.0 - SHORTFALL) * self._velocity),
            ~there & (np.abs(velocity - most) > SHORTFALL * np.abs(most)),
        )

    def _braking(self, left: Vector, dt: float) -> Vector:
        """Return the velocities sign(e) u(e) (n,) from which joints can stop within the distances e, ``left`` (n,)."""
        return 2.0 * left / (dt + np.sqrt(dt**2 + 2.0 * np.abs(left) / self._acceleration))

    def _can_stop(self, velocity: Vector, left: Vector, dt: float) -> NDArray[np.bool_]:
        """Return whether joints (n,) with a ``velocity`` (n,) can be at rest at the distance ``left`` after ``dt`` [s].

        The shortest distance is that of steady braking. For the longest one, the joint speeds up before it brakes.
        """
        change = self._acceleration * dt
        speed, far = np.where(left < 0.0, -velocity, velocity) / change, np.abs(left) / (change * dt)
        long_enough, short_enough = (1.0 - SHORTFALL) * speed**2 <= 2.0 * far, 4.0 * far <= 1.0 + 2.0 * speed - speed**2
        slow = (speed >= 0.0) & (speed <= 1.0) & (np.abs(left) <= self._velocity * dt)
        return slow & long_enough & short_enough


@dataclass(frozen=True, eq=False, kw_only=True)
class JointSprings:
    """Springs and dampers of the yielding joints of an arm.

    The torque of a motor at position theta on a link at position q is

        tau = k (theta - q) + d (theta' - q').

    Attributes:
        yielding: indices of the yielding joints (y,) among the commanded joints.
        stiffness: k (y,) [N m/rad] or [N/m].
        damping: d (y,) [N m s/rad] or [N s/m].
    """

    yielding: NDArray[np.int64]
    stiffness: Vector
    damping: Vector

    def torques(self, stretch: Vector, rate: Vector) -> Vector:
        """Return tau (y,) of springs with ``stretch`` theta - q (y,) that changes at the ``rate`` (y,)."""
        return self.stiffness * stretch + self.damping * rate
