# SPDX-License-Identifier: Apache-2.0
"""Signed distances to the shapes of obstacles."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from gdfe_ros import Pose
from gdfe_ros.constraints.distances import form_numbers, measure
from gdfe_ros.constraints.form import Box, Capsule, Cylinder, Form, Plane, Sphere, TriangleMesh
from gdfe_ros.constraints.obstacle import Obstacle
from gdfe_ros.mesh.surfaces.solid import make_solid

FORMS = [Plane(), Sphere(0.7), Box((1.0, 1.4, 0.6)), Capsule(0.4, 1.0), Cylinder(0.6, 0.8)]


def gaps(obstacle: Obstacle, points: np.ndarray) -> np.ndarray:
    """Return the distance of points (k, 3) [m] from an obstacle."""
    return gaps_and_normals(obstacle, points)[0]


def gaps_and_normals(obstacle: Obstacle, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the distance of points (k, 3) [m] from an obstacle, and its gradient."""
    origin, axes = obstacle.frame(Pose())
    return measure(points, np.append(axes, origin), form_numbers(obstacle.form), obstacle.form.kind)


def meshed(surface: trimesh.Trimesh, cell: float | None = None) -> Obstacle:
    """Return an obstacle made of a triangle surface."""
    return Obstacle(name="mesh", form=TriangleMesh(make_solid(surface.vertices, surface.faces, cell=cell)))


def on_surface(form: Form, count: int = 4000) -> np.ndarray:
    """Return points on the surface of a shape, made without the distance function."""
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
    """The distance is zero on the surface, and elsewhere never larger than the distance to any point of the surface."""
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
    """A placed and rotated obstacle has the same distances in its own frame as one at the origin."""
    turn = Rotation.from_rotvec([0.3, -0.8, 0.5])
    placed = Obstacle(name="thing", form=form, origin=(0.2, -0.1, 0.4), turn=tuple(turn.as_rotvec()))
    points = np.random.default_rng(3).uniform(-1.5, 1.5, (100, 3))
    own = turn.inv().apply(points - np.array(placed.origin))
    np.testing.assert_allclose(gaps(placed, points), gaps(Obstacle(name="thing", form=form), own), atol=1e-14)


def test_a_pose_moves_an_obstacle_about_its_own_origin() -> None:
    """The rotation of a pose rotates the obstacle's frame about its origin; the translation moves the origin."""
    origin, axes = Obstacle(name="bar", form=Box((1, 2, 3)), origin=(1, 0, 0)).frame(Pose((0, 0, 2), (0, 0, np.pi / 2)))
    np.testing.assert_allclose(origin, [1, 0, 2])
    np.testing.assert_allclose(axes, [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-15)


def test_a_mesh_of_a_ball_is_as_far_away_as_the_ball() -> None:
    """Within 3 cells of the surface the distance is exact to a fortieth of a cell, the normal to a hundredth."""
    mesh, ball = meshed(trimesh.creation.icosphere(subdivisions=5, radius=0.04)), Obstacle(name="b", form=Sphere(0.04))
    ways = np.random.default_rng(5).normal(size=(2000, 3))
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    cell = mesh.form.solid.cell
    points = ways * (0.04 + cell * np.random.default_rng(6).uniform(-3, 3, (2000, 1)))
    found, normals = gaps_and_normals(mesh, points)
    wanted, ways = gaps_and_normals(ball, points)
    assert np.abs(found - wanted).max() < 0.025 * cell
    assert np.abs(normals - ways).max() < 0.01


def test_a_mesh_of_a_box_is_exact_off_its_edges() -> None:
    """The distance to a mesh of a box is exact to rounding off the edges, and within 0.4 cells of it near them."""
    mesh, box = meshed(trimesh.creation.box((1.0, 1.4, 0.6))), Obstacle(name="b", form=Box((1.0, 1.4, 0.6)))
    points = on_surface(Box((1.0, 1.4, 0.6))) + np.random.default_rng(7).normal(scale=0.01, size=(4000, 3))
    cell, error = mesh.form.solid.cell, np.abs(gaps(mesh, points) - gaps(box, points))
    faces = (np.sort(np.abs(np.abs(points) - [0.5, 0.7, 0.3]), axis=1)[:, 1] > 4 * cell) & (error < np.inf)
    assert faces.sum() > 1000
    assert error[faces].max() < 1e-14
    assert error.max() < 0.4 * cell


def test_beyond_its_grid_a_mesh_is_where_it_is() -> None:
    """Far from the surface the distance and normal are right to a few per cent, and continuous at the grid's border."""
    mesh, ball = meshed(trimesh.creation.icosphere(subdivisions=4, radius=0.7)), Obstacle(name="b", form=Sphere(0.7))
    points = np.random.default_rng(8).uniform(-4, 4, (4000, 3))
    found, normals = gaps_and_normals(mesh, points)
    wanted, ways = gaps_and_normals(ball, points)
    outside = wanted > 0.1
    np.testing.assert_allclose(found[outside], wanted[outside], rtol=0.1, atol=2e-3)
    assert (np.einsum("ni,ni->n", normals, ways)[outside] > 0.9).all()
    edge = mesh.form.solid.start[0] + mesh.form.solid.cell
    across = gaps(mesh, np.array([[edge - 1e-9, 0.1, 0.2], [edge + 1e-9, 0.1, 0.2]]))
    assert across[0] == pytest.approx(across[1], rel=0.01)


def test_the_normal_of_a_mesh_is_the_exact_gradient() -> None:
    """In the grid, a mesh's normal is its spline's gradient, also near kinks of the exact distance."""
    mesh = meshed(trimesh.creation.box((1.0, 1.4, 0.6)))
    points = np.random.default_rng(9).uniform(-1.0, 1.0, (500, 3)) * [0.55, 0.75, 0.35]
    _, normals = gaps_and_normals(mesh, points)
    for axis, way in enumerate(1e-6 * np.eye(3)):
        slopes = (gaps(mesh, points + way) - gaps(mesh, points - way)) / 2e-6
        np.testing.assert_allclose(slopes, normals[:, axis], atol=1e-7)


def test_a_mesh_survives_a_point_that_is_nowhere() -> None:
    """A position that is NaN or infinite has a distance that is not finite, as with closed forms."""
    mesh = meshed(trimesh.creation.box((1.0, 1.4, 0.6)))
    found = gaps(mesh, np.array([[np.nan, 0.0, 0.0], [np.inf, 0.0, 0.0], [0.0, -1e300, 0.0], [0.0, 0.0, 0.0]]))
    assert not np.isfinite(found[:2]).any()
    assert found[2] > 1e100
    assert found[3] == pytest.approx(-0.3, abs=0.02)
