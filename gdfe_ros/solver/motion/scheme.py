# SPDX-License-Identifier: Apache-2.0
"""Schemes of second order, each as the minimum of a potential in the new positions.

Every scheme gives acceleration and velocity at the end of a step as linear functions of the positions x there:

    a = kappa_a (x - x_a),   v = theta (x - x_v),

and its balance of momentum reads M f(x) = -dE/dx with f = kappa (x - x_hat): the stationary point of
E(x) + kappa/2 |x - x_hat|_M^2. `docs/theory/motion.md` derives them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.solver.motion.dynamics import Dynamics, Scheme

Vectors = NDArray[np.float64]


@dataclass(frozen=True, eq=False, kw_only=True)
class Kinematics:
    """How the vertices move at the end of a step; all (n, 3).

    Attributes:
        velocity: [m/s].
        acceleration: [m/s^2].
        balanced: f [m/s^2], what the forces of that moment would accelerate by.
        before: positions [m] at the end of the step before.
        velocity_before: [m/s] at the end of the step before.
        first: no step was made yet.
    """

    velocity: Vectors
    acceleration: Vectors
    balanced: Vectors
    before: Vectors
    velocity_before: Vectors
    first: bool = False

    @classmethod
    def started(
        cls, positions: Vectors, velocity: Vectors, acceleration: Vectors, h: float, *, first: bool = False
    ) -> Kinematics:
        """Begin at positions (n, 3) [m]: the step before is what this velocity and acceleration would have made."""
        return cls(
            first=first,
            velocity=velocity,
            acceleration=acceleration,
            balanced=acceleration,
            before=positions - h * velocity + 0.5 * h * h * acceleration,
            velocity_before=velocity - h * acceleration,
        )


@dataclass(frozen=True, eq=False, kw_only=True)
class Rule:
    """One step of a scheme from where a body is.

    Attributes:
        theta: dv/dx [1/s].
        drift: x_v (n, 3) [m].
        kappa_a: da/dx [1/s^2].
        rest: x_a (n, 3) [m].
        kappa: df/dx [1/s^2].
        aim: x_hat (n, 3) [m].
    """

    theta: float
    drift: Vectors
    kappa_a: float
    rest: Vectors
    kappa: float
    aim: Vectors

    @classmethod
    def of(cls, dynamics: Dynamics, h: float, x: Vectors, now: Kinematics) -> Rule:
        """Return the rule of a step of length ``h`` [s] from positions ``x`` (n, 3) [m]."""
        make = {Scheme.BDF2: _bdf2, Scheme.NEWMARK: _newmark, Scheme.GENERALISED_ALPHA: _generalised_alpha}
        return make[dynamics.scheme](dynamics, h, x, now)

    def velocity(self, x: Vectors) -> Vectors:
        """Return the velocity (n, 3) [m/s] at new positions."""
        return self.theta * (x - self.drift)

    def acceleration(self, x: Vectors) -> Vectors:
        """Return the acceleration (n, 3) [m/s^2] at new positions."""
        return self.kappa_a * (x - self.rest)

    def balanced(self, x: Vectors) -> Vectors:
        """Return f (n, 3) [m/s^2] at new positions."""
        return self.kappa * (x - self.aim)


def stiffness(dynamics: Dynamics, h: float) -> tuple[float, float]:
    """Return kappa [1/s^2] and theta [1/s] of a step of length ``h`` [s]: they depend on nothing else."""
    none = np.zeros((0, 3))
    still = Kinematics(velocity=none, acceleration=none, balanced=none, before=none, velocity_before=none)
    rule = Rule.of(dynamics, h, none, still)
    return rule.kappa, rule.theta


def _bdf2(dynamics: Dynamics, h: float, x: Vectors, now: Kinematics) -> Rule:
    if now.first:  # backward Euler: what would have been before may lie far above the energy that is there
        aim = x + h * now.velocity
        return Rule(theta=1.0 / h, drift=x, kappa_a=1.0 / h**2, rest=aim, kappa=1.0 / h**2, aim=aim)
    theta = 1.5 / h
    drift = (4.0 * x - now.before) / 3.0
    aim = drift + (4.0 * now.velocity - now.velocity_before) / (3.0 * theta)
    return Rule(theta=theta, drift=drift, kappa_a=theta * theta, rest=aim, kappa=theta * theta, aim=aim)


def _newmark(dynamics: Dynamics, h: float, x: Vectors, now: Kinematics) -> Rule:
    """Average acceleration: the trapezoidal rule."""
    drift = x + 0.5 * h * now.velocity
    aim = x + h * now.velocity + 0.25 * h * h * now.acceleration
    kappa = 4.0 / (h * h)
    return Rule(theta=2.0 / h, drift=drift, kappa_a=kappa, rest=aim, kappa=kappa, aim=aim)


def _generalised_alpha(dynamics: Dynamics, h: float, x: Vectors, now: Kinematics) -> Rule:
    """Chung and Hulbert (1993): (1 - am) a + am a_n = (1 - af) f + af f_n."""
    rho = dynamics.rho_inf
    am, af = (2.0 * rho - 1.0) / (rho + 1.0), rho / (rho + 1.0)
    beta, gamma = 0.25 * (1.0 - am + af) ** 2, 0.5 - am + af
    kappa_a = 1.0 / (beta * h * h)
    rest = x + h * now.velocity + h * h * (0.5 - beta) * now.acceleration
    theta = gamma / (beta * h)
    drift = rest - (now.velocity + h * (1.0 - gamma) * now.acceleration) / theta
    kappa = kappa_a * (1.0 - am) / (1.0 - af)
    aim = rest - (am * now.acceleration - af * now.balanced) / (kappa * (1.0 - af))
    return Rule(theta=theta, drift=drift, kappa_a=kappa_a, rest=rest, kappa=kappa, aim=aim)
