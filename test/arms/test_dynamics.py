# SPDX-License-Identifier: Apache-2.0
"""Kinematics and efforts of arms against closed forms and energies."""

from __future__ import annotations

import numpy as np
import pytest

from gdfe_ros.arms.dynamics import LinkDynamics, LinkFrame, Push
from gdfe_ros.arms.urdf import parse_urdf
from test.arms.conftest import ARM, TWO_LINKS

GRAVITY = np.array([0.0, 0.0, -9.81])
MIMIC = TWO_LINKS.replace('effort="20"/>', 'effort="20"/><mimic joint="lift" multiplier="-0.5" offset="0.2"/>')


def arm(text: str) -> LinkDynamics:
    """Return an arm whose base is rotated and shifted."""
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    return LinkDynamics(parse_urdf(text), LinkFrame(np.array([0.3, -0.2, 0.1]), turn))


def test_frames_of_two_links_are_those_of_the_closed_form() -> None:
    """The tip of two links is at l1 sin a + l2 sin (a + b)."""
    a, b = 0.4, 0.7
    tip = arm(TWO_LINKS).frames(np.array([a, b]))["tip"]
    x, z = 0.4 * np.sin(a) + 0.2 * np.sin(a + b), 0.4 * np.cos(a) + 0.2 * np.cos(a + b)
    np.testing.assert_allclose(tip.origin, [0.3, -0.2 + x, 0.1 + z], atol=1e-15)


def test_holding_efforts_are_those_of_the_weights() -> None:
    """The holding efforts of two links with a weight at the tip are the moments of the weights about the hinges."""
    a, b, force = 0.4, 0.7, np.array([0.0, 0.0, -3.0])
    own = arm(TWO_LINKS)
    q = np.array([a, b])
    tip = own.frames(q)["tip"].origin
    still = np.zeros(2)
    found = own.efforts(q, still, still, gravity=GRAVITY, pushes={"tip": Push(force, np.zeros(3), tip)})
    end = 0.1 * np.sin(a + b) * 9.81 + 0.2 * np.sin(a + b) * 3.0
    first = 2.0 * 9.81 * 0.2 * np.sin(a) + (9.81 + 3.0) * 0.4 * np.sin(a) + end
    np.testing.assert_allclose(found, [-first, -end], rtol=1e-12)


@pytest.mark.parametrize("text", [TWO_LINKS, MIMIC, ARM.read_text()], ids=["two links", "mimic", "six joints"])
def test_efforts_do_the_work_of_the_energies(text: str) -> None:
    """The efforts' power is the rate of kinetic plus potential energy, also with joints that mimic others."""
    own = arm(text)
    n = len(own.joints)
    rng = np.random.default_rng(3)
    amplitude, phase = rng.uniform(0.2, 0.6, n), rng.uniform(0.0, 6.0, n)

    def energy(t: float) -> float:
        q, v = amplitude * np.sin(t + phase), amplitude * np.cos(t + phase)
        return own.kinetic_energy(q, v) + own.potential_energy(q, GRAVITY)

    for t in (0.0, 0.7, 1.9):
        q, v = amplitude * np.sin(t + phase), amplitude * np.cos(t + phase)
        power = own.efforts(q, v, -q, gravity=GRAVITY, pushes={}) @ v
        h = 1e-4
        slope = (energy(t - 2 * h) - 8 * energy(t - h) + 8 * energy(t + h) - energy(t + 2 * h)) / (12 * h)
        assert power == pytest.approx(slope, rel=1e-8, abs=1e-9)


def test_a_push_does_the_work_of_its_point() -> None:
    """A wrench on a link gives the efforts J^T w, by differences of the pushed point and of the link's rotation."""
    own = arm(ARM.read_text())
    q = np.array([0.3, 0.7, 1.5, -0.8, -1.2, 0.4])
    frame = own.frames(q)["forearm_link"]
    local = np.array([0.01, 0.02, 0.1])
    push = Push(np.array([1.0, -2.0, 3.0]), np.array([0.1, 0.2, -0.3]), frame.origin + frame.axes @ local)
    still = np.zeros(6)
    found = own.efforts(q, still, still, gravity=np.zeros(3), pushes={"forearm_link": push})
    for i in range(6):
        step = np.zeros(6)
        step[i] = 1e-6
        ahead, behind = own.frames(q + step)["forearm_link"], own.frames(q - step)["forearm_link"]
        shift = (ahead.origin + ahead.axes @ local - behind.origin - behind.axes @ local) / 2e-6
        spin = (ahead.axes - behind.axes) / 2e-6 @ frame.axes.T
        turn = np.array([spin[2, 1] - spin[1, 2], spin[0, 2] - spin[2, 0], spin[1, 0] - spin[0, 1]]) / 2.0
        assert found[i] == pytest.approx(-(push.force @ shift + push.moment @ turn), abs=1e-8)
