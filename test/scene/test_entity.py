# SPDX-License-Identifier: Apache-2.0
"""Rigid bodies from URDF and YAML that join a scene, and leave it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gdfe_ros import load_scene
from gdfe_ros.errors import ArmError, SceneError
from gdfe_ros.scene.entity import read_entity, with_body, without_bodies

_URDF = """<robot name="can"><link name="can">
<inertial><mass value="0.1"/><inertia ixx="{across}" ixy="0" ixz="0" iyy="{across}" iyz="0" izz="{along}"/></inertial>
<collision><origin xyz="0 0 0.05" rpy="0 1.5707963267948966 0"/>
<geometry><cylinder radius="0.02" length="0.08"/></geometry></collision></link></robot>"""
_CAN = _URDF.format(across=0.1 * (0.02**2 / 4 + 0.08**2 / 12), along=0.1 * 0.02**2 / 2)


def test_a_urdf_becomes_a_body_at_its_collision_shape() -> None:
    """A lying can, offset in its link, is placed so that the link's frame has the asked pose."""
    scene = load_scene("arm_grasp")
    entity = read_entity(_CAN)
    assert (entity.name, entity.remark) == ("can", "")
    turn = Rotation.from_euler("z", 90, degrees=True)
    body = with_body(scene, "can", entity, origin=np.array([0.5, 0.0, 0.2]), turn=turn).handles[3]
    assert (body.name, body.mass) == ("can", 0.1)
    assert np.allclose(body.origin, [0.5, 0.0, 0.25], atol=1e-15)
    axis = Rotation.from_rotvec(body.turn).apply([0.0, 0.0, 1.0])
    assert np.allclose(axis, [0.0, 1.0, 0.0], atol=1e-12)
    assert body.friction == 0.0
    assert body.form.volume == pytest.approx(math.pi * 0.02**2 * 0.08)


def test_undeclared_prefixes_are_read() -> None:
    """A URDF with a prefix that it does not declare, as ROS' own parser allows, is the same body as without it."""
    given, plain = read_entity(_CAN.replace("<mass ", '<mass drake:odd="1" ')), read_entity(_CAN)
    assert (given.name, given.entry, given.remark) == (plain.name, plain.entry, plain.remark)


def test_moments_of_another_body_are_told() -> None:
    """Moments of inertia that a homogeneous can does not have are told with both values; equal ones are not."""
    hollow = _URDF.format(across=0.1 * (0.02**2 / 2 + 0.08**2 / 12), along=0.1 * 0.02**2)
    assert "homogeneous body, 2e-05, 6.33e-05, 6.33e-05" in read_entity(hollow).remark


def test_a_body_leaves_as_it_came() -> None:
    """A scene with a body that joined and left has the same handles, masses and vertices as before."""
    scene = load_scene("arm_grasp")
    entity = read_entity("{sphere: {radius: 0.01}, density: 1000, friction: 0.3}")
    joined = with_body(scene, "ball", entity, origin=np.array([0.5, 0.0, 0.2]), turn=Rotation.identity())
    assert [each.name for each in joined.handles if each.section == "bodies"] == ["part", "ball"]
    left = without_bodies(joined, ["ball"])
    assert [each.name for each in left.handles] == [each.name for each in scene.handles]
    assert [each.name for each in left.masses] == [each.name for each in scene.masses]


@pytest.mark.parametrize(
    ("text", "kind", "message"),
    [
        (_CAN.replace("<collision>", "<visual>").replace("</collision>", "</visual>"), ArmError, "0 elements <coll"),
        (_CAN.replace("</link>", '</link><link name="lid"/><joint name="j" type="fixed"><parent link="can"/>'
                      '<child link="lid"/></joint>'), ArmError, "allowed: one link"),
        (_CAN.replace('cylinder radius="0.02" length="0.08"', 'mesh filename="can.stl"'), ArmError, "YAML text"),
        (_CAN.replace("</robot>", "<gazebo><mu1>slippery</mu1></gazebo></robot>"), ArmError, "<mu1> is 'slippery'"),
        ("- 1", SceneError, "must be a mapping"),
    ],
)  # fmt: skip
def test_other_resources_are_refused(text: str, kind: type[Exception], message: str) -> None:
    """What cannot become a rigid body is named with a remedy."""
    with pytest.raises(kind, match=message):
        read_entity(text)
