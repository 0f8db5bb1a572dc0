# SPDX-License-Identifier: Apache-2.0
"""Rotations of parts, obstacles, bodies and arms in a scene file."""

from __future__ import annotations

from typing import Annotated

import numpy as np
import pytest
from pydantic import BaseModel, ValidationError
from scipy.spatial.transform import Rotation

from gdfe_ros.quantity import RotationQuantity
from gdfe_ros.scene.schemas.obstacle_schema import ObstacleModel


class Placed(BaseModel):
    """An entry with a rotation."""

    turn: Annotated[tuple[float, float, float], RotationQuantity("turn", "degrees", least=-360, most=360, count=3)]


def test_one_rotation_vector_is_taken_as_it_is() -> None:
    """A single rotation vector keeps its bits."""
    assert Placed(turn=[0.1, 0, 270]).turn == (0.1, 0.0, 270.0)


def test_several_rotations_are_applied_in_turn_about_fixed_axes() -> None:
    """A finger along x that is turned by 90 degrees about y, then by 120 about z, points down; its side turns."""
    turn = Rotation.from_rotvec(Placed(turn=[[0, 90, 0], [0, 0, 120]]).turn, degrees=True)
    np.testing.assert_allclose(turn.apply([1, 0, 0]), [0, 0, -1], atol=1e-12)
    np.testing.assert_allclose(turn.apply([0, 1, 0]), [-np.sqrt(0.75), -0.5, 0], atol=1e-12)


@pytest.mark.parametrize("wrong", [[[0, 90], [0, 0, 120]], [[0, 400, 0]], [0, [90], 0], [[]], []])
def test_a_wrong_rotation_names_the_form_and_the_range(wrong: list) -> None:
    """A vector of another length or out of range is refused with what is allowed."""
    with pytest.raises(ValidationError, match=r"a list of 3 numbers or a list of such lists: -360 <= turn \[degrees\]"):
        Placed(turn=wrong)


def test_an_obstacle_is_turned_twice() -> None:
    """The longest edge of a box that is turned about x and then about z has the direction of both rotations."""
    model = ObstacleModel.model_validate(
        {"box": {"size": [0.1, 0.2, 0.3]}, "rotation_deg": [[90, 0, 0], [0, 0, 90]], "at": [0, 0, 1]}
    )
    turn = Rotation.from_rotvec(model.build("box").turn)
    np.testing.assert_allclose(turn.apply([0, 0, 1]), [1, 0, 0], atol=1e-12)
