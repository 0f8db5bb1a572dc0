# SPDX-License-Identifier: Apache-2.0
"""Frames of the picking arms on /tf: every link, the hand and the objects, with parents, stamps and places."""

from __future__ import annotations

import xml.etree.ElementTree as tree_of
from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio
import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from test.node.conftest import Tree, in_root, to_nanoseconds

HANDS = {"front_mesh", "left_mesh", "right_mesh", "palm_mesh", "palm", "front_sensor", "left_sensor", "right_sensor"}
OBJECTS = {"box", "box_centre", "cube_mesh", "table", "table_centre"}
LATCHED = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)


UR5E = {"shoulder_pan_joint": 0.3, "wrist_1_joint": -2.2, "elbow_joint": 2.0}
PANDA = {"panda_joint1": 0.3, "panda_joint4": -2.2, "panda_joint6": 2.0}


@pytest.mark.parametrize(
    ("scene", "frame_id", "goal", "flange"),
    [
        ("pick_ur5e", "base_link", UR5E, "tool0"),
        ("pick_ur5e", "world", UR5E, "tool0"),
        ("pick_panda", "base_link", PANDA, "panda_hand_tcp"),
    ],
)
def test_links_hand_and_objects_are_on_tf(
    client: Any, start: Callable, tree: Tree, scene: str, frame_id: str, goal: dict[str, float], flange: str
) -> None:
    """Each link is where pinocchio's forward kinematics of the joint states of the same stamp puts it."""
    urdfs = client.listen("arms/arm/robot_description", String)
    readings = client.listen("joint_states", JointState)
    start(scene=scene, clock="lockstep", frame_id=frame_id)
    client.wait(lambda: urdfs and client.records(), seconds=300.0)
    client.publish("actuation", JointState(name=list(goal), position=list(goal.values())))
    for _ in range(8):
        client.advance()

    def stamps() -> list[int]:
        return sorted(tree.told.keys() & {to_nanoseconds(reading.header.stamp) for reading in readings})

    client.wait(lambda: len(stamps()) >= 8)
    joints = {to_nanoseconds(each.header.stamp): dict(zip(each.name, each.position, strict=True)) for each in readings}
    urdf = urdfs[-1].data
    model = pinocchio.buildModelFromXML(urdf)
    data = model.createData()
    links = {frame.name for frame in model.frames if frame.type == pinocchio.FrameType.BODY} - {"universe"}
    parents, mimics = _parents(urdf), _mimics(urdf)
    moved, held = [], []
    for stamp in stamps():
        frames, states = tree.told[stamp], joints[stamp]
        assert links | HANDS | OBJECTS <= {*frames, frame_id}
        assert frame_id not in frames
        assert all(each.header.frame_id != name for name, each in frames.items())
        for name in frames.keys() - links:
            assert frames[name].header.frame_id == frame_id
        for name in frames.keys() & links:
            assert frames[name].header.frame_id == parents.get(name, frame_id)
        states |= {name: factor * states[led] + offset for name, (led, factor, offset) in mimics.items()}
        q = np.array([states[name] for name in model.names[1:]])
        pinocchio.framesForwardKinematics(model, data, q)
        for name in frames.keys() & links:
            wanted = data.oMf[model.getFrameId(name)]
            origin, axes = in_root(frames, name)
            assert origin == pytest.approx(wanted.translation, abs=1e-9)
            assert axes == pytest.approx(wanted.rotation, abs=1e-9)
        moved.append(q)
        (place, turn), (hand, axes) = (in_root(frames, name) for name in (flange, "palm"))
        held.append([*(turn.T @ (hand - place)), *(turn.T @ axes).ravel()])
    assert np.ptp(moved, axis=0).max() > 0.01
    assert np.ptp(held, axis=0).max() < 1e-8  # the flange carries the palm


def _parents(urdf: str) -> dict[str, str]:
    joints = tree_of.fromstring(urdf).findall("joint")
    return {joint.find("child").get("link"): joint.find("parent").get("link") for joint in joints}


def _mimics(urdf: str) -> dict[str, tuple[str, float, float]]:
    """Return a dict from joint that follows another one to the other one, factor and offset."""
    joints = [(joint.get("name"), joint.find("mimic")) for joint in tree_of.fromstring(urdf).findall("joint")]
    return {
        name: (mimic.get("joint"), float(mimic.get("multiplier", "1")), float(mimic.get("offset", "0")))
        for name, mimic in joints
        if mimic is not None
    }


def test_a_root_link_elsewhere_with_the_name_of_the_nodes_frame_is_reported(
    client: Any, interfaces: Callable, start: Callable
) -> None:
    """In `arm_grasp` the root link is `base_link`, but not at the origin: the log says that it is not on /tf."""
    interfaces("tf2_msgs")
    process = start(scene="arm_grasp")
    client.wait(lambda: "active" in process.log, seconds=300.0)
    assert "link 'base_link' of arm 'arm' has the name of the node's frame (frame_id)" in process.log
