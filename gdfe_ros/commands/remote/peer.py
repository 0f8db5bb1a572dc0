# SPDX-License-Identifier: Apache-2.0
"""A short-lived ROS node for commands of the terminal; it finds types of topics and services in the ROS graph."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.duration import Duration
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo
from std_msgs.msg import String

from gdfe_ros.commands.remote.message_text import fill
from gdfe_ros.errors import GdfeError
from gdfe_ros.node.interface.topics import TF
from gdfe_ros.node.middleware.process import LoneNode
from gdfe_ros.node.middleware.ros_types import interface_class, is_installed
from gdfe_ros.untrusted.bounded_text import load_json_object, shorten
from gdfe_ros.untrusted.spelling import did_you_mean

LONGEST_SEARCH = 10.0
"""Longest wait until a topic or service is found, and until subscribers acknowledge a message [s]."""
SETTLING = 0.2
"""Longest time until a node has discovered a new subscription [s]."""
GREETING = 0.5
"""Time [s] within which a node publishes its present state to a new subscriber; a stored older state may come first."""
REFUSING = 0.5
"""Longest time [s] until a node refuses a command that it has received."""
UNCHANGED = 4.0
"""If the discovered graph lacks a name and has not changed for this time [s], the name is reported as missing."""
WHOLE = 1.0
"""If the discovered graph has not changed for this time [s], it is listed."""
FRAMES = ("/tf", "/tf_static")
"""Topics that the simulation publishes only if the messages of tf2_msgs are installed."""
_LONGEST = 300
"""Largest number of shown characters of a name of another node."""


class Peer(LoneNode):
    """A node that finds other nodes in the ROS graph, listens to their topics, and calls their services."""

    def __init__(self) -> None:
        super().__init__(f"gdfe_terminal_{os.getpid()}")
        self._domain, self._patience = self.context.get_domain_id(), LONGEST_SEARCH

    def publish(self, topic: str, values: object) -> tuple[int, list[str]]:
        """Publish one message; once each subscriber has received it, wait for refusals.

        Args:
            topic: name of the topic; the subscribers determine its type.
            values: fields of the message, as for `fill`.

        Returns:
            Number of subscribers, and the reasons of those that refused the message on their topic ``~/refused``.

        Raises:
            GdfeError: no node subscribes, a field is wrong, or a subscriber does not acknowledge.
        """
        topic = full_name(topic)
        others, kind = self._endpoints(topic, self.node.get_subscriptions_info_by_topic, "subscribes to")
        message, heard = fill(kind(), values), self._refusals(topic)
        publisher = self.node.create_publisher(kind, topic, matching_qos(others, offered=True))
        if not self._wait(lambda: publisher.get_subscription_count() >= len(others)):
            count = publisher.get_subscription_count()
            raise GdfeError(f"{topic}: only {count} of {len(others)} subscribers were connected")
        publisher.publish(message)
        if not publisher.wait_for_all_acked(Duration(seconds=self._patience)):
            raise GdfeError(f"{topic}: not every subscriber acknowledged the message within {self._patience:g} s")
        if heard is None:
            return len(others), []
        self._wait(lambda: heard, REFUSING)
        return len(others), heard

    def _refusals(self, topic: str) -> list[str] | None:
        """Return a list to which refusals of messages on a topic will be added; None if no subscriber reports them."""
        heard = list[str]()

        def reporting() -> list[str]:  # the names of the nodes are discovered after their subscriptions
            others = self.node.get_subscriptions_info_by_topic(topic)
            names = {f"{other.node_namespace.rstrip('/')}/{other.node_name}/refused" for other in others}
            return [name for name in names if self.node.count_publishers(name)]

        def hear(message: String) -> None:
            try:
                refusal = load_json_object(message.data)
            except ValueError as error:
                heard.append(f"unknown, because {error}")
                return
            if refusal.get("source") == topic:
                heard.append(str(refusal.get("message")))

        if not (names := self._wait(reporting, REFUSING)):
            return None
        for name in names:
            self.node.create_subscription(String, name, hear, QoSProfile(depth=100))
        self._wait(lambda: False, SETTLING)  # the nodes discover the subscription, too
        return heard

    def listen(self, topic: str, *, patience: float) -> Iterator[Any]:
        """Yield the latest message of a topic, and the following ones.

        Args:
            topic: name of the topic; the publishers determine its type.
            patience: longest wait for each message [s].

        Raises:
            GdfeError: no node publishes, or no message comes.
        """
        topic, received = full_name(topic), list[Any]()
        others, kind = self._endpoints(topic, self.node.get_publishers_info_by_topic, "publishes")
        self.node.create_subscription(kind, topic, received.append, matching_qos(others, offered=False))
        self._wait(lambda: received, patience)
        self._wait(lambda: False, GREETING)
        del received[:-1]  # a late subscriber receives the last ten, but the caller wants the latest only
        yield from self._drain(received, topic, patience)

    def _drain(self, received: list[Any], topic: str, patience: float) -> Iterator[Any]:
        """Yield each entry that a subscription appends to ``received``.

        Raises:
            GdfeError: no entry comes within ``patience`` [s].
        """
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
        client = self.node.create_client(kind, service)
        if not self._wait(client.service_is_ready):
            raise GdfeError(f"service {service} was not ready within {self._patience:g} s")
        future = client.call_async(request)
        if not self._wait(future.done, patience):
            raise GdfeError(f"no answer from {service} within {patience:g} s; remedy: a longer --wait")
        return future.result()

    def arrivals(self, topic: str, *, patience: float) -> Iterator[float]:
        """Yield the arrival time [s] of each message of a topic, without decoding the message.

        Args:
            topic: name of the topic; the publishers determine its type.
            patience: longest wait for each message [s].

        Raises:
            GdfeError: no node publishes, or no message comes.
        """
        topic, times = full_name(topic), list[float]()
        others, kind = self._endpoints(topic, self.node.get_publishers_info_by_topic, "publishes")
        qos = matching_qos(others, offered=False)
        qos.durability = DurabilityPolicy.VOLATILE  # stored messages arrive at once
        self.node.create_subscription(kind, topic, lambda _: times.append(time.monotonic()), qos, raw=True)
        yield from self._drain(times, topic, patience)

    def nodes(self) -> list[str]:
        """Return the full names of the other nodes, sorted; a name that two nodes have is listed twice.

        Raises:
            GdfeError: there is no other node.
        """

        def names() -> list[str]:
            found = self.node.get_node_names_and_namespaces()
            others = (f"{space.rstrip('/')}/{name}" for name, space in found if name != self.node.get_name())
            return sorted(shorten(name, _LONGEST) for name in others)

        return self._await_settled(names)

    def topics(self) -> list[tuple[str, str, int, int]]:
        """Return name, type, and numbers of publishers and subscriptions of each topic of other nodes, sorted by name.

        Several types of a topic are one text, separated by commas.

        Raises:
            GdfeError: no other node has a topic.
        """
        own = self.node.get_name()

        def others(endpoints: list[TopicEndpointInfo]) -> int:
            return sum(each.node_name != own for each in endpoints)

        def entries() -> list[tuple[str, str, int, int]]:
            look = self.node.get_publishers_info_by_topic, self.node.get_subscriptions_info_by_topic
            found = self.node.get_topic_names_and_types()
            rows = [(name, ", ".join(types), *(others(each(name)) for each in look)) for name, types in found]
            return sorted((*(shorten(text, _LONGEST) for text in row[:2]), *row[2:]) for row in rows if any(row[2:]))

        return self._await_settled(entries)

    def _await_settled(self, look: Callable[[], list[Any]]) -> list[Any]:
        """Return a list of the graph once it has been constant for `WHOLE`, or after `LONGEST_SEARCH` at the latest.

        Raises:
            GdfeError: there is no other node.
        """
        found = _Unchanged(look, WHOLE)
        self._wait(found.whole)
        known = found.last
        if not known:
            raise GdfeError(f"no other node was found in ROS domain {self._domain} within {self._patience:g} s")
        return known

    def _wait(self, done: Callable[[], Any], patience: float | None = None) -> Any:
        """Spin until ``done`` returns a true value, at most for ``patience`` [s]; return the last value of ``done``."""
        end = time.monotonic() + (self._patience if patience is None else patience)
        while not (found := done()) and time.monotonic() < end:
            self.executor.spin_once(timeout_sec=0.02)
        return found

    def _discover(self, look: Callable[[], Any], names: Callable[[], list[str]]) -> Any:
        """Wait for an entry of the ROS graph and return it; return an empty value if the discovered graph lacks it.

        Args:
            look: function that returns the entry, or an empty value until it is discovered.
            names: function that returns the discovered names of this kind that other nodes have.
        """
        found = _Unchanged(names, UNCHANGED)
        self._wait(lambda: look() or found.whole())  # names are many queries: only while the entry is missing
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
            own, topics = self.node.get_name(), self.node.get_topic_names_and_types()
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
            own = f"/{self.node.get_name()}/"
            return {name: of for name, of in self.node.get_service_names_and_types() if not name.startswith(own)}

        found = self._discover(lambda: kinds().get(service), lambda: sorted(kinds()))
        if not found:
            raise GdfeError(self._nobody(f"no node offers the service {service}", service, sorted(kinds()), "services"))
        return interface_class(found[0])

    def _nobody(self, text: str, given: str, names: Sequence[str], kind: str) -> str:
        if given in FRAMES and not is_installed(TF.type):
            text += ": the simulation publishes frames only with tf2_msgs, which ROS from Python wheels lacks"
        listed = ", ".join(shorten(name, _LONGEST) for name in names) or "none"
        return f"{text} in ROS domain {self._domain}; {did_you_mean(given, names)}{kind}: {listed}"


class _Unchanged:
    """A list of the ROS graph that counts as whole once it has not changed for some time.

    Args:
        look: function that returns the present list.
        span: time without a change [s].

    Attributes:
        last: the list when it was last read.
    """

    def __init__(self, look: Callable[[], list[Any]], span: float) -> None:
        self._look, self._span = look, span
        self.last, self._since = list[Any](), time.monotonic()

    def whole(self) -> bool:
        """Read the list again; return whether it has entries, and has not changed for ``span``."""
        if (now := self._look()) != self.last:
            self.last, self._since = now, time.monotonic()
        return bool(self.last) and time.monotonic() - self._since > self._span


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


def get_parameters(peer: Peer, node: str, names: Sequence[str], *, patience: float) -> list[Any]:
    """Return the values of a node's parameters; ``patience`` [s] is the longest wait."""
    found = peer.call(f"{node}/get_parameters", {"names": list(names)}, patience=patience).values
    return [_plain(parameter_value_to_python(value)) for value in found]


def set_parameter(peer: Peer, node: str, name: str, value: Any, *, patience: float) -> SetParametersResult:
    """Set a parameter of a node to a value of its type, and return the node's answer."""
    message = Parameter(name, value=value).to_parameter_msg()
    fields = {field: _plain(getattr(message.value, field)) for field in message.value.get_fields_and_field_types()}
    request = {"parameters": [{"name": name, "value": fields}]}
    (result,) = peer.call(f"{node}/set_parameters", request, patience=patience).results
    return result


def _plain(value: Any) -> Any:
    """Return a parameter's value with arrays as lists; None is a parameter without value."""
    return value if isinstance(value, (bool, int, float, str)) or value is None else list(value)
