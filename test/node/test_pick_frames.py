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
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from gdfe_ros.node.interface.topics import TF

HANDS = {"front_mesh", "left_mesh", "right_mesh", "palm_mesh", "palm", "front_sensor", "left_sensor", "right_sensor"}
OBJECTS = {"box", "box_centre", "cube_mesh", "table", "table_centre"}
LATCHED = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Watch:
    """Receives /tf, the joint states and the URDF of a node's arm, by stamp."""

    def __init__(self, client: Any) -> None:
        from tf2_msgs.msg import TFMessage

        self.client, self.trees, self.joints, self.urdf = client, {}, {}, []
        client.node.create_subscription(TFMessage, TF.name, self._hear, 100)
        client.node.create_subscription(JointState, client.full("joint_states"), self._feel, 100)
        topic = client.full("arms/arm/robot_description")
        client.node.create_subscription(String, topic, lambda message: self.urdf.append(message.data), LATCHED)

    def _hear(self, message: Any) -> None:
        for each in message.transforms:
            stamp = (each.header.stamp.sec, each.header.stamp.nanosec)
            self.trees.setdefault(stamp, {})[each.child_frame_id] = each

    def _feel(self, message: JointState) -> None:
        stamp = (message.header.stamp.sec, message.header.stamp.nanosec)
        self.joints[stamp] = dict(zip(message.name, message.position, strict=True))


def in_node_frame(tree: dict[str, Any], frame: str, root: str) -> tuple[np.ndarray, np.ndarray]:
    """Return origin and axes of a frame in the node's frame, along the parents of one message."""
    origin, axes = np.zeros(3), np.eye(3)
    while frame != root:
        found = tree[frame].transform
        place, turn = found.translation, found.rotation
        own = Rotation.from_quat([turn.x, turn.y, turn.z, turn.w]).as_matrix()
        origin, axes = np.array([place.x, place.y, place.z]) + own @ origin, own @ axes
        frame = tree[frame].header.frame_id
    return origin, axes


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
    scene: str,
    frame_id: str,
    goal: dict[str, float],
    flange: str,
    client: Any,
    interfaces: Callable,
    start: Callable,
) -> None:
    """Each link is where pinocchio's forward kinematics of the joint states of the same stamp puts it."""
    interfaces("tf2_msgs")
    watch = Watch(client)
    start(scene=scene, clock="lockstep", frame_id=frame_id)
    client.wait(lambda: watch.urdf and client.records(), seconds=300.0)
    client.publish("actuation", JointState(name=list(goal), position=list(goal.values())))
    for _ in range(8):
        client.advance()
    client.wait(lambda: len(watch.trees.keys() & watch.joints.keys()) >= 8)
    model = pinocchio.buildModelFromXML(watch.urdf[-1])
    data = model.createData()
    links = {frame.name for frame in model.frames if frame.type == pinocchio.FrameType.BODY} - {"universe"}
    parents, mimics = _parents(watch.urdf[-1]), _mimics(watch.urdf[-1])
    moved, held = [], []
    for stamp in sorted(watch.trees.keys() & watch.joints.keys()):
        tree, states = watch.trees[stamp], watch.joints[stamp]
        assert links | HANDS | OBJECTS <= {*tree, frame_id}
        assert frame_id not in tree
        assert all(each.header.frame_id != name for name, each in tree.items())
        for name in tree.keys() - links:
            assert tree[name].header.frame_id == frame_id
        for name in tree.keys() & links:
            assert tree[name].header.frame_id == parents.get(name, frame_id)
        states |= {name: factor * states[led] + offset for name, (led, factor, offset) in mimics.items()}
        q = np.array([states[name] for name in model.names[1:]])
        pinocchio.framesForwardKinematics(model, data, q)
        for name in tree.keys() & links:
            wanted = data.oMf[model.getFrameId(name)]
            origin, axes = in_node_frame(tree, name, frame_id)
            assert origin == pytest.approx(wanted.translation, abs=1e-9)
            assert axes == pytest.approx(wanted.rotation, abs=1e-9)
        moved.append(q)
        (place, turn), (hand, axes) = (in_node_frame(tree, name, frame_id) for name in (flange, "palm"))
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
