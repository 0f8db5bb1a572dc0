# SPDX-License-Identifier: Apache-2.0
"""ROS nodes of a test: they wait for the ``sim_node`` in another process, command it and call its services."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.srv import SetParameters
from rclpy.client import Client as ServiceClient
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String
from std_srvs.srv import Trigger

from gdfe_ros.errors import GdfeError
from gdfe_ros.node.interface.topics import DIAGNOSTICS, PROCESS, STEP_RECORD
from gdfe_ros.node.middleware.channel import namesakes
from gdfe_ros.node.middleware.process import LoneNode
from gdfe_ros.recording.step import StepRecord
from gdfe_ros.testing.node_process import NodeProcess

_LATCHED = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def await_discovery(
    node: Node, simulation: str, wait: Callable[[Callable[[], Any]], Any], *, process: int | None = None
) -> None:
    """Wait until a simulation has discovered every subscription and service client that ``node`` has so far.

    This is needed because a service counts as ready once requests reach it, but its response is lost if the server has
    not yet discovered the client. DDS announces the endpoints of a node in the order of their creation. This function
    makes a new subscription; once the subscription receives diagnostics, the simulation has therefore discovered all
    earlier endpoints.

    Args:
        node: node with the subscriptions and clients.
        simulation: full name of the simulation's node.
        wait: function that spins the node until its argument, a function, returns a true value.
        process: process id of the simulation, in case another node has its name; None: any process.
    """
    heard: list[DiagnosticArray] = []

    def hear(message: DiagnosticArray) -> None:
        values = _values_of(message, simulation)
        if values and (process is None or values.get(PROCESS) == str(process)):
            heard.append(message)

    subscription = node.create_subscription(DiagnosticArray, DIAGNOSTICS.name, hear, _LATCHED)
    wait(lambda: heard)
    node.destroy_subscription(subscription)


def _values_of(message: DiagnosticArray, simulation: str) -> dict[str, str]:
    """Return the values in the report of a simulation's node by key; empty if the message is another node's."""
    own = [status for status in message.status if status.name.startswith(f"{simulation.lstrip('/')}: ")]
    return {pair.key: pair.value for status in own for pair in status.values}


LONGEST_WAIT = 300.0
"""Longest duration of each wait, except for a step [s]. The very first start compiles kernels, which takes minutes on a
busy machine.
"""
_DISCOVERY = 1.5
"""Longest time until a running node is discovered, even on a busy machine [s]."""
STATE_QOS = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""QoS of subscriptions to the topics of each step; a late subscriber receives the last step."""


class Client(LoneNode):
    """ROS node in the namespace of the simulation's node; a context manager.

    Args:
        process: process of the simulation.
        name: full name of the simulation's node.
        label: name of this node.
        topics: dict from a topic, without the node's name, to its message type; `publish` uses these topics.
        triggers: services without the node's name; `trigger` calls these services.
        patience: longest duration of each wait [s].
        context: ROS context of the node; None: a new context.

    Attributes:
        node: the ROS node, for publishers and subscriptions.
        executor: executor of the node; it is spun during every wait.
        context: ROS context of the node.
    """

    def __init__(
        self,
        process: NodeProcess,
        name: str,
        label: str,
        *,
        topics: Mapping[str, type] = {},
        triggers: Iterable[str] = (),
        patience: float,
        context: Context | None = None,
    ) -> None:
        super().__init__(label, context=context, namespace=name.rpartition("/")[0])
        self._process, self._name, self._patience = process, name, patience
        self._born, node = time.monotonic(), self.node
        self._publishers = {key: node.create_publisher(kind, f"{name}/{key}", 1000) for key, kind in topics.items()}
        kinds = {"change_state": ChangeState, "set_parameters": SetParameters, **dict.fromkeys(triggers, Trigger)}
        self._services = {key: node.create_client(kind, f"{name}/{key}") for key, kind in kinds.items()}

    def wait(self, done: Callable[[], Any], what: str) -> None:
        """Spin the node until ``done`` returns a true value; ``what`` is the awaited thing in the text of an error.

        Raises:
            GdfeError: the simulation's process ended, the wait took too long, or another node has the simulation's
                name.
        """
        begin = time.monotonic()
        end, look = begin + self._patience, begin + _DISCOVERY
        while not done():
            if not self._process.running:
                raise GdfeError(f"the node ended:\n{self._process.log}")
            if time.monotonic() > end:
                raise GdfeError(f"waited {self._patience:g} s for {what} in vain:\n{self._process.log}")
            if time.monotonic() > look:
                self.look_for_doubles()
                look += _DISCOVERY
            self.executor.spin_once(timeout_sec=0.05)

    def meet(self, services: Sequence[ServiceClient] = ()) -> None:
        """Wait until the simulation offers its services and has discovered this node's subscriptions and clients."""
        for service in (*self._services.values(), *services):
            self.wait(service.service_is_ready, f"the service {service.srv_name}")
        await_discovery(self.node, self._name, partial(self.wait, what="diagnostics"))

    def require_alone(self) -> None:
        """Wait until the simulation has discovered this node, and check that no other node has the simulation's name.

        Raises:
            GdfeError: another node has the name; commands would reach both nodes.
        """
        waiting = partial(self.wait, what="diagnostics")
        await_discovery(self.node, self._name, waiting, process=self._process.pid)
        self.wait(lambda: time.monotonic() > self._born + _DISCOVERY, "other nodes")
        self.look_for_doubles()

    def look_for_doubles(self) -> None:
        """Raise a `GdfeError` if another node with the simulation's name has been discovered."""
        if namesakes(self.node, self._name) > 1:
            domain = self.context.get_domain_id()
            raise GdfeError(
                f"another node is called {self._name} in ROS domain {domain}, commands would reach both; "
                f"remedy: end it, or use another domain, e.g. ROS_DOMAIN_ID={domain + 1}"
            )

    def await_listeners(self) -> None:
        """Wait until the simulation subscribes to the topics that `publish` uses; earlier messages are lost."""
        for publisher in self._publishers.values():
            self.wait(publisher.get_subscription_count, f"a subscription of {publisher.topic_name}")

    def publish(self, messages: Mapping[str, Any]) -> None:
        """Publish messages, given as a dict from topic name to message."""
        for key, message in messages.items():
            self._publishers[key].publish(message)

    def trigger(self, service: str) -> None:
        """Call one of the services of type Trigger; raise ``GdfeError`` if it fails."""
        response = self.call(self._services[service], Trigger.Request())
        if not response.success:
            raise GdfeError(f"{service}: {response.message}")

    def call(self, service: ServiceClient, request: Any) -> Any:
        """Call a service and return its answer."""
        future = service.call_async(request)
        self.wait(future.done, f"an answer of {service.srv_name}")
        return future.result()

    def transition(self, label: str) -> None:
        """Request a lifecycle transition of the simulation's node, e.g. ``configure``.

        Raises:
            GdfeError: the transition failed.
        """
        request = ChangeState.Request()
        request.transition.label = label
        if not self.call(self._services["change_state"], request).success:
            raise GdfeError(f"the node could not {label}:\n{self._process.log}")


