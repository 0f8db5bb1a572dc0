# SPDX-License-Identifier: Apache-2.0
"""Frames on /tf: the frames that the node publishes, and those that commands and handles refer to.

tf2_msgs is not available as a wheel: where it is not installed, its messages are built from their definition.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, TwistStamped, WrenchStamped
from rclpy.qos import DurabilityPolicy, QoSProfile
from scipy.spatial.transform import Rotation

from test.node.conftest import Tree, put, rotation, vector

QUARTER = Rotation.from_euler("z", 90.0, degrees=True)
_LATCHED = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def _pose(frame: str, origin: Iterable[float], turn: Rotation | None = None) -> PoseStamped:
    message = PoseStamped()
    message.header.frame_id = frame
    put(message.pose.position, message.pose.orientation, origin, turn)
    return message


def test_plates_are_told_on_tf(client: Any, start: Callable, coarse: dict, tree: Tree) -> None:
    """The frames of all headers are on /tf and /tf_static, at the tip's pose; wrenches agree in both frames."""
    felt: list[WrenchStamped] = []
    client.node.create_subscription(WrenchStamped, client.full("handles/tip/force_torque"), felt.append, _LATCHED)
    start(**coarse, clock="lockstep", frame_id="left/base_link", publish_clock=True)
    client.target(0.1, turn=(0.0, 0.3, 0.0))
    client.wait_steps(2)
    client.wait(lambda: felt and felt[-1].header.stamp.nanosec and "left/tip" in tree.heard)
    client.wait(lambda: tree.heard["left/tip"].header.stamp == felt[-1].header.stamp)
    wrench = client.arrived("handles/tip/wrench", felt[-1].header.stamp)
    pose = client.arrived("handles/tip/pose", felt[-1].header.stamp)
    named = {message[-1].header.frame_id for name, message in client.received.items() if name.startswith("handles")}
    assert {*named, felt[-1].header.frame_id} == {"left/tip_rest", "left/tip_centre", "left/tip"} <= set(tree.heard)
    assert {each.header.frame_id for each in tree.heard.values()} == {"left/base_link"}
    handle = tree.heard["left/tip"].transform
    centre = client.meshes()[-1][client.meshes()[0][:, 0] > client.meshes()[0][:, 0].max() - 1e-6, :3].mean(axis=0)
    np.testing.assert_allclose(vector(handle.translation), centre, atol=1e-6)
    rest = vector(tree.heard["left/tip_rest"].transform.translation)
    np.testing.assert_allclose(vector(handle.translation), np.add(rest, vector(pose.pose.position)), atol=1e-12)
    np.testing.assert_allclose(rotation(handle.rotation).as_rotvec(), [0.0, 0.3, 0.0], atol=1e-9)
    back = rotation(handle.rotation).inv()
    for part in ("force", "torque"):
        given, read = (vector(getattr(message.wrench, part)) for message in (wrench, felt[-1]))
        np.testing.assert_allclose(read, -back.apply(given), atol=1e-9)
    assert felt[-1].wrench.force != wrench.wrench.force


