# SPDX-License-Identifier: Apache-2.0
"""A node in its own process, and a client that talks to it over Fast DDS."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Duration, Time
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, TransformStamped, WrenchStamped
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import SetParameters
from rclpy.action import ActionClient
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Int32MultiArray, String
from std_srvs.srv import SetBool, Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from gdfe_ros.recording.step import StepRecord
from gdfe_ros.testing import NodeProcess
from gdfe_ros.testing.client import await_discovery
from test.node.standard import Standard

DATA = Path(__file__).parents[1] / "data"
COARSE = {"scene": "bend5", "scene_overrides": ["mesh.bar.cells=[20, 2, 2]"]}
"""Parameters of a scene that is solved in a millisecond."""

_QOS = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
_OUTPUTS = {
    "mesh": PointCloud2,
    "strain": PointCloud2,
    "step_record": String,
    "topology": Int32MultiArray,
    "scene": String,
    "handles/tip/pose": PoseStamped,
    "handles/tip/wrench": WrenchStamped,
    "/diagnostics": DiagnosticArray,
}


class Client:
    """Subscribes to every output of a node and keeps all messages that arrive, by topic.

    The order of messages on different topics is not defined. If steps are faster than this process reads, messages may
    be lost: the node keeps the last ten of a topic. A test that needs all messages reads a bag.

    Attributes:
        received: dict from the topic's name, without the node's, to its messages.
    """

    def __init__(self, ros: Any, name: str = "/gdfe_sim") -> None:
        self.node = ros.node("client")
        self.wait, self._executor, self._name = ros.wait, ros.executor, name
        self.received: dict[str, list[Any]] = defaultdict(list)
        for topic, kind in _OUTPUTS.items():
            self.node.create_subscription(kind, self.full(topic), self.received[topic].append, _QOS)
        self._publishers: dict[str, Any] = {}
        self._services: dict[str, Any] = {}

    def full(self, topic: str) -> str:
        """Return a topic's full name."""
        return topic if topic.startswith("/") else f"{self._name}/{topic}"

    def spin(self, seconds: float) -> None:
        """Receive messages for a time [s]."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            self._executor.spin_once(timeout_sec=left)

    def target(self, z: float = 0.0, *, handle: str = "tip", turn: tuple = (0, 0, 0), **changes: Any) -> None:
        """Command a handle: ``z`` [m], ``turn`` rotation vector [rad]; ``changes`` replace quaternion components."""
        message = PoseStamped()
        message.pose.position.z = float(z)
        parts = dict(zip("xyzw", map(float, Rotation.from_rotvec(turn).as_quat()), strict=True))
        for part, value in {**parts, **changes}.items():
            setattr(message.pose.orientation, part, value)
        self.publish(f"handles/{handle}/target", message)

    def publish(self, topic: str, message: Any) -> None:
        """Publish on a topic of the node; the first call waits until the active node subscribes and knows this client.

        /diagnostics is subscribed to last: a client that receives it is known with all its subscriptions
        (``await_discovery``). Before that, the node might publish a step only to the subscriptions that it knows.
        """
        if topic not in self._publishers:
            publisher = self.node.create_publisher(type(message), self.full(topic), 1000)
            self._publishers[topic] = publisher
            known = (self.received["mesh"], self.received["/diagnostics"])
            self.wait(lambda: publisher.get_subscription_count() and all(known))
        self._publishers[topic].publish(message)

    def call(self, kind: type, service: str, request: Any) -> Any:
        """Call a service of the node."""
        if service not in self._services:
            client = self.node.create_client(kind, self.full(service))
            self._services[service] = client
            self.wait(client.service_is_ready)
            await_discovery(self.node, self._name, self.wait)
        future = self._services[service].call_async(request)
        self.wait(future.done)
        return future.result()

    def action(self, kind: type, name: str) -> ActionClient:
        """Return a client of an action once the node knows it; before that, an answer could get lost."""
        action = ActionClient(self.node, kind, self.full(name))
        self.wait(action.server_is_ready)
        await_discovery(self.node, self._name, self.wait)
        return action

    def transition(self, label: str) -> bool:
        """Request a transition of the lifecycle; return whether it succeeded."""
        request = ChangeState.Request()
        request.transition.label = label
        return self.call(ChangeState, "change_state", request).success

    def state(self) -> str:
        """Return the state of the lifecycle."""
        return self.call(GetState, "get_state", GetState.Request()).current_state.label

    def set(self, **values: Any) -> list[SetParametersResult]:
        """Set parameters one by one; return the results."""
        messages = [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
        return self.call(SetParameters, "set_parameters", SetParameters.Request(parameters=messages)).results

    def listen(self, topic: str, kind: type) -> list[Any]:
        """Subscribe to a topic of the node; return the list of received messages."""
        self.node.create_subscription(kind, self.full(topic), self.received[topic].append, _QOS)
        return self.received[topic]

    def trigger(self, service: str) -> str:
        """Call a service of the kind Trigger, which must succeed; return its message."""
        response = self.call(Trigger, service, Trigger.Request())
        assert response.success, response.message
        return response.message

    def advance(self, count: int = 1) -> None:
        """Make steps in lockstep."""
        for _ in range(count):
            self.trigger("step")

    def switch(self, service: str, data: bool) -> str:
        """Call a service of the kind SetBool, which must succeed; return its message."""
        response = self.call(SetBool, service, SetBool.Request(data=data))
        assert response.success, response.message
        return response.message

    def last(self, topic: str) -> Any:
        """Return the last message of a topic; wait for the first one."""
        return self.wait(lambda: self.received[topic])[-1]

    def record(self) -> StepRecord:
        """Return the last step record; wait for the first one."""
        return StepRecord.from_json(self.last("step_record").data)

    def records(self) -> list[StepRecord]:
        """Return the records of all steps that arrived."""
        return [StepRecord.from_json(message.data) for message in self.received["step_record"]]

    def mesh(self) -> np.ndarray:
        """Return the last mesh, (n, 6) float32; wait for the first one."""
        return vertices(self.last("mesh"))

    def meshes(self) -> list[np.ndarray]:
        """Return all meshes that arrived, each (n, 6) float32."""
        return [vertices(message) for message in self.received["mesh"]]

    def wait_steps(self, count: int) -> None:
        """Spin until records and meshes of ``count`` steps have arrived."""
        self.wait(lambda: len(self.received["step_record"]) >= count and len(self.received["mesh"]) >= count)

    def wait_taken(self, count: int) -> None:
        """Wait until the node's diagnostics report ``count`` taken commands."""
        self.wait(lambda: int(self.diagnostics()["commands taken"]) >= count)

    def arrived(self, topic: str, stamp: Any) -> Any:
        """Wait for the message of a topic with a given stamp, and return it."""
        found = lambda: [message for message in self.received[topic] if message.header.stamp == stamp]  # noqa: E731
        return self.wait(found)[-1]

    def diagnostics(self) -> dict[str, str]:
        """Wait for diagnostics stamped after the call; return a dict from key to value, with level and message.

        Earlier diagnostics that are still in transit are ignored.
        """
        called, received = time.time_ns(), self.received["/diagnostics"]
        self.wait(lambda: received and to_nanoseconds(received[-1].header.stamp) > called)
        whole, *_ = parts = received[-1].status
        values = {value.key: value.value for status in parts for value in status.values}
        return {**values, "message": whole.message, "level": str(whole.level[0])}

    def status(self) -> dict[str, str]:
        """Return a dict of the values of diagnostics made after the call, whatever clock stamps them."""
        received = self.received["/diagnostics"]
        count = len(received) + 2  # the next one may be in transit
        self.wait(lambda: len(received) >= count)
        return {value.key: value.value for status in received[-1].status for value in status.values}


