# SPDX-License-Identifier: Apache-2.0
"""Balance of forces between a body and the yielding joints that carry it: the residual, and the search for its zero."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from gdfe_ros.arms.arm import Arm
from gdfe_ros.arms.carriers import Motions, link_pushes
from gdfe_ros.arms.joint_limits import JointMotion
from gdfe_ros.constraints.pose import Pose
from gdfe_ros.coupling.link_motion import LinkMotion
from gdfe_ros.solver.contact.touch import Touch
from gdfe_ros.solver.motion.scheme import Rule
from gdfe_ros.solver.state import State
from gdfe_ros.solver.vectors import NEGLIGIBLE

Vector = NDArray[np.float64]
Links = Mapping[str, LinkMotion]
"""Dict from arm to the motion of its yielding joints."""
Wrenches = Callable[[State], tuple[Mapping[str, Vector], Mapping[str, Touch]]]
"""Function that returns the reactions of handles and obstacles in a state, and the contacts, for `link_pushes`."""


@dataclass(frozen=True, eq=False, kw_only=True)
class JointBalance:
    """Yielding joints in a step: q (y,) are the positions of all arms' yielding joints at the end of the step.

    In balance, the efforts of the links equal the torques of the springs:

        M(q) q'' + C(q, q') q' + g(q) - sum_k J_k^T w_k = k (theta - q) + d (theta' - q')

    theta are the positions of the motors. q' and q'' follow from q by the time scheme; without dynamics they are
    theta' and theta''.

    Attributes:
        arms: arms with yielding joints.
        size: size of the body [m].
        before, after: motions of the motors before and after the step.
        links: motion of the yielding joints before the step.
        rules: dict from arm to the rule of its time scheme; empty without dynamics.
        gravity: (3,) gravitational acceleration [m/s^2] at the end.
        h: duration of the step [s].
        last: poses of handles and obstacles before the step.
        wrenches: function that returns the wrenches on the links in a state of the body.
    """

    arms: tuple[Arm, ...]
    size: float
    before: Motions
    after: Motions
    links: Links
    rules: Mapping[str, Rule]
    gravity: Vector
    h: float
    last: Mapping[str, Pose]
    wrenches: Wrenches

    def predict_positions(self) -> Vector:
        """Return first guesses (y,): constant accelerations; without dynamics, constant stretch of the springs."""
        found = []
        for arm in self.arms:
            now, soft = self.links[arm.name], arm.springs.yielding
            move = self.h * now.velocities + 0.5 * self.h**2 * now.accelerations
            if not self.rules:
                move = (self.after[arm.name].positions - self.before[arm.name].positions)[soft]
            found.append(now.positions + move)
        return np.concatenate(found)

    def first_derivative(self, q: Vector) -> Vector:
        """Return k + theta_v d + kappa M (y, y): the derivative of `gap` for a constant wrench of the body."""
        blocks = []
        for arm, own in self._split(q):
            block, soft = np.diag(arm.springs.stiffness), arm.springs.yielding
            if self.rules:
                rule = self.rules[arm.name]
                mass = arm.dynamics.mass_matrix(joint_positions(arm, self.after, own))[np.ix_(soft, soft)]
                block += rule.theta * np.diag(arm.springs.damping) + rule.kappa * mass
            blocks.append(block)
        return block_diag(*blocks)

    def gap(self, q: Vector, state: State) -> Vector:
        """Return the efforts of the links minus the torques of the springs (y,) [N m] or [N], in a state."""
        found, (reactions, contacts) = [], self.wrenches(state)
        for arm, own in self._split(q):
            soft, motor = arm.springs.yielding, self.after[arm.name]
            link = self._after(arm, own)
            pushes = link_pushes(arm, state.poses, reactions, contacts)
            moving = on_links(arm, motor, link)
            efforts = arm.dynamics.efforts(*moving[1:], gravity=self.gravity, pushes=pushes)[soft]
            stretch, rate = motor.positions[soft] - own, motor.velocities[soft] - link.velocities
            found.append(efforts - arm.springs.torques(stretch, rate))
        return np.concatenate(found)

    def poses(self, q: Vector) -> dict[str, Pose]:
        """Return a dict from each handle or obstacle that a link moves to its pose."""
        found: dict[str, Pose] = {}
        for arm, own in self._split(q):
            found |= arm.poses(joint_positions(arm, self.after, own), self.last)
        return found

    def length(self, q: Vector, correction: Vector) -> float:
        """Return the largest motion [m] of a flange by a correction (y,) of ``q``."""
        pairs = zip(self._split(q), self._split(correction), strict=True)
        return max(distance(arm, self.after, own, own + more, self.size) for (arm, own), (_, more) in pairs)

    def swing(self) -> float:
        """Return the largest motion h^2 |a| [m] of a flange by the accelerations before the step."""
        moves = ((arm, self.links[arm.name]) for arm in self.arms)
        return max(
            distance(arm, self.after, now.positions, now.positions + self.h**2 * now.balanced, self.size)
            for arm, now in moves
        )

    def move_links(self, q: Vector, simulated: float | None) -> Links:
        """Return the motion of the yielding joints after the step, or after the ``simulated`` part [s] of it."""
        found = {}
        for arm, own in self._split(q):
            before, after = self.links[arm.name], self._after(arm, own)
            cut = simulated is not None and simulated < self.h * (1.0 - NEGLIGIBLE)
            found[arm.name] = before.part_way(after, simulated / self.h) if cut else after
        return found

    def _after(self, arm: Arm, own: Vector) -> LinkMotion:
        """Return the motion of an arm's yielding joints at their positions ``own`` (y,) at the end."""
        if self.rules:
            return self.links[arm.name].after(self.rules[arm.name], own, self.h)
        motor, soft = self.after[arm.name], arm.springs.yielding
        still = LinkMotion.at(own)
        return still._replace(velocities=motor.velocities[soft], balanced=motor.accelerations[soft])

    def _split(self, q: Vector) -> Iterator[tuple[Arm, Vector]]:
        """Return pairs of each arm and its own part of ``q`` (y,)."""
        ends = np.cumsum([len(arm.springs.yielding) for arm in self.arms])[:-1]
        return zip(self.arms, np.split(q, ends), strict=True)


def on_links(arm: Arm, motor: JointMotion, link: LinkMotion) -> JointMotion:
    """Return the motion of an arm's joints on the side of the links, with the accelerations that the forces give."""
    found = [part.copy() for part in motor[1:]]
    for values, own in zip(found, (link.positions, link.velocities, link.balanced), strict=True):
        values[arm.springs.yielding] = own
    return JointMotion(motor.goals, *found)


def distance(arm: Arm, motors: Motions, one: Vector, other: Vector, size: float) -> float:
    """Return the largest motion [m] of a body of ``size`` [m] on the flange between two joint positions (y,)."""
    return arm.flange_distance(joint_positions(arm, motors, one), joint_positions(arm, motors, other), size)


def joint_positions(arm: Arm, motors: Motions, own: Vector) -> Vector:
    """Return the positions (n,) of all joints of an arm: of the motors, or ``own`` (y,) for the yielding joints."""
    q = motors[arm.name].positions.copy()
    q[arm.springs.yielding] = own
    return q


ENOUGH = 0.02
"""A search along a direction ends if the gap along it is at most this fraction of the gap at its beginning."""


class BalanceSearch:
    """Search for a zero of the gap, which is the gradient of a convex function with kinks where contacts open or close.

    Steps are those of the BFGS method. Across a kink, a step may be many times too long. If the gap along a step has
    changed its sign and is not small, the step is shortened to the zero of a secant: through the last two points on
    one side of the zero, or else through the two ends of the bracket.

    Args:
        derivative: (y, y) known, symmetric part of the gap's derivative; a lower bound of the whole derivative.
    """

    def __init__(self, derivative: Vector) -> None:
        self._scale = np.sqrt(np.diag(derivative))
        self._least = derivative / np.outer(self._scale, self._scale)
        self._matrix = self._least.copy()
        self._base: tuple[Vector, Vector] | None = None
        self._last: tuple[Vector, Vector] | None = None

    def bound(self, gap: Vector) -> Vector:
        """Return a correction (y,) that is at least as long as the distance to the zero, by the known derivative."""
        return -np.linalg.solve(self._least, gap / self._scale) / self._scale

    def next(self, q: Vector, gap: Vector, *, longest: float = np.inf) -> Vector:
        """Return the next positions (y,) to evaluate.

        Args:
            q: positions (y,) of the last evaluation.
            gap: (y,) value of `JointBalance.gap` at ``q``.
            longest: largest fraction of a new BFGS step that may be made.
        """
        here, rest = q * self._scale, gap / self._scale
        if self._base is None or self._ends(rest):
            self._restart(here, rest, longest)
        else:
            self._shorten()
        self._last = here, rest
        return (self._base[0] + self._length * self._direction) / self._scale

    def _ends(self, rest: Vector) -> bool:
        """Store the gap along the direction; return whether the search along this direction ends.

        It ends if the gap is small, or has not changed its sign.
        """
        slope, enough = float(rest @ self._direction), ENOUGH * abs(self._below[0][1])
        if abs(slope) <= enough or (slope < 0.0 and not self._above):
            return True
        self._side = self._above if slope > 0.0 else self._below
        self._side.append((self._length, slope))
        return False

    def _restart(self, here: Vector, rest: Vector, longest: float) -> None:
        """Update the matrix with the difference to the last evaluation, and start the next step."""
        if self._last is not None:
            step, change = here - self._last[0], rest - self._last[1]
            if step @ change > 0.0:
                image = self._matrix @ step
                self._matrix += np.outer(change, change) / (step @ change) - np.outer(image, image) / (step @ image)
        self._base, self._direction = (here, rest), -np.linalg.solve(self._matrix, rest)
        self._length, self._width = min(1.0, longest), np.inf
        self._below, self._above = [(0.0, float(rest @ self._direction))], []

    def _shorten(self) -> None:
        """Set the length of the step to a zero of a line, or to the middle if the bracket does not shrink by half."""
        low, high = self._below[-1], self._above[-1]
        width, narrow = self._width, high[0] - low[0]
        self._width = narrow
        length = 0.5 * (low[0] + high[0])
        if narrow <= 0.5 * width:
            length = _zero(low, high)
            if len(self._side) > 1:
                own = _zero(*self._side[-2:])
                length = own if low[0] < own < high[0] else length
        self._length = length


def _zero(one: tuple[float, float], other: tuple[float, float]) -> float:
    """Return the zero of the line through two points; NaN if the line is level."""
    (a, first), (b, second) = one, other
    return a - first * (b - a) / (second - first) if second != first else np.nan
