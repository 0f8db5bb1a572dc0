# SPDX-License-Identifier: Apache-2.0
"""The URDF and controllers for ros2_control fit the scene, and its hardware interface works with the node.

ros2_control is not available as a wheel. From the URDF, the test imitates
``joint_state_topic_hardware_interface/JointStateTopicSystem``: it sends one ``JointState`` at depth 1 with all joints
by name and an array for each kind of command, and expects states over sensor QoS with arrays as long as the names.
"""

from __future__ import annotations

import time
from functools import partial
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
import yaml
from rclpy.qos import QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import JointState

from gdfe_ros.actuators import Mode
from gdfe_ros.arms.urdf import parse_urdf
from gdfe_ros.node.interface import NODE_NAME
from gdfe_ros.node.interface.topics import ACTUATION, JOINT_COMMAND, JOINT_STATES, TopicSpec
from gdfe_ros.scene import load_scene
from gdfe_ros.testing import NodeProcess
from gdfe_ros.testing.client import await_discovery

FOLDER = Path(__file__).parents[2] / "config" / "ros2_control"


@pytest.fixture
def urdf() -> ElementTree.Element:
    """Return the root element of the URDF."""
    return ElementTree.parse(FOLDER / "tendon_finger.urdf").getroot()


def _parameters(urdf: ElementTree.Element) -> dict[str, str]:
    return {entry.get("name"): entry.text for entry in urdf.findall("ros2_control/hardware/param")}


def _commands(urdf: ElementTree.Element) -> dict[str, str]:
    """Return a dict from joint name to its kind of command."""
    joints = urdf.findall("ros2_control/joint")
    return {joint.get("name"): joint.find("command_interface").get("name") for joint in joints}


@pytest.mark.parametrize(("name", "commands"), [("tendon_finger", ACTUATION), ("arm_grasp", JOINT_COMMAND)])
def test_the_urdf_has_what_the_scene_and_the_node_have(name: str, commands: TopicSpec) -> None:
    """The URDF has the joints, tendons and limits of the scene and the node's topics, and our reader accepts it."""
    scene, text = load_scene(name), (FOLDER / f"{name}.urdf").read_text(encoding="utf-8")
    robot, root = parse_urdf(text), ElementTree.fromstring(text)
    joints = {joint.name: joint for arm in scene.arms for joint in arm.joints}
    tendons = {actuator.name: actuator for actuator in scene.actuators}
    expected = {key: ("position", {"min": j.limits.lower, "max": j.limits.upper}) for key, j in joints.items()}
    expected |= {key: ("effort", {"min": tendon.low, "max": tendon.high}) for key, tendon in tendons.items()}
    controls = {each.get("name"): each for each in root.findall("ros2_control/joint")}
    assert list(controls) == [joint.name for joint in robot.commanded] == list(expected)
    for key, control in controls.items():
        command = control.find("command_interface")
        bounds = {entry.get("name"): float(entry.text) for entry in command.findall("param")}
        assert (command.get("name"), bounds) == expected[key]
        assert [each.get("name") for each in control.findall("state_interface")] == ["position", "velocity", "effort"]
        if key in joints:
            assert robot.joints[key].limits.velocity == joints[key].limits.velocity
        else:
            assert tendons[key].mode is Mode.TENSION
            assert float(root.find(f"joint[@name='{key}']/limit").get("effort")) == tendons[key].high
    assert _parameters(root) == {
        "joint_commands_topic": commands.name.replace("~", f"/{NODE_NAME}"),
        "joint_states_topic": JOINT_STATES.name.replace("~", f"/{NODE_NAME}"),
        "trigger_joint_command_threshold": "-1",
    }


def test_the_controllers_drive_what_the_urdf_offers(urdf: ElementTree.Element) -> None:
    """The controllers use the URDF's joints and interfaces."""
    controllers = yaml.safe_load((FOLDER / "controllers.yaml").read_text(encoding="utf-8"))
    kinds = controllers.pop("controller_manager")["ros__parameters"]
    assert set(controllers) <= set(kinds)
    (driven,) = (entry["ros__parameters"] for entry in controllers.values())
    assert _commands(urdf) == dict.fromkeys(driven["joints"], driven["interface_name"])


def test_a_node_understands_the_hardware_and_is_understood(ros: Any, urdf: ElementTree.Element) -> None:
    """In lockstep each message of the hardware makes a step, whose state has the data that the hardware reads."""
    topics, commands = _parameters(urdf), _commands(urdf)
    node, states = ros.node("hardware"), []
    node.create_subscription(JointState, topics["joint_states_topic"], states.append, qos_profile_sensor_data)
    publisher = node.create_publisher(JointState, topics["joint_commands_topic"], QoSProfile(depth=1))
    with NodeProcess({"scene": "tendon_finger", "clock": "lockstep"}) as process:
        wait = partial(ros.wait, alive=lambda: process.running)
        wait(publisher.get_subscription_count)
        await_discovery(node, f"/{NODE_NAME}", wait)
        seen = set()
        for flexor in (1.0, 2.0, 2.0):

            def answer(flexor: float = flexor) -> JointState | None:
                """Send the command again and return the new state, or None: states over sensor QoS may be lost."""
                message = JointState(name=list(commands), effort=[flexor, 0.5])
                message.header.stamp = node.get_clock().now().to_msg()
                publisher.publish(message)
                end = time.monotonic() + 1.0
                while not (new := [s for s in states if _is_new(s, flexor, seen)]) and time.monotonic() < end:
                    ros.executor.spin_once(timeout_sec=0.05)
                return new[0] if new else None

            state = wait(answer)
            seen.add(_stamp(state))
            assert len(state.name) == len(state.position) == len(state.velocity) == len(state.effort) == 2
            assert dict(zip(state.name, state.effort, strict=True)) == pytest.approx(
                {"flexor": flexor, "extensor": 0.5}
            )
    assert len(seen) == 3


def _is_new(state: JointState, flexor: float, seen: set[int]) -> bool:
    return state.effort[0] == pytest.approx(flexor) and _stamp(state) not in seen


def _stamp(state: JointState) -> int:
    return state.header.stamp.sec * 10**9 + state.header.stamp.nanosec