class Tree:
    """Publishes frames and receives them, with the messages of tf2.

    Attributes:
        heard: dict from a frame's name to its last transform.
        told: dict from stamp [ns] to a dict like ``heard`` of the transforms with this stamp.
    """

    def __init__(self, client: Client) -> None:
        from tf2_msgs.msg import TFMessage

        self._kind, self._publishers = TFMessage, []
        self.heard: dict[str, TransformStamped] = {}
        self.told: dict[int, dict[str, TransformStamped]] = defaultdict(dict)
        for topic, qos in (("/tf", 100), ("/tf_static", _QOS)):
            client.node.create_subscription(TFMessage, topic, self._hear, qos)
            self._publishers.append(client.node.create_publisher(TFMessage, topic, qos))

    def tell(
        self,
        parent: str,
        child: str,
        origin: Iterable[float],
        *,
        turn: Rotation | None = None,
        fixed: bool = False,
        stamp: int = 0,
        length: float = 1.0,
    ) -> None:
        """Publish a frame with a stamp [ns] and a quaternion of a given length."""
        transform = TransformStamped(child_frame_id=child)
        transform.header.frame_id = parent
        transform.header.stamp.sec, transform.header.stamp.nanosec = divmod(stamp, 10**9)
        put(transform.transform.translation, transform.transform.rotation, origin, turn, length)
        self._publishers[fixed].publish(self._kind(transforms=[transform]))

    def _hear(self, message: Any) -> None:
        for each in message.transforms:
            self.heard[each.child_frame_id] = self.told[to_nanoseconds(each.header.stamp)][each.child_frame_id] = each


