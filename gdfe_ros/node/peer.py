# SPDX-License-Identifier: Apache-2.0
"""A short-lived ROS node for commands of the terminal; it finds types of topics and services in the ROS graph."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import rclpy
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.topic_endpoint_info import TopicEndpointInfo

from gdfe_ros.errors import GdfeError
from gdfe_ros.node.message_text import fill
from gdfe_ros.node.process import make_executor
from gdfe_ros.node.qos import interface_class
from gdfe_ros.spelling import did_you_mean

PATIENCE = 10.0
"""Longest wait until a topic or service is found, and until subscribers acknowledge a message [s]."""
SETTLING = 0.2
"""Longest time between the arrivals of the first and the last stored message of a topic [s]."""
UNCHANGED = 4.0
"""If the discovered graph lacks a name and has not changed for this time [s], the name is reported as missing."""


class Peer:
    """A node and its executor.

    Args:
        context: ROS context.
    """

    def __init__(self, context: rclpy.Context) -> None:
        self._node = rclpy.create_node(f"gdfe_terminal_{os.getpid()}", context=context)
        self._domain, self._patience = context.get_domain_id(), PATIENCE
        self._executor = make_executor(context)
        self._executor.add_node(self._node)

    def publish(self, topic: str, values: object) -> int:
        """Publish one message, and return the number of subscribers once each has received it.

        Args:
            topic: name of the topic; the subscribers determine its type.
            values: fields of the message, as for `fill`.

        Raises:
            GdfeError: no node subscribes, a field is wrong, or a subscriber does not acknowledge.
        """
        topic = full_name(topic)
        others, kind = self._endpoints(topic, self._node.get_subscriptions_info_by_topic, "subscribes to")
        message = fill(kind(), values)
        publisher = self._node.create_publisher(kind, topic, matching_qos(others, offered=True))
        if not self._wait(lambda: publisher.get_subscription_count() >= len(others)):
            count = publisher.get_subscription_count()
            raise GdfeError(f"{topic}: only {count} of {len(others)} subscribers were connected")
        publisher.publish(message)
        if not publisher.wait_for_all_acked(Duration(seconds=self._patience)):
            raise GdfeError(f"{topic}: not every subscriber acknowledged the message within {self._patience:g} s")
        return len(others)

    def listen(self, topic: str, *, patience: float) -> Iterator[Any]:
        """Yield the latest message of a topic, and the following ones.

        Args:
            topic: name of the topic; the publishers determine its type.
            patience: longest wait for each message [s].

        Raises:
            GdfeError: no node publishes, or no message comes.
        """
        topic, received = full_name(topic), list[Any]()
        others, kind = self._endpoints(topic, self._node.get_publishers_info_by_topic, "publishes")
        self._node.create_subscription(kind, topic, received.append, matching_qos(others, offered=False))
        self._wait(lambda: received, patience)
        self._wait(lambda: False, SETTLING)
        del received[:-1]  # a late subscriber receives the last ten, but the caller wants the latest only
        while self._wait(lambda: received, patience):
            yield received.pop(0)
        raise GdfeError(f"no message on {topic} within {patience:g} s")

    def call(self, service: str, values: object, *, patience: float) -> Any:
        """Call a service and return its response.

        Args:
            service: name of the service.
            values: fields of the request, as for `fill`.
            patience: longest wait for the response [s].

        Raises:
            GdfeError: no node offers the service, a field is wrong, or no response comes.
        """
        service = full_name(service)
        kind = self._service_class(service)
        request = fill(kind.Request(), values)
        client = self._node.create_client(kind, service)
        if not self._wait(client.service_is_ready):
            raise GdfeError(f"service {service} was not ready within {self._patience:g} s")
        future = client.call_async(request)
        if not self._wait(future.done, patience):
            raise GdfeError(f"no answer from {service} within {patience:g} s; remedy: a longer --wait")
        return future.result()

    def close(self) -> None:
        """Destroy the node."""
        self._executor.shutdown()
        self._node.destroy_node()

    def _wait(self, done: Callable[[], Any], patience: float | None = None) -> Any:
        """Spin until ``done`` returns a true value, at most for the patience [s]; return its last value."""
        end = time.monotonic() + (self._patience if patience is None else patience)
        while not (found := done()) and time.monotonic() < end:
            self._executor.spin_once(timeout_sec=0.02)
        return found

    def _discover(self, look: Callable[[], Any], names: Callable[[], list[str]]) -> Any:
        """Wait for an entry of the ROS graph and return it; return an empty value if the discovered graph lacks it.

        Args:
            look: function that returns the entry, or an empty value until it is discovered.
            names: function that returns the discovered names of this kind that other nodes have.
        """
        known, since = list[str](), time.monotonic()

        def found_or_lacking() -> bool:
            nonlocal known, since
            if look():
                return True
            if (now := names()) != known:  # many queries: only while the entry is missing
                known, since = now, time.monotonic()
            return bool(known) and time.monotonic() - since > UNCHANGED

        self._wait(found_or_lacking)
        return look()

    def _endpoints(self, topic: str, look: Callable[[str], list[TopicEndpointInfo]], whose: str) -> Any:
        """Return the publishers or subscriptions of a topic, and the class of its messages.

        Args:
            topic: full name of the topic.
            look: function that returns the endpoints of a topic in the graph.
            whose: verb for the text of the error, e.g. ``publishes``.

        Raises:
            GdfeError: there is no endpoint.
        """

        def names() -> list[str]:
            own, topics = self._node.get_name(), self._node.get_topic_names_and_types()
            return sorted(name for name, _ in topics if any(other.node_name != own for other in look(name)))

        found = self._discover(lambda: look(topic), names)
        if not found:
            raise GdfeError(self._nobody(f"no node {whose} {topic}", topic, names(), "topics"))
        return found, interface_class(found[0].topic_type)

    def _service_class(self, service: str) -> type[Any]:
        """Return the class of a service.

        Raises:
            GdfeError: no node offers it.
        """

        def kinds() -> dict[str, list[str]]:
            own = f"/{self._node.get_name()}/"
            return {name: of for name, of in self._node.get_service_names_and_types() if not name.startswith(own)}

        found = self._discover(lambda: kinds().get(service), lambda: sorted(kinds()))
        if not found:
            raise GdfeError(self._nobody(f"no node offers the service {service}", service, sorted(kinds()), "services"))
        return interface_class(found[0])

    def _nobody(self, text: str, given: str, names: Sequence[str], kind: str) -> str:
        listed = ", ".join(names) or "none"
        return f"{text} in ROS domain {self._domain}; {did_you_mean(given, names)}{kind}: {listed}"


@contextmanager
def open_peer() -> Iterator[Peer]:
    """Yield a peer in a ROS context of its own."""
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
    """Return a QoS profile, of a publisher if ``offered``, else of a subscription, compatible with all ``others``."""
    reliable = [other.qos_profile.reliability == ReliabilityPolicy.RELIABLE for other in others]
    kept = [other.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL for other in others]
    enough = any if offered else all
    return QoSProfile(
        depth=10,
        reliability=ReliabilityPolicy.RELIABLE if offered or enough(reliable) else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if enough(kept) else DurabilityPolicy.VOLATILE,
    )
