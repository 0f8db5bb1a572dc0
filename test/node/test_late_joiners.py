# SPDX-License-Identifier: Apache-2.0
"""A subscriber that joins late gets the present state without a step."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, WrenchStamped
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState, PointCloud2
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger
from visualization_msgs.msg import Marker

from gdfe_ros.recording.reader import BagReader
from gdfe_ros.recording.step import StepRecord

_QOS = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
_BEST_EFFORT = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
_TOPICS = {
    "mesh": PointCloud2,
    "strain": PointCloud2,
    "markers": Marker,
    "step_record": String,
    "handles/tip/pose": PoseStamped,
    "handles/tip/wrench": WrenchStamped,
}


class _Newcomer:
    """A client that subscribes to diagnostics only, until `listen` adds topics."""

    def __init__(self, ros: Any) -> None:
        self.node, self.wait = ros.node("newcomer"), ros.wait
        self.status: dict[str, str] = {}
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self._read, _QOS)

    def _read(self, message: DiagnosticArray) -> None:
        self.status = {value.key: value.value for status in message.status for value in status.values}

    def wait_for_steps(self, count: int) -> None:
        self.wait(lambda: int(self.status.get("steps", 0)) == count)

    def publish(self, topic: str, message: Any) -> None:
        publisher = self.node.create_publisher(type(message), f"/gdfe_sim/{topic}", 10)
        self.wait(publisher.get_subscription_count)
        publisher.publish(message)

    def call(self, kind: type, name: str, request: Any) -> None:
        client = self.node.create_client(kind, f"/gdfe_sim/{name}")
        self.wait(client.service_is_ready)
        # The answer may get lost where the node does not know this client yet; what it does is seen in diagnostics.
        client.call_async(request)

    def listen(self, topic: str, kind: type, qos: QoSProfile = _QOS) -> Any:
        """Subscribe to a topic; return the list to which its messages are appended."""
        got: list[Any] = []
        self.node.create_subscription(kind, topic if topic[0] == "/" else f"/gdfe_sim/{topic}", got.append, qos)
        return got


@pytest.fixture
def newcomer(ros: Any) -> _Newcomer:
    """Give a client that subscribes to diagnostics only."""
    return _Newcomer(ros)


def _lift(newcomer: _Newcomer, z: float, *, turned: bool = False) -> None:
    message = PoseStamped()
    message.pose.position.z = z
    if turned:
        message.pose.orientation.x, message.pose.orientation.w = 1.0, 0.0
    newcomer.publish("handles/tip/target", message)


@pytest.mark.parametrize("clock", ["lockstep", "wall"])
def test_late_joiners_get_the_present_state(newcomer: _Newcomer, start: Callable, coarse: dict, clock: str) -> None:
    """After a tip is lifted, in lockstep or while paused, a late subscriber of any topic gets the lifted state."""
    start(**coarse, clock=clock, heartbeat=0.0)
    newcomer.wait_for_steps(1)
    if clock == "wall":
        newcomer.call(SetBool, "pause", SetBool.Request(data=True))
        newcomer.wait(lambda: newcomer.status["clock"] == "paused")
    _lift(newcomer, 0.1)
    newcomer.wait(lambda: newcomer.status["commands taken"] == "1")
    if clock == "wall":
        newcomer.call(Trigger, "step", Trigger.Request())
    newcomer.wait_for_steps(2)
    got = {topic: newcomer.listen(topic, kind) for topic, kind in _TOPICS.items()}
    got["volatile"] = newcomer.listen("mesh", PointCloud2, _BEST_EFFORT)
    newcomer.wait(lambda: all(_lifted(messages) for messages in got.values()))
    assert newcomer.status["steps"] == "2"


def test_late_joiners_get_the_last_state_during_a_long_step(newcomer: _Newcomer, start: Callable) -> None:
    """After steps that nobody saw, a subscriber of any topic first gets, during a long step, the state before it."""
    fine = ["mesh.bar.cells=[60, 14, 14]", "solver.tolerance=1e-12", "solver.max_iterations=100000"]
    start(scene="bend5", scene_overrides=fine, clock="lockstep")
    newcomer.wait_for_steps(1)
    _lift(newcomer, 0.1)
    newcomer.wait_for_steps(2)
    _lift(newcomer, 0.2, turned=True)
    newcomer.wait(lambda: re.search("[1-9] rounds of iterations", newcomer.status.get("working on", "")))
    got = {topic: newcomer.listen(topic, kind) for topic, kind in _TOPICS.items()}
    newcomer.wait(lambda: all(_lifted(messages) for messages in got.values()))
    assert all(_lifted(got[topic][:1]) for topic in ("mesh", "strain", "markers")), "the last state is stored"
    assert newcomer.status["steps"] == "2"


def _lifted(messages: list[Any]) -> bool:
    if not messages:
        return False
    match messages[-1]:
        case PointCloud2(point_step=24) as mesh:
            return np.isclose(np.frombuffer(mesh.data, "<f4").reshape(-1, 6)[:, 5].max(), 0.1, rtol=0.05)
        case PointCloud2() as strain:
            return np.frombuffer(strain.data, "<f4").reshape(-1, 8)[:, 3].max() > 1e-3
        case Marker() as marker:
            return max(point.z for point in marker.points) > 0.1
        case String() as text:
            return StepRecord.from_json(text.data).step == 1
        case PoseStamped() as pose:
            return np.isclose(pose.pose.position.z, 0.1)
        case WrenchStamped() as wrench:
            return wrench.wrench.force.z > 0.0
    raise AssertionError(messages[-1])


def test_a_late_joiner_gets_the_time_and_the_joints(newcomer: _Newcomer, start: Callable) -> None:
    """A late subscriber of /clock and joint states gets those of the last step."""
    start(scene="tendon_finger", clock="lockstep", dt=0.25, publish_clock=True)
    newcomer.wait_for_steps(1)
    newcomer.publish("actuation", JointState(name=["flexor"], effort=[2.0]))
    newcomer.wait_for_steps(2)
    clock, joints = newcomer.listen("/clock", Clock, _BEST_EFFORT), newcomer.listen("joint_states", JointState)
    newcomer.wait(lambda: clock and joints and joints[-1].effort[0] == 2.0)
    assert clock[-1].clock.nanosec == 250_000_000


def test_a_bag_holds_each_step_once_whoever_comes_late(
    newcomer: _Newcomer, start: Callable, coarse: dict, tmp_path: Any
) -> None:
    """With a late subscriber, the bag has exactly one mesh per step."""
    process = start(**coarse, clock="lockstep", record=True, bag_path=str(tmp_path / "bag"))
    newcomer.wait_for_steps(1)
    _lift(newcomer, 0.1)
    newcomer.wait_for_steps(2)
    got = newcomer.listen("mesh", PointCloud2)
    newcomer.wait(lambda: _lifted(got))
    process.stop()
    assert BagReader(tmp_path / "bag").counts["/gdfe_sim/mesh"] == 2
