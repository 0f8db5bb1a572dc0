# SPDX-License-Identifier: Apache-2.0
"""Handles that follow a pose topic, as of the example arm; test_frames.py tests frames."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from rclpy.parameter import Parameter
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState

from gdfe_ros.errors import GdfeError
from gdfe_ros.examples.carrying_arm import CarryingArm, joints_at, tool_at
from gdfe_ros.node.messages import to_time
from gdfe_ros.node.run import leaders_of
from gdfe_ros.scene.loader import load_scene
from gdfe_ros.testing import Simulator
from test.node.conftest import Tree, put, vector

WEIGHT = {"gravity": [0.0, 0.0, -9.81]}
FOLLOW = "wrist=topic:/carrying_arm/tool_pose"


class _Watched(CarryingArm):
    """A node that keeps the joint states that it receives."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self.told: list[JointState] = []
        self.create_subscription(JointState, "~/joint_states", self.told.append, 100)


def test_the_arm_begins_where_the_wrist_is() -> None:
    """The example arm's tool starts at the origin without rotation, and hangs down at its lowest pose."""
    origin, turn = tool_at(joints_at(0.0))
    np.testing.assert_allclose(origin, 0.0, atol=1e-12)
    assert turn.magnitude() == 0.0
    _, turn = tool_at(joints_at(0.5))
    assert turn.apply([1.0, 0.0, 0.0])[2] < -0.9


def test_the_gripper_hangs_on_the_arm(tmp_path: Any, replays: Callable) -> None:
    """Over ten steps the gripper's wrist is at the reported tool pose and carries the weight."""
    parameters = {"follow": [FOLLOW]}
    scene = {"loads.weight": WEIGHT, "solver.tolerance": 1e-5}
    bag = tmp_path / "bag"
    with Simulator(
        "gripper", overrides=scene, parameters=parameters, inputs=["handles/wrist/follow"], bag=bag
    ) as simulator:
        own = {"rate": 20.0, "period": 4.0}
        arm = _Watched(
            context=simulator.context, parameter_overrides=[Parameter(name, value=value) for name, value in own.items()]
        )
        states = simulator.spin(arm, steps=10)
        told = [tool_at(tuple(message.position)) for message in arm.told]
        arm.destroy_node()
        mesh, materials = simulator.scene.mesh, simulator.scene.materials.values()
        density = np.array([material.density for material in materials])[simulator.scene.cell_material]
    weight = 9.81 * float(density @ _volumes(mesh))
    for state in states:
        wrist = state.poses["wrist"]
        origin, turn = min(told, key=lambda pose: np.linalg.norm(pose[0] - wrist.translation))
        np.testing.assert_allclose(wrist.translation, origin, atol=1e-9)
        assert (Rotation.from_rotvec(wrist.rotation) * turn.inv()).magnitude() < 1e-9
        np.testing.assert_allclose(state.wrenches["wrist"][:3], [0.0, 0.0, weight], atol=0.05 * weight)
    assert np.linalg.norm(states[-1].poses["wrist"].rotation) > 0.0
    replays(bag)


@pytest.mark.parametrize(
    ("leader", "said"),
    [
        ("topic:/tool", "command on /tool refused: position"),
        ("frame:tool0", "command on /tf refused: frame 'tool0': translation"),
    ],
)
def test_a_leader_that_makes_no_sense_is_refused(
    client: Any, start: Callable, coarse: dict, tree: Tree, leader: str, said: str
) -> None:
    """Followed poses and frames with NaN, infinity, a zero quaternion or a wrong stamp are counted; the tip stays."""
    process = start(**coarse, follow=[f"tip={leader}"], command_max_age=10.0)
    publisher = client.node.create_publisher(PoseStamped, "/tool", 10)
    client.wait(lambda: publisher.get_subscription_count() or leader.startswith("frame"))
    client.wait(lambda: "tip_rest" in tree.heard)
    rest, tip = vector(tree.heard["tip_rest"].transform.translation), client.received["handles/tip/pose"]

    def lead(z: float, *, length: float = 1.0, age: float = 0.0) -> None:
        origin, stamp = np.add(rest, [0.0, 0.0, z]), time.time_ns() - round(age * 1e9)
        if leader.startswith("frame"):
            tree.tell("base_link", "tool0", origin, stamp=stamp, length=length)
            return
        message = PoseStamped()
        message.header.stamp = to_time(stamp)
        put(message.pose.position, message.pose.orientation, origin, length=length)
        publisher.publish(message)

    lead(0.02)
    client.wait(lambda: tip and tip[-1].pose.position.z == pytest.approx(0.02, abs=1e-6))
    bad = {
        "not finite": [{"z": math.nan}, {"z": math.inf}, {"z": 0.0, "length": math.nan}],
        "quaternion not of unit length": [{"z": 0.0, "length": 0.0}],
        "stamp ahead": [{"z": 0.0, "age": -1000.0}],
        "stale": [{"z": 0.0, "age": 100.0}],
    }
    for changes in (each for several in bad.values() for each in several):
        lead(**changes)
    client.wait(lambda: all(client.status().get(f"refused: {name}") == f"{len(each)}" for name, each in bad.items()))
    values = client.status()
    assert (values["state"], values["steps failed"]) == ("active", "0")
    assert values["commands taken"] == "1" or leader.startswith("frame")
    assert f"{said} ({rest[0]}, {rest[1]}, nan)" in process.log
    assert "Traceback" not in process.log
    lead(0.05)
    client.wait(lambda: tip[-1].pose.position.z == pytest.approx(0.05, abs=1e-6))
    assert all(each.pose.position.z in (0.0, pytest.approx(0.02), pytest.approx(0.05)) for each in tip)


def _volumes(mesh: Any) -> np.ndarray:
    """Return the volumes (m,) [m^3] of cells that are cuboids."""
    corners = mesh.vertices[mesh.cells]
    return np.ptp(corners, axis=1).prod(axis=1)


@pytest.mark.parametrize(
    ("entry", "scene", "said"),
    [
        ("tip", "bend5", "allowed: handle=topic:/name or handle=frame:name"),
        ("tip=pose:x", "bend5", "allowed: handle=topic:/name or handle=frame:name"),
        ("tipp=topic:/x", "bend5", "no handle 'tipp', but base, tip"),
        ("base=topic:/x", "bend5", "put handles.base.fixed=false into scene_overrides"),
        ("tip=frame:tool0", "bend5", "frames need tf2_msgs, which is not installed"),
        ("table=topic:/x", "grasp", "obstacle 'table' is fixed in the scene and takes no commands; remedy: put obstac"),
        ("part=topic:/x", "grasp", "body 'part' moves freely and follows no target; remedy: .*make it an obstacle"),
    ],
)
def test_a_wrong_leader_is_refused(entry: str, scene: str, said: str) -> None:
    """An invalid leader is refused with what is wrong and what is allowed."""
    with pytest.raises(GdfeError, match=said):
        leaders_of([entry], load_scene(scene), listening=False)


def test_a_plate_has_one_leader() -> None:
    """A second leader for a handle is refused."""
    with pytest.raises(GdfeError, match="handle 'tip' follows topic /x already"):
        leaders_of(["tip=topic:/x", "tip=topic:/y"], load_scene("bend5"), listening=False)
