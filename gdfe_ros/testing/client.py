# SPDX-License-Identifier: Apache-2.0
"""A ROS node of a test, which waits for the ``sim_node`` in another process and calls its services."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from lifecycle_msgs.srv import ChangeState
from rclpy.client import Client as ServiceClient
from rclpy.context import Context
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions

from gdfe_ros.errors import GdfeError
from gdfe_ros.node.interface.topics import DIAGNOSTICS, PROCESS
from gdfe_ros.node.managed import EventlessNode
from gdfe_ros.node.process import make_executor
from gdfe_ros.node.strays import namesakes
from gdfe_ros.testing.process import NodeProcess

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
    wanted = f"{simulation.lstrip('/')}: "

    def hear(message: DiagnosticArray) -> None:
        own = [status for status in message.status if status.name.startswith(wanted)]
        numbers = {value.value for status in own for value in status.values if value.key == PROCESS}
        if own and (process is None or str(process) in numbers):
            heard.append(message)

    subscription = node.create_subscription(DiagnosticArray, DIAGNOSTICS.name, hear, _LATCHED)
    wait(lambda: heard)
    node.destroy_subscription(subscription)


PATIENCE = 300.0
"""Longest duration of each wait, except for a step [s]. The very first start compiles kernels, which takes minutes on a
busy machine.
"""
_DISCOVERY = 1.5
"""Longest time until a running node is discovered, even on a busy machine [s]."""
STATE_QOS = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""QoS of subscriptions to the topics of each step; a late subscriber receives the last step."""


class Client:
    """ROS node in the namespace of the simulation's node.

    Args:
        process: process of the simulation.
        name: full name of the simulation's node.
        label: name of this node.
        patience: longest duration of each wait [s].
        context: ROS context of the node; None: a new context.

    Attributes:
        node: the ROS node, for publishers and subscriptions.
        executor: executor of the node; it is spun during every wait.
    """

    def __init__(
        self, process: NodeProcess, name: str, label: str, *, patience: float, context: Context | None = None
    ) -> None:
        self._process, self._name, self._patience = process, name, patience
        self._context = context or Context()
        rclpy.init(context=self._context, signal_handler_options=SignalHandlerOptions.NO)
        self.node = EventlessNode(label, context=self._context, namespace=name.rpartition("/")[0])
        self._born = time.monotonic()
        self.executor = make_executor(self._context)
        self.executor.add_node(self.node)
        self._change = self.node.create_client(ChangeState, f"{name}/change_state")

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
        for service in (self._change, *services):
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
            domain = self._context.get_domain_id()
            raise GdfeError(
                f"another node is called {self._name} in ROS domain {domain}, commands would reach both; "
                f"remedy: end it, or use another domain, e.g. ROS_DOMAIN_ID={domain + 1}"
            )

    def await_listeners(self, publishers: Iterable[Publisher]) -> None:
        """Wait until the simulation subscribes to the topic of each publisher; earlier messages are lost."""
        for publisher in publishers:
            self.wait(publisher.get_subscription_count, f"a subscription of {publisher.topic_name}")

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
        if not self.call(self._change, request).success:
            raise GdfeError(f"the node could not {label}:\n{self._process.log}")

    def close(self) -> None:
        """Destroy the node and shut down its context."""
        self.executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown(context=self._context)
