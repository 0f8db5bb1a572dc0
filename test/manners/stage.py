# SPDX-License-Identifier: Apache-2.0
"""A ``sim_node`` in a process of its own, and a node beside it. Nothing is imported from gdfe_ros."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from lifecycle_msgs.srv import ChangeState, GetState
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile

COARSE = ("-p", "scene:=bend5", "-p", "scene_overrides:=['mesh.bar.cells=[20, 2, 2]']")
LATCHED = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
_PATIENCE = 120.0
_DEFINITIONS = Path(__file__).parents[1] / "data" / "interfaces"
_BUILT = Path(__file__).parents[2] / "runs" / "interfaces"
_BUILDER = _DEFINITIONS.with_name("interfaces_builder.py")


def provide(package: str) -> None:
    """Make a package of messages importable, here and in processes that are started; it is built where it is missing.

    A process of its own builds it: this one imports nothing of gdfe_ros.
    """
    if find_spec(package) is not None:
        return
    command = [sys.executable, str(_BUILDER), str(_DEFINITIONS / package), str(_BUILT)]
    place = subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    sys.path.insert(0, place)
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [place, os.environ.get("PYTHONPATH")]))


class Stage:
    """One or more nodes and a listener; a context manager that ends them.

    Args:
        arguments: ROS arguments of each process; without any, one of a coarse scene.
        name: full name of the node that is asked.

    Attributes:
        node: of the listener.
        values: of the node's last diagnostics.
    """

    def __init__(self, *arguments: Sequence[str], name: str = "/gdfe_sim") -> None:
        self._folder, self._name = TemporaryDirectory(prefix="manners_"), name
        self._context = rclpy.Context()
        rclpy.init(context=self._context)
        self.node = rclpy.create_node("manners", context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self.values: dict[str, str] = {}
        self._reports = 0
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self._read, LATCHED)
        self._log = Path(self._folder.name) / "log.txt"
        self._clients: dict[str, Any] = {}
        self._publishers: dict[str, Any] = {}
        self._actions: list[ActionClient] = []
        with self._log.open("wb") as log:
            self._processes = [
                subprocess.Popen(
                    [sys.executable, "-m", "gdfe_ros.node", "--ros-args", *COARSE, *given], stdout=log, stderr=log
                )
                for given in arguments or [()]
            ]

    @property
    def log(self) -> str:
        """Everything that the processes have printed."""
        return self._log.read_text(encoding="utf-8", errors="replace")

    @property
    def alive(self) -> bool:
        """Whether every process runs."""
        return all(process.poll() is None for process in self._processes)

    @property
    def pid(self) -> int:
        """Number of the first process."""
        return self._processes[0].pid

    def wait(self, done: Callable[[], Any], seconds: float = _PATIENCE) -> bool:
        """Spin until ``done`` gives something true, and tell whether it did in time."""
        end = time.monotonic() + seconds
        while not done():
            if time.monotonic() > end:
                return False
            self._executor.spin_once(timeout_sec=0.05)
        return True

    def await_report(self) -> dict[str, str]:
        """Wait for diagnostics that were made after the call."""
        count = self._reports + 2
        self.wait(lambda: self._reports >= count)
        return self.values

    def call(self, kind: type, service: str, request: Any = None) -> Any:
        """Call a service of the node; None where no answer comes."""
        future = self.begin(kind, service, request)
        self.wait(future.done, 20.0)
        return future.result() if future.done() else None

    def begin(self, kind: type, service: str, request: Any = None) -> Any:
        """Call a service of the node and return the future answer."""
        if service not in self._clients:
            client = self._clients[service] = self.node.create_client(kind, f"{self._name}/{service}")
            self.wait(client.service_is_ready)
            self.await_report()  # by then the node knows this client, too
        return self._clients[service].call_async(request or kind.Request())

    def transition(self, number: int) -> str:
        """Ask for a transition by its number."""
        request = ChangeState.Request()
        request.transition.id = number
        response = self.call(ChangeState, "change_state", request)
        return "no answer" if response is None else str(response.success).lower()

    def state(self) -> str:
        """Ask for the state of the lifecycle."""
        response = self.call(GetState, "get_state")
        return "no answer" if response is None else response.current_state.label

    def publish(self, topic: str, message: Any) -> None:
        """Publish on a topic of the node once it listens."""
        if topic not in self._publishers:
            publisher = self._publishers[topic] = self.node.create_publisher(
                type(message), f"{self._name}/{topic}", 100
            )
            self.wait(publisher.get_subscription_count)
        self._publishers[topic].publish(message)

    def listen(self, topic: str, kind: type, qos: Any = LATCHED) -> list[Any]:
        """Begin to listen to a full topic name; the list fills by and by."""
        got: list[Any] = []
        self.node.create_subscription(kind, topic, got.append, qos)
        return got

    def goal(self, kind: type, action: str, goal: Any) -> Any:
        """Send a goal to an action of the node, and return its handle."""
        client = ActionClient(self.node, kind, f"{self._name}/{action}")
        self.wait(client.server_is_ready)
        self.await_report()
        sent = client.send_goal_async(goal)
        self.wait(sent.done)
        self._actions.append(client)
        return sent.result()

    def intrude(self, topic: str, message: Any) -> None:
        """Publish a message of another type on a topic, from a participant of its own: one alone has one type each."""
        context = rclpy.Context()
        rclpy.init(context=context)
        node = rclpy.create_node("intruder", context=context)
        publisher = node.create_publisher(type(message), topic, 10)
        self.wait(lambda: len(self.node.get_publishers_info_by_topic(topic)) >= 1, 10.0)
        publisher.publish(message)
        node.destroy_node()
        rclpy.shutdown(context=context)

    def end(self) -> str:
        """End the processes as a terminal does, and give their exit statuses."""
        for process in self._processes:
            process.send_signal(signal.SIGINT)
        return ", ".join(str(process.wait(_PATIENCE)) for process in self._processes)

    def __enter__(self) -> Stage:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.end()
        if kind is not None:
            print(self.log, file=sys.stderr)
        for action in self._actions:
            action.destroy()
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown(context=self._context)
        self._folder.cleanup()

    def _read(self, message: DiagnosticArray) -> None:
        if message.status[0].name.startswith(f"{self._name.lstrip('/')}: "):
            self.values = {value.key: value.value for status in message.status for value in status.values}
            self._reports += 1
