# SPDX-License-Identifier: Apache-2.0
"""A program moves handles linearly between its keyframes."""

from __future__ import annotations

import numpy as np
import pytest

from gdfe_ros import load_scene
from gdfe_ros.constraints import Pose
from gdfe_ros.errors import SceneError
from gdfe_ros.scene import Keyframe, Program


def _frame(time: float, pose: Pose) -> Keyframe:
    return Keyframe(time=time, translation=pose.translation, rotation_deg=tuple(np.degrees(pose.rotation)))


UP = Pose((0.0, 0.0, 0.2), (4.0, 0.0, 0.0))
BACK = Pose((0.1, 0.0, 0.0))
PROGRAM = Program(
    duration=5.0, handles={"tip": (_frame(0.0, Pose()), _frame(2.0, UP), _frame(3.0, BACK)), "late": (_frame(4.0, UP),)}
)


@pytest.mark.parametrize(
    ("time", "translation", "rotation"),
    [
        (-1.0, (0, 0, 0), (0, 0, 0)),
        (0.5, (0, 0, 0.05), (1, 0, 0)),
        (2.0, (0, 0, 0.2), (4, 0, 0)),
        (2.5, (0.05, 0, 0.1), (2, 0, 0)),
        (3.0, (0.1, 0, 0), (0, 0, 0)),
        (9.0, (0.1, 0, 0), (0, 0, 0)),
    ],
)
def test_poses_change_linearly(time: float, translation: tuple, rotation: tuple) -> None:
    """Translation and rotation vector are interpolated linearly in time, beyond half a turn too; constant outside."""
    pose = PROGRAM.handle_poses(time)["tip"]
    np.testing.assert_allclose(pose.translation, translation, atol=1e-15)
    np.testing.assert_allclose(pose.rotation, rotation, atol=1e-15)


def test_a_late_first_keyframe_starts_from_rest_at_time_zero() -> None:
    """A single keyframe is reached linearly from the rest pose at time 0."""
    assert PROGRAM.handle_poses(1.0)["late"].translation == pytest.approx((0, 0, 0.05))


def test_times_are_all_moments_of_change() -> None:
    """The program's times are 0, the keyframes and the duration, once each."""
    assert PROGRAM.times == (0.0, 2.0, 3.0, 4.0, 5.0)


def test_an_item_with_a_defect_is_known_to_the_program() -> None:
    """A typo inside of an actuator is one defect; the program's commands for this actuator are none."""
    with pytest.raises(SceneError) as caught:
        load_scene("tendon_finger", overrides={"actuators.flexor.cable.rang": [0, 1]})
    assert len(caught.value.defects) == 1
    assert "did you mean 'range'?" in str(caught.value)
