# SPDX-License-Identifier: Apache-2.0
"""Every defect of a URDF is named with its remedy."""

from __future__ import annotations

import math

import pytest

from gdfe_ros.arms.urdf import parse_urdf
from gdfe_ros.errors import ArmError
from test.arms.conftest import ARM, TWO_LINKS


def test_links_joints_and_limits_of_an_arm() -> None:
    """The shipped arm has six joints from the base to the flange, with their limits."""
    robot = parse_urdf(ARM.read_text())
    assert (robot.root, len(robot.links), len(robot.commanded)) == ("base_link", 8, 6)
    chain = [joint.name for joint in robot.chain("tool0")]
    assert chain == ["shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3", "flange"]
    elbow = robot.joints["elbow"].limits
    assert (elbow.lower, elbow.upper, elbow.velocity, elbow.effort) == (-2.8, 2.8, 3.1, 100.0)
    assert robot.rigid_with("tool0") == {"tool0", "wrist_3_link"}


def test_a_prefix_names_all_links_and_joints() -> None:
    """A prefix is added to the names of all links and joints."""
    robot = parse_urdf(TWO_LINKS, prefix="left_")
    assert list(robot.links) == ["left_base", "left_one", "left_two", "left_tip"]
    assert 'link="left_one"' in robot.text


def test_a_mimic_joint_takes_no_commands() -> None:
    """A joint that mimics another one is not among the commanded joints."""
    text = TWO_LINKS.replace(LIMIT, LIMIT + '<mimic joint="lift" multiplier="-2"/>')
    robot = parse_urdf(text)
    assert [joint.name for joint in robot.commanded] == ["lift"]
    assert robot.joints["bend"].mimic.multiplier == -2.0


def test_a_prefix_need_not_be_declared() -> None:
    """Attributes and elements with an undeclared prefix are read over, as by ROS' own parser."""
    text = TWO_LINKS.replace('velocity="1.5"', 'velocity="1.5" drake:acceleration="2.5"').replace(
        '<link name="base"/>', '<link name="base"/><tool:colour/>'
    )
    assert [joint.limits.velocity for joint in parse_urdf(text).commanded] == [1.5, 1.5]


XACRO = '<robot name="two" xmlns:xacro="http://www.ros.org/wiki/xacro">'
LIMIT = '<limit lower="-2" upper="2" velocity="1.5" effort="20"/>'


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("<robot", "<robot></robot><robot", "not XML"),
        ('<link name="base"/>', '<link name="base"/><xacro:arm/>', "remedy: `xacro arm.urdf.xacro"),
        ('<robot name="two">', XACRO + "<xacro:arm/>", "remedy: `xacro arm.urdf.xacro"),
        ('<robot name="two">', XACRO.replace("www.ros.org/wiki", "wiki.ros.org") + "<xacro:x/>", "remedy: `xacro arm"),
        ('<mass value="2.0"/>', '<mass value="${mass}"/>', "remedy: `xacro arm.urdf.xacro"),
        (LIMIT, "", "joint 'bend': it has no limit lower, upper; remedy: <limit lower="),
        (LIMIT, LIMIT.replace('"2"', '"nan"'), "upper is 'nan'; allowed: a finite number"),
        (LIMIT, LIMIT.replace('lower="-2"', 'lower="3"'), "its lower limit 3 is above its upper one, 2"),
        (LIMIT, LIMIT.replace('"1.5"', '"0"'), "the joint bend has no largest velocity; remedy: `velocity: 2.0`"),
        ('<axis xyz="0 1 0"/>', '<axis xyz="0 0 0"/>', "joint 'lift': its axis is zero"),
        ('type="fixed"', 'type="floating"', "its type is 'floating'; allowed: fixed, revolute"),
        ('<child link="tip"/>', '<child link="tipp"/>', "the link 'tipp', which is not there; did you mean 'tip'?"),
        ('<child link="tip"/>', '<child link="one"/>', "is the child of the joints lift, end: a closed loop"),
        ('<parent link="base"/>', '<parent link="tip"/>', "closed loop; remedy"),
        ('<mass value="1.0"/>', '<mass value="-1.0"/>', "link 'two': its <inertial> has no mass of 0 kg or more"),
        ('<box size="0.05 0.05 0.3"/>', '<box size="0.05 0.3"/>', "size is '0.05 0.3'; allowed: three finite numbers"),
        ('<box size="0.05 0.05 0.3"/>', "<capsule/>", "has <capsule>; allowed: <box>, <cylinder>"),
        (LIMIT, LIMIT + '<mimic joint="left"/>', "mimics 'left', which is no joint that moves; did you mean 'lift'?"),
        (LIMIT, LIMIT + '<mimic joint="bend"/>', "joint 'bend' mimics itself; remedy: remove its <mimic>"),
        ('name="two">\n    <in', 'name="one">\n    <in', "link 'one' is there 2 times"),
    ],
)  # fmt: skip
def test_defects_are_named(old: str, new: str, told: str) -> None:
    """A defective URDF is refused with a remedy."""
    assert old in TWO_LINKS
    with pytest.raises(ArmError) as error:
        parse_urdf(TWO_LINKS.replace(old, new, 1))
    assert told in str(error.value)


