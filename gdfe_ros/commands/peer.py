# SPDX-License-Identifier: Apache-2.0
"""A short-lived ROS node for the terminal, which finds the types of topics and services in the ROS graph."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.topic_endpoint_info import TopicEndpointInfo

from gdfe_ros.errors import GdfeError
from gdfe_ros.node.qos import interface_class
from gdfe_ros.spelling import did_you_mean

PATIENCE = 10.0
"""Time [s] within which a topic or service must be found, and a service must respond."""


class Peer:
    """A node and its executor.

    Args:
        context: of ROS.

    Attributes:
        node: of rclpy.
    """

    def __init__(self, context: rclpy.Context) -> None:
        self.node = rclpy.create_node(f"gdfe_terminal_{os.getpid()}", context=context)
        self._domain = context.get_domain_id()
        self._executor = SingleThreadedExecutor(context=context)
        self._executor.add_node(self.node)

    def wait(self, done: Callable[[], Any], patience: float = PATIENCE) -> Any:
        """Spin until ``done`` returns a true value or the patience [s] is over; return the last value."""
        end = time.monotonic() + patience
        while not (found := done()) and time.monotonic() < end:
            self._executor.spin_once(timeout_sec=0.02)
        return found

    def endpoints(self, topic: str, look: Callable[[str], list[TopicEndpointInfo]], whose: str) -> Any:
        """Return the publishers or subscriptions of a topic, and the class of its messages.

        Args:
            topic: its full name.
            look: returns the endpoints of a topic in the graph.
            whose: verb for the error, e.g. ``publishes``.

        Raises:
            GdfeError: there is no endpoint.
        """
        found = self.wait(lambda: look(topic))
        if not found:
            names = sorted(name for name, _ in self.node.get_topic_names_and_types() if look(name))
            raise GdfeError(self._nobody(f"no node {whose} {topic}", topic, names, "topics"))
        return found, interface_class(found[0].topic_type)

    def service_class(self, service: str) -> type[Any]:
        """Return the class of a service.

        Raises:
            GdfeError: no node offers it.
        """

        def kinds() -> dict[str, list[str]]:
            return dict(self.node.get_service_names_and_types())

        if not self.wait(lambda: service in kinds()):
            raise GdfeError(self._nobody(f"no node offers the service {service}", service, sorted(kinds()), "services"))
        return interface_class(kinds()[service][0])

    def close(self) -> None:
        """Destroy the node."""
        self._executor.shutdown()
        self.node.destroy_node()

    def _nobody(self, text: str, given: str, names: Sequence[str], kind: str) -> str:
        listed = ", ".join(name for name in names if not name.startswith("/gdfe_terminal")) or "none"
        return f"{text} in ROS domain {self._domain}; {did_you_mean(given, names)}{kind}: {listed}"


@contextmanager
def open_peer() -> Iterator[Peer]:
    """Yield a peer in a context of its own."""
    context = rclpy.Context()
    rclpy.init(context=context, signal_handler_options=SignalHandlerOptions.NO)
    peer = Peer(context)
    try:
        yield peer
    finally:
        peer.close()
        rclpy.shutdown(context=context)


def full_name(name: str) -> str:
    """Return a name with a leading slash, as in the graph."""
    return f"/{name.lstrip('/')}"


def matching_qos(others: Sequence[TopicEndpointInfo], *, offered: bool) -> QoSProfile:
    """Return a profile that matches all others: a publisher's if ``offered``, else a subscription's."""
    reliable = [other.qos_profile.reliability == ReliabilityPolicy.RELIABLE for other in others]
    kept = [other.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL for other in others]
    enough = any if offered else all
    return QoSProfile(
        depth=10,
        reliability=ReliabilityPolicy.RELIABLE if offered or enough(reliable) else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if enough(kept) else DurabilityPolicy.VOLATILE,
    )
