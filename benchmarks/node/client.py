# SPDX-License-Identifier: Apache-2.0
"""The client process of a measurement: it commands the tip of a bar and receives the node's messages as bytes."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import cached_property
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import serialize_message
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import Header
from std_srvs.srv import SetBool

from gdfe_ros.constraints import Pose
from gdfe_ros.node.interface import NODE_NAME, TopicSpec
from gdfe_ros.node.interface.topics import DIAGNOSTICS, TARGET
from gdfe_ros.node.messages import pose_stamped
from gdfe_ros.node.middleware.process import make_executor
from gdfe_ros.node.middleware.ros_types import interface_class
from gdfe_ros.testing.client import LONGEST_WAIT

CELLS = {500: (20, 5, 5), 1250: (50, 5, 5), 10_000: (100, 10, 10)}
"""Dict from number of elements of the bar of ``bend5`` to its cells along x, y, z."""
RISE = 1e-3
"""Displacement of the tip with each command [m]: 0.2 m in 200 steps, as in the streams of docs/benchmark.md."""
HIGHEST = 200
"""Number of commands from the lowest to the highest position of the tip."""

_COMPILATION = 1800.0
"""Longest wait for a node [s]; the first one of another commit compiles all its kernels, beside other work."""


class Client:
    """A subscriber of the given topics of a node; a context manager.

    Args:
        topics: topics to receive.
        keep: topics whose messages are kept.

    Attributes:
        counts: dict from topic, without the node's name, to the number of received messages.
        kept: dict from topic to the bytes of its messages, for the topics in ``keep``.
        values: values of the last diagnostics.
        stamp: stamp of the last diagnostics [ns]; their values were read after this time.
    """

    def __init__(self, *topics: TopicSpec, keep: tuple[TopicSpec, ...] = ()) -> None:
        self._context = rclpy.Context()
        rclpy.init(context=self._context, signal_handler_options=SignalHandlerOptions.NO)
        self._node = rclpy.create_node("bench", context=self._context)
        self._executor = make_executor(self._context)
        self._executor.add_node(self._node)
        self.counts = dict.fromkeys((spec.name for spec in topics), 0)
        self.kept: dict[str, list[bytes]] = {spec.name: [] for spec in keep}
        self.values: dict[str, str] = {}
        self.stamp = 0
        state = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        for spec in topics:
            topic = spec.name.replace("~", f"/{NODE_NAME}")
            callback = self._counter(spec.name)
            self._node.create_subscription(interface_class(spec.type), topic, callback, state, raw=True)
        self._node.create_subscription(DiagnosticArray, DIAGNOSTICS.name, self._diagnose, 10)

    def wait(self, done: Callable[[], Any], *, seconds: float = LONGEST_WAIT) -> None:
        """Spin until ``done`` returns a true value.

        Raises:
            TimeoutError: this takes more than ``seconds``.
        """
        end = time.monotonic() + seconds
        while not done():
            if time.monotonic() > end:
                raise TimeoutError(f"waited {seconds:g} s in vain; last diagnostics {self.values}")
            self._executor.spin_once(timeout_sec=0.1)

    def poll(self, seconds: float) -> None:
        """Process incoming messages for some ``seconds``."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0.0:
            self._executor.spin_once(timeout_sec=left)

    @cached_property
    def _target(self) -> Any:
        topic = TARGET.name.removeprefix("~/").format(handle="tip")
        return self.publisher(topic, interface_class(TARGET.type))

    def publisher(self, topic: str, kind: type) -> Any:
        """Return a publisher of a command topic, which is named without the node's name."""
        return self._node.create_publisher(kind, f"/{NODE_NAME}/{topic}", 1000)

    def wait_for_node(self) -> None:
        """Wait until the node is active, subscribes to the tip's target, and has published on every topic."""
        ready = lambda: self.values.get("state") == "active" and self._target.get_subscription_count()  # noqa: E731
        self.wait(ready, seconds=_COMPILATION)
        self.wait(lambda: all(self.counts.values()))

    def pause(self) -> None:
        """Pause the node, and wait until its diagnostics report the pause."""
        service = self._node.create_client(SetBool, f"/{NODE_NAME}/pause")
        self.wait(service.service_is_ready)
        while self.values.get("clock") != "paused":  # asked again: an answer may be lost before both know each other
            service.call_async(SetBool.Request(data=True))
            self.next_diagnostics()
        self._node.destroy_client(service)

    def command(self, number: int) -> None:
        """Send the command of a step."""
        self._target.publish(target(number))

    def next_diagnostics(self) -> dict[str, str]:
        """Wait for diagnostics whose stamp is after the call, and return their values.

        The next diagnostics to arrive may be older, because they were in a queue or had to be sent again.
        """
        called = time.time_ns()
        self.wait(lambda: self.stamp > called)
        return self.values

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: object) -> None:
        self._executor.shutdown()
        self._node.destroy_node()
        rclpy.shutdown(context=self._context)

    def _counter(self, name: str) -> Callable[[bytes], None]:
        keep = self.kept.get(name)

        def count(data: bytes) -> None:
            self.counts[name] += 1
            if keep is not None:
                keep.append(data)

        return count

    def _diagnose(self, message: DiagnosticArray) -> None:
        self.values = {value.key: value.value for status in message.status for value in status.values}
        self.stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


def bar(elements: int) -> dict[str, list[str]]:
    """Return the parameters of a node with a bar of some number of ``elements``."""
    return {"scene_overrides": [f"mesh.bar.cells={list(CELLS[elements])}"]}


def height(number: int) -> float:
    """Return the height of the tip [m] in step ``number``; it increases and decreases periodically."""
    return RISE * (HIGHEST - abs(number % (2 * HIGHEST) - HIGHEST))


def target(number: int) -> bytes:
    """Return the serialised command of step ``number``."""
    return serialize_message(pose_stamped(Header(), Pose((0.0, 0.0, height(number)))))
