# SPDX-License-Identifier: Apache-2.0
"""Client of one ``sim_node`` process; it publishes messages, calls services and receives the number of each step."""

from __future__ import annotations

from collections.abc import Mapping
from types import TracebackType
from typing import Any

from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from std_msgs.msg import String
from std_srvs.srv import Trigger

from gdfe_ros.errors import GdfeError
from gdfe_ros.node.interface.topics import STEP_RECORD
from gdfe_ros.recording.step_record import StepRecord
from gdfe_ros.testing.client import STATE_QOS, Client
from gdfe_ros.testing.process import NodeProcess

_TRIGGERS = ("step", "reset", "load_state")


class NodeConnection:
    """Connection to a node; a context manager.

    Args:
        process: process of the node.
        name: full name of the node.
        topics: dict from a topic's name, relative to the node's name, to its message type; `publish` uses these topics.
        patience: longest duration of each wait [s].

    Attributes:
        step: number of the last published step; -1 before the first.
    """

    def __init__(self, process: NodeProcess, name: str, topics: Mapping[str, type], *, patience: float) -> None:
        self.step = -1
        self._client = Client(process, name, "gdfe_link", patience=patience)
        self.wait, self.transition = self._client.wait, self._client.transition
        self.require_alone, self.look_for_doubles = self._client.require_alone, self._client.look_for_doubles
        node = self._client.node
        self._publishers = {key: node.create_publisher(kind, f"{name}/{key}", 1000) for key, kind in topics.items()}
        services = {"set_parameters": SetParameters, **dict.fromkeys(_TRIGGERS, Trigger)}
        self._services = {key: node.create_client(kind, f"{name}/{key}") for key, kind in services.items()}
        node.create_subscription(String, STEP_RECORD.name.replace("~", name), self._see, STATE_QOS)

    def wait_for_services(self) -> None:
        """Wait until the node offers its services and has discovered this client."""
        self._client.meet(list(self._services.values()))

    def wait_for_listener(self) -> None:
        """Wait until the node subscribes to every topic of ``topics``."""
        self._client.await_listeners(self._publishers.values())

    def wait_for_step(self, number: int) -> None:
        """Wait until step ``number`` or a later one is published."""
        self.wait(lambda: self.step >= number, f"step {number}")

    def publish(self, messages: Mapping[str, Any]) -> None:
        """Publish messages, given as a dict from topic name to message."""
        for key, message in messages.items():
            self._publishers[key].publish(message)

    def set(self, **values: Any) -> None:
        """Set parameters of the node, given by name; raise ``GdfeError`` if the node rejects a value."""
        messages = [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
        request = SetParameters.Request(parameters=messages)
        for result in self._client.call(self._services["set_parameters"], request).results:
            if not result.successful:
                raise GdfeError(result.reason)

    def trigger(self, service: str) -> None:
        """Call the service ``step``, ``reset`` or ``load_state``; raise ``GdfeError`` if it fails."""
        response = self._client.call(self._services[service], Trigger.Request())
        if not response.success:
            raise GdfeError(f"{service}: {response.message}")

    def _see(self, message: String) -> None:
        self.step = StepRecord.from_json(message.data).step

    def __enter__(self) -> NodeConnection:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._client.close()
