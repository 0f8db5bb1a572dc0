# SPDX-License-Identifier: Apache-2.0
"""Signed distances to the forms of obstacles."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gdfe_ros import Pose
from gdfe_ros.constraints.obstacle import Box, Capsule, Cylinder, Form, Obstacle, Plane, Sphere
from gdfe_ros.solver.contact import gap

FORMS = [Plane(), Sphere(0.7), Box((1.0, 1.4, 0.6)), Capsule(0.4, 1.0), Cylinder(0.6, 0.8)]


def gaps(obstacle: Obstacle, points: np.ndarray) -> np.ndarray:
    """Return the distance of points (k, 3) [m] from an obstacle."""
    origin, axes = obstacle.frame(Pose())
    head = np.concatenate([axes.ravel(), origin, obstacle.form.numbers, [0.0]])
    found = np.empty(len(points))
    normals = np.empty_like(points)
    gap.distances(points, head, obstacle.form.kind, found, normals)
    return found


def on_surface(form: Form, count: int = 4000) -> np.ndarray:
    """Return points on the surface of a form, found without its distance."""
    rng = np.random.default_rng(1)
    ways = rng.normal(size=(count, 3))
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    match form:
        case Plane():
            return np.column_stack([rng.uniform(-2, 2, (count, 2)), np.zeros(count)])
        case Sphere(radius):
            return radius * ways
        case Box(size):
            half = 0.5 * np.array(size)
            return ways / np.abs(ways / half).max(axis=1)[:, None]
        case Capsule(radius, length):
            return radius * ways + np.outer(np.where(ways[:, 2] > 0, 0.5, -0.5) * length, [0, 0, 1])
    radius, half = form.radius, 0.5 * form.length
    rho = np.hypot(ways[:, 0], ways[:, 1])
    return ways / np.maximum(rho / radius, np.abs(ways[:, 2]) / half)[:, None]


@pytest.mark.parametrize("form", FORMS, ids=lambda form: type(form).__name__)
def test_the_distance_vanishes_on_the_surface_and_is_one_to_one_beside_it(form: Form) -> None:
    """Points of the surface have the distance zero, and no point is nearer to any of them than its distance says."""
    surface, points = on_surface(form), np.random.default_rng(2).uniform(-1.5, 1.5, (200, 3))
    assert np.abs(gaps(Obstacle(name="thing", form=form), surface)).max() < 1e-12
    if isinstance(form, Plane):
        surface = np.column_stack([points[:, :2], np.zeros(200)])
    nearest = np.linalg.norm(points[:, None] - surface[None], axis=2).min(axis=1)
    found = np.abs(gaps(Obstacle(name="thing", form=form), points))
    assert (nearest >= found - 1e-12).all()
    assert np.median(nearest - found) < 0.02


@pytest.mark.parametrize("form", FORMS, ids=lambda form: type(form).__name__)
def test_an_obstacle_is_where_its_frame_is(form: Form) -> None:
    """An obstacle that is placed and turned measures as the one at the origin does in its frame."""
    turn = Rotation.from_rotvec([0.3, -0.8, 0.5])
    placed = Obstacle(name="thing", form=form, origin=(0.2, -0.1, 0.4), turn=tuple(turn.as_rotvec()))
    points = np.random.default_rng(3).uniform(-1.5, 1.5, (100, 3))
    own = turn.inv().apply(points - np.array(placed.origin))
    np.testing.assert_allclose(gaps(placed, points), gaps(Obstacle(name="thing", form=form), own), atol=1e-14)


def test_a_pose_moves_an_obstacle_about_its_own_origin() -> None:
    """The rotation of a pose turns the frame where it stands, its translation shifts it."""
    origin, axes = Obstacle(name="bar", form=Box((1, 2, 3)), origin=(1, 0, 0)).frame(Pose((0, 0, 2), (0, 0, np.pi / 2)))
    np.testing.assert_allclose(origin, [1, 0, 2])
    np.testing.assert_allclose(axes, [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-15)
