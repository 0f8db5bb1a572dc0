# SPDX-License-Identifier: Apache-2.0
"""Time integration schemes of second order; the positions at the end of a step minimise a potential.

Every scheme gives acceleration and velocity at the end of a step as linear functions of the positions x there:

    a = kappa_a (x - x_a),   v = theta (x - x_v),

and its balance of momentum is M f(x) = -dE/dx with f = kappa (x - x_hat). The solution is the stationary point of
E(x) + kappa/2 |x - x_hat|_M^2. The forces of a scheme exclude those of contacts, whose effect on the velocity is an
impulse at the end of the step (`gdfe_ros.solver.motion.impulse`). `docs/theory/motion.md` derives both.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gdfe_ros.solver.settings import Dynamics, Scheme
from gdfe_ros.solver.state import Saved
from gdfe_ros.solver.vectors import Array


class Kinematics(NamedTuple):
    """Kinematics of the vertices at the end of a step; all arrays are (n, 3).

    Attributes:
        positions: [m].
        velocity: [m/s].
        acceleration: [m/s^2].
        balanced: f [m/s^2], the acceleration by the forces at the end of the step.
        before: positions [m] at the end of the previous step.
        velocity_before: [m/s] at the end of the previous step.
        pushed: mean acceleration [m/s^2] by contacts during the step.
        h: length of the step [s]; 0 before the first step.
        first: whether there is no previous step, or the previous step has another length.
    """

    positions: Array
    velocity: Array
    acceleration: Array
    balanced: Array
    before: Array
    velocity_before: Array
    pushed: Array
    h: float
    first: bool = False

    @classmethod
    def start(
        cls, positions: Array, velocity: Array, acceleration: Array, h: float, *, first: bool = False
    ) -> Kinematics:
        """Return kinematics at positions (n, 3) [m]; velocity and acceleration define the previous step."""
        return cls(
            positions=positions,
            velocity=velocity,
            acceleration=acceleration,
            balanced=acceleration,
            before=positions - h * velocity + 0.5 * h * h * acceleration,
            velocity_before=velocity - h * acceleration,
            pushed=np.zeros_like(velocity),
            h=h,
            first=first,
        )

    @classmethod
    def of(cls, saved: Saved) -> Kinematics:
        """Return the kinematics of a stored state, the inverse of `saved`."""
        return cls(**{**saved, "h": float(saved["h"][0]), "first": bool(saved["first"][0])})

    @property
    def saved(self) -> Saved:
        """The kinematics as a stored state."""
        return {**self._asdict(), "h": np.array([self.h]), "first": np.array([float(self.first)])}

    @property
    def trend(self) -> Array:
        """The acceleration [m/s^2] with which the motion probably continues after the step.

        If contacts push, the acceleration is computed from the change of the velocity in the last step, not from the
        forces at its end. Only the mean contact force of the step is known, and the forces that hold a vertex in a grip
        are many times as large as the forces that move it.
        """
        if not self.pushed.any():
            return self.acceleration
        return (self.velocity - self.velocity_before) / self.h + self.pushed

    def restart(self, h: float) -> Kinematics:
        """Return the kinematics restarted with a new step length ``h`` [s].

        The acceleration becomes the acceleration by the forces. The scheme's own acceleration may oscillate from step
        to step, and a much longer step would turn this oscillation into energy.
        """
        fresh = self.start(self.positions, self.velocity, self.balanced + self.pushed, h, first=True)
        return fresh._replace(balanced=self.balanced, pushed=self.pushed)


class Rule(NamedTuple):
    """One step of a scheme from given kinematics.

    Attributes:
        theta: dv/dx [1/s].
        drift: x_v (n, 3) [m].
        kappa_a: da/dx [1/s^2].
        rest: x_a (n, 3) [m].
        kappa: df/dx [1/s^2].
        x_hat: predicted positions (n, 3) [m].
        lag: (n, 3) [m/s] difference between the velocity and theta (x - x_v) at vertices that contacts hold: the
            impulse of a step changes the velocity by more than theta times the displacement. Damping relative to the
            world includes this difference.
    """

    theta: float
    drift: Array
    kappa_a: float
    rest: Array
    kappa: float
    x_hat: Array
    lag: Array | float = 0.0

    @classmethod
    def of(cls, dynamics: Dynamics, h: float, now: Kinematics) -> Rule:
        """Return the rule of a step of length ``h`` [s].

        If the step length changes, `bdf2` restarts. `generalised_alpha` is replaced by the trapezoidal rule for one
        step, because the trapezoidal rule does not use the previous step. An assumed previous step would create energy
        if two lengths alternate.
        """
        anew = now.h != h or dynamics.restarts
        now = now.restart(h) if anew else now
        if dynamics.scheme is Scheme.BDF2:
            return _bdf2(h, now)
        return _generalised_alpha(1.0 if anew else dynamics.radius, h, now)

    @classmethod
    def steady(cls, h: float, x: Array, v: Array) -> Rule:
        """Return the rule of a step of length ``h`` [s] with a constant acceleration, from positions and velocities."""
        ahead, kappa = x + h * v, 2.0 / h**2
        return cls(theta=2.0 / h, drift=x + 0.5 * h * v, kappa_a=kappa, rest=ahead, kappa=kappa, x_hat=ahead)

    def velocity(self, x: Array) -> Array:
        """Return the velocity (n, 3) [m/s] at new positions."""
        return self.theta * (x - self.drift)

    def acceleration(self, x: Array) -> Array:
        """Return the acceleration (n, 3) [m/s^2] at new positions."""
        return self.kappa_a * (x - self.rest)

    def find_force(self, x: Array) -> Array:
        """Return f (n, 3) [m/s^2] at new positions."""
        return self.kappa * (x - self.x_hat)


def stiffness(dynamics: Dynamics, h: float) -> tuple[float, float]:
    """Return kappa [1/s^2] and theta [1/s] of a step of length ``h`` [s]; they do not depend on the kinematics."""
    none = np.zeros((0, 3))
    rule = Rule.of(dynamics, h, Kinematics.start(none, none, none, h))
    return rule.kappa, rule.theta


def _bdf2(h: float, now: Kinematics) -> Rule:
    x = now.positions
    if now.first:  # backward Euler: an assumed previous step may have far more energy than the body
        x_hat = x + h * now.velocity
        return Rule(theta=1.0 / h, drift=x, kappa_a=1.0 / h**2, rest=x_hat, kappa=1.0 / h**2, x_hat=x_hat)
    theta = 1.5 / h
    drift = (4.0 * x - now.before) / 3.0
    x_hat = drift + (4.0 * now.velocity - now.velocity_before) / (3.0 * theta)
    kappa = theta * theta
    return Rule(theta=theta, drift=drift, kappa_a=kappa, rest=x_hat, kappa=kappa, x_hat=x_hat, lag=_lag(theta, h, now))


def _generalised_alpha(rho: float, h: float, now: Kinematics) -> Rule:
    """Return the rule of Chung and Hulbert (1993): (1 - am) a + am a_n = (1 - af) f + af f_n.

    With the spectral radius ``rho`` = 1 the rule is Newmark's average acceleration (the trapezoidal rule).
    """
    am, af = (2.0 * rho - 1.0) / (rho + 1.0), rho / (rho + 1.0)
    beta, gamma = 0.25 * (1.0 - am + af) ** 2, 0.5 - am + af
    kappa_a, theta = 1.0 / (beta * h * h), gamma / (beta * h)
    x, acceleration = now.positions, now.acceleration - now.pushed
    rest = x + h * now.velocity + h * h * (0.5 - beta) * acceleration
    drift = rest - (now.velocity + h * (1.0 - gamma) * acceleration) / theta
    if rho == 1.0:  # the same without the large accelerations of light bodies
        drift = x + 0.5 * h * now.velocity
    kappa = kappa_a * (1.0 - am) / (1.0 - af)
    x_hat = rest - (am * acceleration - af * now.balanced) / (kappa * (1.0 - af))
    return Rule(theta=theta, drift=drift, kappa_a=kappa_a, rest=rest, kappa=kappa, x_hat=x_hat, lag=_lag(theta, h, now))


def _lag(theta: float, h: float, now: Kinematics) -> Array:
    """Return `Rule.lag`, assuming that contacts push as in the last step (`Kinematics.pushed`)."""
    return (1.0 - 0.5 * theta * h) * h * now.pushed