class NodeConnection(Client):
    """Connection to a node: publishes messages, calls services, and receives the number of each step.

    Args:
        process: process of the node.
        name: full name of the node.
        topics: dict from a topic's name, relative to the node's name, to its message type; `publish` uses these topics.
        patience: longest duration of each wait [s].

    Attributes:
        step: number of the last published step; -1 before the first.
    """

    def __init__(self, process: NodeProcess, name: str, topics: Mapping[str, type], *, patience: float) -> None:
        triggers, self.step = ("step", "reset", "load_state"), -1
        super().__init__(process, name, "gdfe_link", topics=topics, triggers=triggers, patience=patience)
        self.node.create_subscription(String, STEP_RECORD.name.replace("~", name), self._see, STATE_QOS)

    def wait_for_step(self, number: int) -> None:
        """Wait until step ``number`` or a later one is published."""
        self.wait(lambda: self.step >= number, f"step {number}")

    def set(self, **values: Any) -> None:
        """Set parameters of the node, given by name; raise ``GdfeError`` if the node rejects a value."""
        messages = [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
        request = SetParameters.Request(parameters=messages)
        for result in self.call(self._services["set_parameters"], request).results:
            if not result.successful:
                raise GdfeError(result.reason)

    def _see(self, message: String) -> None:
        self.step = StepRecord.from_json(message.data).step


_FOUND = 5.0
"""Longest time until a publisher of a running node is discovered, even on a busy machine [s]."""
_BLOCKED = 1.0
"""If more time [s] passes between two calls of `Deadlock.reason`, a callback was running: the wait is counted anew."""


class Deadlock:
    """Detects that the steps have ended because a command is missing.

    Args:
        node: node of the test, not of the controller; its own publishers do not count.
        simulation: full name of the simulation's node.
        inputs: full names of the topics for which each step waits; empty: a step begins with any command.
        controller: node whose commands are awaited.
        silence: longest time for which the simulation may wait for a command [s].
    """

    def __init__(self, node: Node, simulation: str, inputs: Sequence[str], controller: Node, *, silence: float) -> None:
        self._node, self._simulation, self._inputs = node, simulation, inputs
        self._controller, self._silence = controller, silence
        self._waits, self._idle, self._looked = "", 0.0, time.monotonic()
        self._subscription = node.create_subscription(DiagnosticArray, DIAGNOSTICS.name, self._read, 10)

    def progress(self) -> None:
        """Note that a step was made."""
        self._idle = 0.0

    def reason(self) -> str:
        """Return why there will be no further step; empty if there may be one. Called repeatedly during the wait."""
        now = time.monotonic()
        spent, self._looked = now - self._looked, now
        self._idle = self._idle + spent if self._waits and spent < _BLOCKED else 0.0
        if self._idle < _FOUND:
            return ""
        if missing := [topic for topic in self._inputs if not self._is_published(topic)]:
            own = sorted({publisher.topic_name for publisher in self._controller.publishers})
            return (
                f"each step waits for a message on {', '.join(missing)}, which no controller publishes; "
                f"{self._controller.get_name()} publishes {', '.join(own) or 'nothing'}; "
                "remedy: the name of the topic, or `inputs` with the topics of the controller"
            )
        if self._idle < self._silence:
            return ""
        return f"the simulation {self._waits} for {self._silence:g} s, and no controller has sent it"

    def close(self) -> None:
        """Destroy the subscription."""
        self._node.destroy_subscription(self._subscription)

    def _is_published(self, topic: str) -> bool:
        found = self._node.get_publishers_info_by_topic(topic)
        return any(each.node_name != self._node.get_name() for each in found)

    def _read(self, message: DiagnosticArray) -> None:
        """Store a text about the awaited command; it is empty during work on a step, and without lockstep."""
        if values := _values_of(message, self._simulation):
            waits = "waits for" in values and "working on" not in values
            self._waits = f"waits for {values['waits for']}" if waits else ""