class Follower:
    """A client of the action FollowJointTrajectory.

    Attributes:
        told: feedback of the last goal.
    """

    def __init__(self, client: Client) -> None:
        from control_msgs.action import FollowJointTrajectory
        from control_msgs.msg import JointTolerance

        self._client, self._kind, self._tolerance = client, FollowJointTrajectory, JointTolerance
        self.told: list[Any] = []
        self._action = client.action(FollowJointTrajectory, "follow_joint_trajectory")

    def send(self, *values: float | tuple[float, ...], names: str = "flexor", seconds: float = 1, **more: Any) -> Any:
        """Send a goal with a point every ``seconds``; return its handle.

        Each point has a value for each of ``names``, or one number for one name. Keywords set tolerances, and
        ``velocities`` the velocity of each joint at each point.
        """
        self.told.clear()
        joints, points = names.split(), []
        speed = {"velocities": [more.pop("velocities")] * len(joints)} if "velocities" in more else {}
        for place, value in enumerate(values, start=1):
            time = Duration(sec=int(seconds * place), nanosec=round(seconds * place % 1 * 1e9))
            points.append(JointTrajectoryPoint(positions=np.atleast_1d(value).tolist(), time_from_start=time, **speed))
        tolerances = {
            key: [self._tolerance(name=name, position=value) for name in joints] for key, value in more.items()
        }
        goal = self._kind.Goal(trajectory=JointTrajectory(joint_names=joints, points=points), **tolerances)
        sent = self._action.send_goal_async(goal, feedback_callback=lambda message: self.told.append(message.feedback))
        self._client.wait(sent.done)
        return sent.result()

    def result(self, goal: Any) -> tuple[int, int, str]:
        """Wait for the end of a goal; return status, error code and reason."""
        future = goal.get_result_async()
        self._client.wait(future.done)
        result = future.result().result
        return future.result().status, result.error_code, result.error_string


@pytest.fixture
def tree(client: Client, interfaces: Callable[[str], None]) -> Tree:
    """Give frames on /tf, whose messages are built before the node starts."""
    interfaces("tf2_msgs")
    return Tree(client)


@pytest.fixture
def build_interfaces() -> Callable[[Path, Path], str]:
    """Give a function that builds a package of messages in a folder, and returns its entry for ``PYTHONPATH``."""

    def build(definitions: Path, folder: Path) -> str:
        command = [sys.executable, DATA / "interfaces_builder.py", definitions, folder]
        return subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout.strip()

    return build


