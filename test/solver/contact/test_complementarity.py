# SPDX-License-Identifier: Apache-2.0
"""Signorini's and Coulomb's laws on a compliance matrix, against closed forms."""

import numpy as np
import pytest

from gdfe_ros.solver.contact.complementarity import FIRM, find_violations, solve_laws

G = 9.81


def solved(w, q, mu, start=None):
    """Return forces and displacements that keep the laws."""
    force = np.zeros(len(q)) if start is None else start.copy()
    left = solve_laws(np.ascontiguousarray(w), np.asarray(q, float), np.asarray(mu, float), force, 1e-13, 1e-13)
    assert left <= 1e-13
    return force, q + w @ force


@pytest.mark.parametrize(
    ("q", "mu", "forces", "places"),
    [
        pytest.param([-1, 0.3, 0], [0.5], [1, -0.3, 0], [0, 0, 0], id="within the cone it sticks"),
        pytest.param([-1, 0.8, 0], [0.5], [1, -0.5, 0], [0, 0.3, 0], id="beyond the cone it slides"),
        pytest.param([-1, 0.3, -0.2], [0.0], [1, 0, 0], [0, 0.3, -0.2], id="without friction it slides"),
        pytest.param([1, 0.2, 0, 2, 0, 0.1], [0.5, 0.5], [0] * 6, [1, 0.2, 0, 2, 0, 0.1], id="apart"),
    ],
)
def test_points_of_unit_compliance(q: list[float], mu: list[float], forces: list[float], places: list[float]) -> None:
    """Hold a point as far as its cone does, and leave points without force that stay apart, whatever the start."""
    for start in (np.zeros(len(q)), np.ones(len(q))):
        force, place = solved(np.eye(len(q)), np.array(q, float), mu, start=start)
        np.testing.assert_allclose(force, forces, atol=1e-13)
        np.testing.assert_allclose(place, places, atol=1e-13)


def test_a_point_that_cannot_move_keeps_its_force():
    """Leave the normal force of a held point as it is, also if the laws are solved again with the same matrix."""
    w, force, slip = np.diag([0.0, 1.0, 1.0]), np.array([2.0, 0.0, 0.0]), np.array([0.3, 3.0])
    for _ in range(2):
        assert solve_laws(w, np.array([-1.0, *slip]), np.array([0.5]), force, 1e-13, 1e-13) <= 1e-13
        np.testing.assert_allclose(force, [2.0, *(-slip / np.linalg.norm(slip))])


def test_a_violation_is_that_of_its_point():
    """Name the point that enters, and the one that pulls; a point that keeps the laws has no violation."""
    force, found = np.array([0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 1.0, 0.0, 0.0]), np.empty(3)
    find_violations(np.eye(9), np.array([-0.25, 0, 0, -1.5, 0, 0, -1.0, 0, 0]), np.zeros(3), force, found)
    np.testing.assert_allclose(found, [0.25, 0.5, 0.0])


def test_a_stack_of_ten_bodies():
    """Carry the weight of all bodies above in each contact of a stack; W = J M^-1 J^T of ten unit masses."""
    count = 10
    jacobian = np.eye(count) - np.eye(count, k=-1)
    w, q = np.zeros((3 * count, 3 * count)), np.zeros(3 * count)
    for axis in range(3):
        w[axis::3, axis::3] = jacobian @ jacobian.T
    q[::3] = jacobian @ np.full(count, -G)
    q[2::3] = jacobian @ np.full(count, 1.0)
    force, place = solved(w, q, np.full(count, 0.5))
    np.testing.assert_allclose(force[::3], G * np.arange(count, 0, -1))
    np.testing.assert_allclose(force[2::3], -np.arange(count, 0, -1.0))
    np.testing.assert_allclose(place, 0.0, atol=1e-12)


def test_redundant_points_share_a_load():
    """Carry a rigid box on four corners whose forces are not unique."""
    corners = np.array([[x, y, -0.1] for x in (-0.2, 0.2) for y in (-0.1, 0.1)])
    rows = []
    for x, y, z in corners:
        across = np.array([[0, z, -y], [-z, 0, x], [y, -x, 0]])  # dx = u + w x r = u - [r] w
        way = np.hstack([np.eye(3), across])
        rows.append(way[[2, 0, 1]])
    jacobian = np.vstack(rows)
    inverse = np.diag([1.0, 1.0, 1.0, 100.0, 50.0, 40.0])
    q = jacobian @ np.array([0.3, 0.0, -1.0, 0.0, 0.0, 0.0])
    force, place = solved(jacobian @ inverse @ jacobian.T, q, np.full(4, 0.5))
    np.testing.assert_allclose(jacobian.T @ force, [-0.3, 0, 1, 0, 0, 0], atol=1e-9)
    np.testing.assert_allclose(place, 0.0, atol=1e-10)


@pytest.mark.parametrize("seed", range(20))
def test_slender_compliance(seed):
    """Settle forces at neighbouring points of a slender cantilever, whose compliances are nearly equal."""
    random, count = np.random.default_rng(seed), 12
    x = np.linspace(0.5, 1.0, count)
    bend = np.array([[min(a, b) ** 2 * (3 * max(a, b) - min(a, b)) / 6 for b in x] for a in x])
    w = np.zeros((3 * count, 3 * count))
    w[::3, ::3], w[2::3, 2::3] = bend + 1e-4 * np.eye(count), bend + 1e-4 * np.eye(count)
    w[1::3, 1::3] = 1e-3 * (np.minimum.outer(x, x) + 0.1 * np.eye(count))
    tilt = np.kron(np.eye(count), np.linalg.qr(np.eye(3) + 0.1 * random.standard_normal((3, 3)))[0])
    w = tilt @ w @ tilt.T
    q = np.zeros(3 * count)
    q[::3] = -0.05 * x**2 + 0.01 * random.random(count)
    q[2::3] = 0.02 * random.standard_normal()
    force, place = solved(w, q, np.full(count, 0.4))
    press, gap = force[::3], place[::3]
    assert press.min() >= 0.0
    assert gap.min() >= -1e-12
    assert np.abs(press * gap).max() < 1e-12
    shear = np.linalg.norm(force.reshape(-1, 3)[:, 1:], axis=1)
    assert (shear <= 0.4 * press + 1e-12).all()


def test_laws_without_a_solution_leave_bounded_forces():
    """Squeeze a body of unit compliance by 1 m between two walls: both enter alike, with the forces of firm springs."""
    w, q, force = np.zeros((6, 6)), np.zeros(6), np.zeros(6)
    w[0, 0] = w[3, 3] = 1.0
    w[0, 3] = w[3, 0] = -1.0
    for axis in (1, 2):
        w[axis::3, axis::3] = 1.0
    q[::3] = -0.5
    for _ in range(3):
        assert solve_laws(w, q, np.zeros(2), force, 1e-13, 1e-13) == pytest.approx(0.5, rel=0.01)
        np.testing.assert_allclose(force[::3], 0.5 / FIRM, rtol=0.01)