LIFT = LIMIT.replace('"20"', '"40"')


@pytest.mark.parametrize(
    ("lift", "bend", "told"),
    [
        ("bend", "lift", "joint 'lift' mimics 'bend', which mimics 'lift'; remedy: remove its <mimic>"),
        ("left", "lift", "joint 'lift' mimics 'left', which is no joint that moves; joints: none"),
    ],
)
def test_remedies_name_no_joint_that_mimics(lift: str, bend: str, told: str) -> None:
    """A joint in a loop is not advised to mimic itself, and a misspelt joint is not taken for one that mimics."""
    text = TWO_LINKS.replace(LIMIT, f'<mimic joint="{bend}"/>').replace(LIFT, f'<mimic joint="{lift}"/>')
    with pytest.raises(ArmError) as error:
        parse_urdf(text)
    assert told in str(error.value)


def test_limits_of_a_mimic_joint_are_those_of_its_leader() -> None:
    """The scene gives limits to the leader only; a <limit> that the follower can exceed is remarked on."""
    text = TWO_LINKS.replace(LIMIT, LIMIT + '<mimic joint="lift" multiplier="-1" offset="0.5"/>')
    with pytest.raises(ArmError, match=r"'bend' follows 'lift' .* remedy: limits of 'lift' instead"):
        parse_urdf(text, limits={"bend": {"upper": 0.1}})
    remark = "joint 'bend' follows 'lift' (mimic) beyond its ignored <limit>: upper 2 (it reaches 2.5); remedy"
    assert [each.startswith(remark) for each in parse_urdf(text).remarks] == [True]
    assert parse_urdf(text, limits={"lift": {"lower": -1.5}}).remarks == ()


def test_a_scene_may_give_limits_that_the_urdf_lacks() -> None:
    """Limits come from the scene if the URDF has none; a continuous joint has no position limit."""
    given = {"bend": {"lower": -1.0, "upper": 1.0, "velocity": 0.5}}
    assert parse_urdf(TWO_LINKS.replace(LIMIT, ""), limits=given).joints["bend"].limits.velocity == 0.5
    text = TWO_LINKS.replace('name="bend" type="revolute"', 'name="bend" type="continuous"')
    assert parse_urdf(text.replace(LIMIT, '<limit velocity="1" effort="0"/>')).joints["bend"].limits.upper == math.inf
    with pytest.raises(ArmError, match="no joint 'bent' that moves; did you mean 'bend'"):
        parse_urdf(TWO_LINKS, limits={"bent": {}})


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('<robot name="two">', XACRO),
        ("<robot", "<!-- made by xacro:macro arm --><robot"),
        ('<joint name="end" type="fixed">', '<joint name="end" type="fixed"><axis xyz="0 0 0"/>'),
        (LIMIT, '<limit effort="9"/><mimic joint="lift" multiplier="-1"/>'),
        ("<robot", '<?xml version="1.0" encoding="utf-8"?>\n<robot'),
    ],
)
def test_what_xacro_and_cad_programs_write_is_read(old: str, new: str) -> None:
    """A namespace is no macro, fixed joints need no axis, and followers need no limits."""
    assert len(parse_urdf(TWO_LINKS.replace(old, new, 1)).links) == 4


def test_remarks_tell_of_implausible_inertia_and_of_shapes_that_are_not_drawn() -> None:
    """Nothing is computed with a visual shape, and many makers state inertias that no rigid body has."""
    visual = "<visual><geometry><capsule/></geometry></visual><collision>"
    robot = parse_urdf(TWO_LINKS.replace('ixx="0.004"', 'ixx="0.4"').replace("<collision>", visual))
    assert "left out of pictures: link 'one', <visual>: its <geometry> has <capsule>" in robot.remarks[0]
    assert "belong to no rigid body" in robot.remarks[1]
