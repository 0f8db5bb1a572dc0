# SPDX-License-Identifier: Apache-2.0
"""Time integration schemes: exact for constant acceleration, second order for an oscillation, numerical damping."""

from __future__ import annotations

import numpy as np
import pytest

from gdfe_ros.solver.motion.scheme import Kinematics, Rule
from gdfe_ros.solver.settings import Branch, Damping, Dynamics, Scheme

FREQUENCY = 2.0


def moved(now: Kinematics, rule: Rule, new: np.ndarray, h: float) -> Kinematics:
    """Return the kinematics after a step of length ``h`` [s] to the positions ``new``."""
    return Kinematics(
        positions=new,
        velocity=rule.velocity(new),
        acceleration=rule.acceleration(new),
        balanced=rule.find_force(new),
        before=now.positions,
        velocity_before=now.velocity,
        pushed=np.zeros((1, 3)),
        h=h,
    )


def swing(dynamics: Dynamics, h: float, count: int) -> np.ndarray:
    """Return the positions of a unit oscillator that starts with velocity 1 at 0."""
    now = Kinematics.start(np.zeros((1, 3)), np.ones((1, 3)), np.zeros((1, 3)), h)
    path = []
    for _ in range(count):
        rule = Rule.of(dynamics, h, now)
        now = moved(now, rule, rule.kappa * rule.x_hat / (rule.kappa + FREQUENCY**2), h)
        path.append(now.positions[0, 0])
    return np.array(path)


@pytest.mark.parametrize("scheme", Scheme)
def test_constant_acceleration_is_exact(scheme: Scheme) -> None:
    """With constant acceleration, positions, velocities and accelerations are exact over three steps."""
    h, pull, velocity = 0.1, np.array([[0.0, 0.0, -9.81]]), np.array([[1.0, 0.0, 2.0]])
    now = Kinematics.start(np.zeros((1, 3)), velocity, pull, h)
    for t in (h, 2 * h, 3 * h):
        rule = Rule.of(Dynamics(scheme=scheme), h, now)
        now = moved(now, rule, rule.x_hat + pull / rule.kappa, h)
        np.testing.assert_allclose(now.positions, velocity * t + 0.5 * pull * t * t, atol=1e-14)
        np.testing.assert_allclose(now.velocity, velocity + pull * t, atol=1e-13)
        np.testing.assert_allclose(now.acceleration, pull, atol=1e-11)


def test_newmark_keeps_the_amplitude_and_the_others_damp() -> None:
    """After a hundred periods of 60 steps newmark keeps the amplitude, the others lose some of it.

    In a step far too long, the amplitude of generalised alpha falls by rho_inf.
    """
    amplitude = {
        scheme: np.abs(swing(Dynamics(scheme=scheme), np.pi / 60.0, 6000)[-60:]).max() * FREQUENCY for scheme in Scheme
    }
    assert amplitude[Scheme.NEWMARK] == pytest.approx(1.0, abs=2e-3)
    assert 0.9 < amplitude[Scheme.GENERALISED_ALPHA] < 1.0
    assert 0.1 < amplitude[Scheme.BDF2] < 0.9
    for rho in (0.0, 0.5, 0.8):
        path = np.abs(swing(Dynamics(scheme=Scheme.GENERALISED_ALPHA, rho_inf=rho), 1e4, 12))
        assert path[-1] <= 1.2 * rho * path[-2] + 1e-12


@pytest.mark.parametrize(
    ("kind", "given", "named"),
    [
        (Dynamics, {"step": 0.0}, "step = 0.0: allowed"),
        (Dynamics, {"rho_inf": 1.5}, "rho_inf = 1.5: allowed"),
        (Dynamics, {"scheme": "newmark", "rho_inf": 0.5}, "rho_inf = 0.5: belongs to the scheme generalised_alpha"),
        (Dynamics, {"prony": (Branch(0.6, 0.1), Branch(0.4, 1.0))}, "less than 1"),
        (Damping, {"viscosity": -1.0}, "viscosity = -1.0: allowed"),
        (Damping, {"mass": float("nan")}, "mass = nan: allowed"),
        (Branch, {"share": 0.5, "time": 0.0}, "time = 0.0: allowed"),
    ],
)
def test_values_out_of_range_are_refused(kind: type, given: dict, named: str) -> None:
    """A value out of range is refused by name."""
    with pytest.raises(ValueError, match=named):
        kind(**given)
