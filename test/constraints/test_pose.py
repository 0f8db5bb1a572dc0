# SPDX-License-Identifier: Apache-2.0
"""Poses of handles: rotation vectors beyond half a turn, interpolation, refusals."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gdfe_ros.constraints import Pose

SQUARE = np.array([[0.0, 1.0, 1.0], [0.0, -1.0, 1.0], [0.0, -1.0, -1.0], [0.0, 1.0, -1.0]])


def test_rest_moves_nothing() -> None:
    """The rest pose leaves points unchanged bit by bit."""
    np.testing.assert_array_equal(Pose().apply(SQUARE, [5.0, 6.0, 7.0]), SQUARE)


def test_translation_moves_every_point() -> None:
    """A translation moves every point by it, whatever the centre is."""
    moved = Pose(translation=(1.0, 2.0, 3.0)).apply(SQUARE, [9.0, 9.0, 9.0])
    np.testing.assert_array_equal(moved, SQUARE + np.array([1.0, 2.0, 3.0]))


def test_rotation_is_about_the_centre_of_the_handle() -> None:
    """A rotation by 90 degrees keeps the handle's centre, and turns y to z (right-handed)."""
    centre = np.array([10.0, 20.0, 30.0])
    moved = Pose(rotation=(math.pi / 2.0, 0.0, 0.0)).apply(SQUARE + centre, centre)
    np.testing.assert_allclose(moved.mean(axis=0), centre, atol=1e-12)
    np.testing.assert_allclose(moved[0] - centre, (0.0, -1.0, 1.0), atol=1e-12)


def test_rotation_comes_before_translation() -> None:
    """A pose rotates about the centre first, and translates then."""
    centre = np.array([10.0, 20.0, 30.0])
    moved = Pose(translation=(1.0, 2.0, 3.0), rotation=(0.3, -0.2, 1.0)).apply(SQUARE + centre, centre)
    np.testing.assert_allclose(moved.mean(axis=0), centre + np.array([1.0, 2.0, 3.0]), atol=1e-12)
    distances = np.linalg.norm(moved[:, None] - moved[None], axis=2)
    np.testing.assert_allclose(distances, np.linalg.norm(SQUARE[:, None] - SQUARE[None], axis=2), atol=1e-12)


def test_a_full_turn_is_not_rest() -> None:
    """A rotation by 360 degrees leaves the points and is kept in the pose."""
    turn = Pose(rotation=(2.0 * math.pi, 0.0, 0.0))
    np.testing.assert_allclose(turn.apply(SQUARE, np.zeros(3)), SQUARE, atol=1e-14)
    assert turn != Pose()


def test_blend_passes_through_more_than_half_a_turn() -> None:
    """The blend halfway to 540 degrees is 270 degrees, not the shorter rotation."""
    end = Pose(translation=(2.0, 0.0, 0.0), rotation=(3.0 * math.pi, 0.0, 0.0))
    assert Pose().blend(end, 0.5) == Pose(translation=(1.0, 0.0, 0.0), rotation=(1.5 * math.pi, 0.0, 0.0))
    assert Pose().blend(end, 0.0) == Pose()
    assert Pose().blend(end, 1.0) == end


def test_poses_are_values_of_plain_floats() -> None:
    """Arrays and integers give a hashable pose of floats."""
    pose = Pose(translation=np.array([1, 2, 3]), rotation=[0, 0, 1])
    assert pose == Pose(translation=(1.0, 2.0, 3.0), rotation=(0.0, 0.0, 1.0))
    assert hash(pose) == hash(Pose(translation=(1.0, 2.0, 3.0), rotation=(0.0, 0.0, 1.0)))
    assert all(type(value) is float for value in (*pose.translation, *pose.rotation))


@pytest.mark.parametrize("name", ["translation", "rotation"])
@pytest.mark.parametrize("bad", [(math.nan, 0, 0), (0, math.inf, 0), (0, 0), (0, 0, 0, 1), 1.0, "abc", np.eye(3)])
def test_poses_are_checked(name: str, bad: object) -> None:
    """Anything but three finite numbers is refused with the field and the value."""
    with pytest.raises(ValueError, match=f"{name} must be three finite numbers, got"):
        Pose(**{name: bad})


def test_a_quaternion_is_told_how_to_become_a_rotation_vector() -> None:
    """A quaternion is refused with a remedy that makes it a rotation vector."""
    quaternion = (0.0, 0.0, math.sin(0.3), math.cos(0.3))
    with pytest.raises(
        ValueError, match=r"a rotation vector, axis times angle in rad; remedy for a quaternion"
    ) as error:
        Pose(rotation=quaternion)
    assert "Rotation.from_quat([x, y, z, w]).as_rotvec()" in str(error.value)
    assert Pose(rotation=Rotation.from_quat(quaternion).as_rotvec()).rotation == pytest.approx((0.0, 0.0, 0.6))
