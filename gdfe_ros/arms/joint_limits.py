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
        velocities: mean velocities in the last step [rad/s] or [m/s].
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
    acceleration. A joint that changes its velocity by -a h in each step can stop at the goal if its velocity is at most

        u(e) = min(a (sqrt(h^2 / 4 + 2 |e| / a) - h / 2), |e| / h).

    The second bound applies in the last step. The velocity v of the step is sign(e) u(e) plus the goal's velocity. It
    is limited to +-v_max, and to the previous velocity +-a h. The position advances by v h.

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
        low, high = last.velocities - self._acceleration * dt, last.velocities + self._acceleration * dt
        velocity = np.clip(eager, low, high)
        there = np.abs(velocity - wanted) <= SHORTFALL * np.abs(wanted)
        positions = np.where(there, goals, last.positions + velocity * dt)
        positions = np.clip(positions, self.lower, self.upper)
        velocity = (positions - last.positions) / dt
        found = JointMotion(goals.copy(), positions, velocity, (velocity - last.velocities) / dt)
        return found, Cut(
            ~there & (np.abs(velocity) >= (1.0 - SHORTFALL) * self._velocity),
            ~there & ((velocity <= low + SHORTFALL * np.abs(low)) | (velocity >= high - SHORTFALL * np.abs(high))),
        )

    def _braking(self, left: Vector, dt: float) -> Vector:
        """Return the velocities sign(e) u(e) (n,) from which joints can stop within the distances e, ``left`` (n,)."""
        reach, a = np.abs(left), self._acceleration
        with np.errstate(invalid="ignore"):
            braked = a * (np.sqrt(0.25 * dt**2 + 2.0 * reach / a) - 0.5 * dt)
        at_once = reach / dt
        return np.sign(left) * np.where(np.isfinite(a), np.minimum(braked, at_once), at_once)


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
