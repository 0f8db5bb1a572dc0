# SPDX-License-Identifier: Apache-2.0
"""The controllers of arm_grasp and its files for MoveIt and RViz fit the scene and the node."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml

from gdfe_ros.node.interface import FOLLOW_TRAJECTORY
from gdfe_ros.node.interface.topics import ROBOT_DESCRIPTION
from gdfe_ros.scene import Scene, load_scene

CONFIG = Path(__file__).parents[2] / "config"


@pytest.fixture
def scene() -> Scene:
    """Return the scene that the files describe."""
    return load_scene("arm_grasp")


def test_controllers_drive_all_joints(scene: Scene) -> None:
    """The controllers drive all joints, with the interfaces of the scene."""
    given = yaml.safe_load((CONFIG / "ros2_control" / "arm_controllers.yaml").read_text(encoding="utf-8"))
    arm = given["arm_controller"]["ros__parameters"]
    assert (arm["joints"], arm["command_interfaces"]) == ([j.name for j in scene.arms[0].joints], ["position"])
    tension = given["tension_controller"]["ros__parameters"]
    assert (tension["joints"], tension["interface_name"]) == ([a.name for a in scene.actuators], "effort")
    assert {"arm_controller", "tension_controller"} < set(given["controller_manager"]["ros__parameters"])


def test_moveit_plans_for_the_arm_and_sends_to_the_node(scene: Scene) -> None:
    """MoveIt's groups, limits and controller action agree with the scene and the node."""
    folder, joints = CONFIG / "moveit", scene.arms[0].joints
    root = ElementTree.fromstring((folder / "arm_grasp.srdf").read_text(encoding="utf-8"))
    links = scene.arms[0].dynamics.description.links
    chain = root.find("group/chain")
    assert {chain.get("base_link"), chain.get("tip_link")} <= set(links)
    for pair in root.findall("disable_collisions"):
        assert {pair.get("link1"), pair.get("link2")} <= set(links)
    limits = yaml.safe_load((folder / "joint_limits.yaml").read_text(encoding="utf-8"))["joint_limits"]
    for joint in joints:
        assert limits[joint.name]["max_velocity"] == joint.limits.velocity
        assert limits[joint.name]["max_acceleration"] == pytest.approx(joint.limits.acceleration)
    given = yaml.safe_load((folder / "moveit_controllers.yaml").read_text(encoding="utf-8"))
    sent = given["moveit_simple_controller_manager"]["gdfe_sim"]
    assert FOLLOW_TRAJECTORY.name == f"~/{sent['action_ns']}"
    assert sent["joints"] == [joint.name for joint in joints]
    assert yaml.safe_load((folder / "kinematics.yaml").read_text(encoding="utf-8"))["arm"]


def test_rviz_shows_the_arm() -> None:
    """The RViz configuration shows the URDF's topic."""
    manager = yaml.safe_load((CONFIG / "rviz" / "arm.rviz").read_text(encoding="utf-8"))["Visualization Manager"]
    (arm,) = (each for each in manager["Displays"] if each["Class"].endswith("RobotModel"))
    expected = ROBOT_DESCRIPTION.name.replace("~", "/gdfe_sim").format(arm="arm")
    assert arm["Description Topic"]["Value"] == expected