@pytest.fixture
def interfaces(
    pytestconfig: pytest.Config, monkeypatch: pytest.MonkeyPatch, build_interfaces: Callable
) -> Iterator[Callable[[str], None]]:
    """Give a function that makes a message package importable here and in nodes started afterwards."""
    made: list[str] = []

    def provide(package: str) -> None:
        if find_spec(package) is None:
            folder = Path(pytestconfig.cache.mkdir("interfaces"))
            place = build_interfaces(DATA / "interfaces" / package, folder)
            monkeypatch.syspath_prepend(place)
            monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, [place, os.environ.get("PYTHONPATH")])))
            made.append(package)

    yield provide
    # Other tests of this process must not take it for installed.
    for name in [name for name in sys.modules if name.partition(".")[0] in made]:
        del sys.modules[name]


@pytest.fixture
def client(ros: Any) -> Client:
    """Give a client that subscribes before any node starts."""
    return Client(ros)


@pytest.fixture
def start() -> Iterator[Callable[..., NodeProcess]]:
    """Give a function that starts ``sim_node`` with parameters; running nodes are ended after the test."""
    started: list[NodeProcess] = []

    def make(*, namespace: str = "/", **parameters: Any) -> NodeProcess:
        started.append(NodeProcess(parameters, namespace=namespace))
        return started[-1]

    yield make
    for process in started:
        process.stop()
        print(f"--- log of sim_node (exit status {process.status}) ---\n{process.log}")
        process.__exit__(None, None, None)


@pytest.fixture
def launch(client: Client, start: Callable[..., NodeProcess]) -> Callable[..., NodeProcess]:
    """Give a function that starts ``sim_node`` with parameters, and waits for its first step."""

    def make(**parameters: Any) -> NodeProcess:
        process = start(**parameters)
        client.wait(client.records)
        return process

    return make


@pytest.fixture
def falling_slab(launch: Callable[..., NodeProcess], slab: Path) -> NodeProcess:
    """Give the process of a node in lockstep with a slab and a rigid part, after the first step of 5 ms."""
    return launch(scene=str(slab), clock="lockstep", dt=0.005)


@pytest.fixture
def standard(client: Client, interfaces: Callable[[str], None]) -> Standard:
    """Give a client of the services of simulation_interfaces."""
    interfaces("simulation_interfaces")
    return Standard(client)


@pytest.fixture
def bodies(standard: Standard, falling_slab: NodeProcess) -> Standard:
    """Give a client of the services of a node with a falling slab, whose messages are built before the node starts."""
    return standard


@pytest.fixture
def coarse() -> dict[str, Any]:
    """Return parameters of a scene that is solved in a millisecond."""
    return dict(COARSE)


def vertices(cloud: PointCloud2) -> np.ndarray:
    """Return the six numbers (n, 6) of each point of a cloud."""
    return np.frombuffer(cloud.data, "<f4").reshape(-1, 6)


def to_nanoseconds(stamp: Time) -> int:
    """Return a stamp as an integer [ns]."""
    return stamp.sec * 10**9 + stamp.nanosec


def vector(value: Any) -> list[float]:
    """Return x, y and z of a message."""
    return [value.x, value.y, value.z]


def rotation(quaternion: Any) -> Rotation:
    """Return the rotation of a message's quaternion."""
    return Rotation.from_quat([*vector(quaternion), quaternion.w])


def put(
    position: Any, quaternion: Any, origin: Iterable[float], turn: Rotation | None = None, length: float = 1.0
) -> None:
    """Give the parts of a message a position and a rotation (none if ``turn`` is None), as a quaternion of a length."""
    position.x, position.y, position.z = map(float, origin)
    numbers = length * (turn or Rotation.identity()).as_quat()
    quaternion.x, quaternion.y, quaternion.z, quaternion.w = map(float, numbers)


def in_root(frames: Mapping[str, TransformStamped], frame: str) -> tuple[np.ndarray, np.ndarray]:
    """Return origin and axes of a frame in the frame that has no parent, along the parents."""
    origin, axes = np.zeros(3), np.eye(3)
    while frame in frames:
        found = frames[frame].transform
        own = rotation(found.rotation).as_matrix()
        origin, axes = vector(found.translation) + own @ origin, own @ axes
        frame = frames[frame].header.frame_id
    return origin, axes