def test_commands_in_other_frames_are_transformed(client: Any, start: Callable, coarse: dict, tree: Tree) -> None:
    """With odom connected to the node's frame, commands in odom are transformed.

    A target in an unknown frame, or in one with a NaN transform, is refused, and nothing moves.
    """
    process = start(**coarse, clock="lockstep")
    client.wait(lambda: "tip_rest" in tree.heard)
    rest = np.array(vector(tree.heard["tip_rest"].transform.translation))
    client.publish("handles/tip/target", _pose("map", [0, 0, 0], QUARTER))
    client.wait(lambda: client.diagnostics().get("refused: other frame") == "1")
    assert "header.frame_id is 'map'; allowed: empty, 'base_link', 'tip_rest', or a frame connected" in process.log
    tree.tell("base_link", "odom", [np.nan, 0.0, 0.0])
    client.publish("handles/tip/target", _pose("odom", [0, 0, 0]))
    client.wait(lambda: client.diagnostics().get("refused: other frame") == "2")
    assert client.diagnostics()["refused: not finite"] == "1"
    assert len(client.records()) == 1
    # The node's frame lies at (1, 2, 3) in odom, turned by a quarter about z.
    tree.tell("odom", "base_link", [1.0, 2.0, 3.0], turn=QUARTER, fixed=True)
    wanted = np.add(rest, [0.0, 0.01, 0.05])
    place = np.add([1.0, 2.0, 3.0], QUARTER.apply(wanted))
    turn = Rotation.from_rotvec([0.0, 0.2, 0.0])
    step = len(client.records())

    def carried_out() -> bool:
        client.publish("handles/tip/target", _pose("odom", place, QUARTER * turn))
        client.spin(0.2)
        return len(client.records()) > step

    client.wait(carried_out)
    tip = client.records()[-1].handles["tip"]
    np.testing.assert_allclose(tip.translation, [0.0, 0.01, 0.05], atol=1e-9)
    np.testing.assert_allclose(tip.rotation, [0.0, 0.2, 0.0], atol=1e-9)
    client.wait(lambda: int(client.diagnostics()["commands taken"]) == len(client.records()) - 1)
    count = len(client.records())
    twist = TwistStamped()
    twist.header.frame_id, twist.twist.linear.x = "odom", 1.0
    client.publish("handles/tip/velocity", twist)
    client.wait_steps(count + 1)
    moved = np.subtract(client.records()[-1].handles["tip"].translation, tip.translation)
    np.testing.assert_allclose(moved, [0.0, -0.01, 0.0], atol=1e-9)


def test_a_plate_follows_a_frame(client: Any, start: Callable, coarse: dict, tree: Tree) -> None:
    """A tip that follows a frame moves with it, refuses other commands, and returns to it after a reset."""
    process = start(**coarse, follow=["tip=frame:tool0"])
    client.wait(lambda: "tip_rest" in tree.heard)
    assert client.status()["tip follows"] == "frame tool0, not heard yet"
    rest = np.array(vector(tree.heard["tip_rest"].transform.translation))
    turn = Rotation.from_rotvec([0.0, 0.1, 0.0])
    for z in (0.02, 0.05):
        tree.tell("base_link", "tool0", np.add(rest, [0.0, 0.0, z]), turn=turn)
        client.wait(lambda z=z: client.received["handles/tip/pose"][-1].pose.position.z == pytest.approx(z))
    assert client.received["handles/tip/pose"][-1].pose.orientation.y == pytest.approx(np.sin(0.05))
    client.publish("handles/tip/target", _pose("", [0, 0, 0.1], turn))
    client.wait(lambda: client.diagnostics().get("refused: handle follows") == "1")
    assert "handle 'tip' follows frame tool0 and takes no commands" in process.log
    client.trigger("reset")
    after = len(client.received["handles/tip/pose"])
    client.wait(lambda: len(client.received["handles/tip/pose"]) > after)
    client.wait(lambda: client.received["handles/tip/pose"][-1].pose.position.z == pytest.approx(0.05))
    assert client.status()["tip follows"] == "frame tool0"


def test_the_latest_frame_by_stamp_counts(client: Any, start: Callable, coarse: dict, tree: Tree) -> None:
    """Of transforms that arrive out of order, the one with the latest stamp is used."""
    start(**coarse, follow=["tip=frame:tool0"])
    client.wait(lambda: "tip_rest" in tree.heard)
    rest, now = np.array(vector(tree.heard["tip_rest"].transform.translation)), time.time_ns()
    tip = client.received["handles/tip/pose"]
    for z, age in ((0.02, 2), (0.05, 0), (0.03, 1)):
        origin = np.add(rest, [0.0, 0.0, z])
        tree.tell("base_link", "tool0", origin, stamp=now - age * 10**8)
        client.spin(0.3)
    client.wait(lambda: tip and tip[-1].pose.position.z == pytest.approx(0.05))
    assert not any(each.pose.position.z == pytest.approx(0.03) for each in tip)
