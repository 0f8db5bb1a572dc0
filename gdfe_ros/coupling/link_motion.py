# SPDX-License-Identifier: Apache-2.0
"""Motion of the links that the yielding joints of an arm move."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.solver.motion.scheme import Kinematics, Rule
from gdfe_ros.solver.settings import Dynamics, Scheme

Vector = NDArray[np.float64]


class LinkMotion(NamedTuple):
    """Positions and motions (y,) of the links that yielding joints move, at the end of a step.

    Attributes:
        positions: q [rad] or [m].
        velocities: [rad/s] or [m/s].
        accelerations: of the time scheme [rad/s^2] or [m/s^2].
        balanced: accelerations [rad/s^2] or [m/s^2] by the forces at the end of the step.
        before, velocities_before: positions and velocities at the end of the previous step.
        step: (1,) duration of the previous step [s]; 0 if there is none.
    """

    positions: Vector
    velocities: Vector
    accelerations: Vector
    balanced: Vector
    before: Vector
    velocities_before: Vector
    step: Vector

    @classmethod
    def at(cls, positions: Vector) -> LinkMotion:
        """Return links that do not move, at ``positions`` (y,)."""
        none = np.zeros(len(positions))
        return cls(positions, none, none, none, positions, none, np.zeros(1))

    def rule(self, dynamics: Dynamics, h: float) -> Rule:
        """Return the rule of the body's time scheme for a step of ``h`` [s].

        Without a previous step, the accelerations at the beginning are not known. `bdf2` does not need them. With the
        other schemes, the accelerations are constant in this step: those by the forces at its end.
        """
        if not self.step[0] and dynamics.scheme is not Scheme.BDF2:
            return Rule.steady(h, self.positions, self.velocities)
        now = Kinematics(
            positions=self.positions,
            velocity=self.velocities,
            acceleration=self.accelerations,
            balanced=self.balanced,
            before=self.before,
            velocity_before=self.velocities_before,
            pushed=np.zeros_like(self.positions),
            h=h,
        )
        return Rule.of(dynamics, h, now if h == self.step[0] else now.restart(h))

    def after(self, rule: Rule, positions: Vector, h: float) -> LinkMotion:
        """Return the links after a step of ``h`` [s] to ``positions`` (y,)."""
        return LinkMotion(
            positions=positions,
            velocities=rule.velocity(positions),
            accelerations=rule.acceleration(positions),
            balanced=rule.find_force(positions),
            before=self.positions,
            velocities_before=self.velocities,
            step=np.array([h]),
        )

    def part_way(self, after: LinkMotion, fraction: float) -> LinkMotion:
        """Return the links at a ``fraction`` of the step to ``after``; for the next step, there is no previous step."""
        if fraction == 0.0:
            return self
        positions = self.positions + fraction * (after.positions - self.positions)
        return after._replace(positions=positions, before=positions, step=np.zeros(1))
