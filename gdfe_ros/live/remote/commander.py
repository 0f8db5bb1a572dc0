# SPDX-License-Identifier: Apache-2.0
"""Orders to a node over its topics, and requests to its services."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Future
from typing import Any

from geometry_msgs.msg import Point, PoseStamped, Quaternion
from geometry_msgs.msg import Pose as PoseMessage
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool, Trigger

from gdfe_ros.errors import GdfeError
from gdfe_ros.live.interface import Ability
from gdfe_ros.node.interface import services, topics
from gdfe_ros.node.interface.parameters import MODULUS
from gdfe_ros.node.interface.scene_topics import is_commanded, put_key, target_key
from gdfe_ros.node.messages import actuation
from gdfe_ros.node.orders import ActuatorOrder, Order, PoseOrder, TeleportOrder, require_order
from gdfe_ros.node.qos import interface_class, qos_profile
from gdfe_ros.scene.scene import Scene

SERVICES = {
    Ability.PAUSE: services.PAUSE,
    Ability.STEP: services.STEP,
    Ability.RESET: services.RESET,
    Ability.RECORD: services.RECORD,
}
"""Dict from request to the node's service."""


class Commander:
    """Sends orders and requests to the node of a simulation; callable from any thread.

    Args:
        node: node that publishes messages and calls services.
        name: full name of the simulation's node.
        scene: scene of the simulation.
    """

    def __init__(self, node: Node, name: str, scene: Scene) -> None:
        self._name, self._scene = name, scene
        self._actuators = {actuator.name: actuator for actuator in scene.actuators}
        profile = qos_profile(topics.ACTUATION.delivery)
        self._actuation = node.create_publisher(JointState, f"{name}/{topics.ACTUATION.key()}", profile)
        self._targets = {
            handle.name: node.create_publisher(PoseStamped, f"{name}/{target_key(handle)}", profile)
            for handle in scene.handles
            if is_commanded(handle)
        } | {
            body.name: node.create_publisher(PoseStamped, f"{name}/{put_key(body)}", profile)
            for body in scene.rigid_bodies
        }
        self._parameters = AsyncParameterClient(node, name)
        self._clients = {
            ability: node.create_client(interface_class(spec.type), spec.name.replace("~", name))
            for ability, spec in SERVICES.items()
        }

    def require(self, name: str, order: Order) -> None:
        """Check an order of ``name`` without sending it.

        Raises:
            GdfeError: a number is not finite, or a target is too far from rest.
        """
        require_order(name, order, self._scene.mesh.size)

    def send(self, name: str, order: Order) -> None:
        """Publish an order of ``name``.

        Raises:
            GdfeError: a number is not finite, a target is too far from rest, or the kind of order is not supported.
        """
        self.require(name, order)
        if isinstance(order, (PoseOrder, TeleportOrder)):
            position = Point(**dict(zip("xyz", order.translation, strict=True)))
            pose = PoseMessage(
                position=position, orientation=Quaternion(**dict(zip("xyzw", order.quaternion, strict=True)))
            )
            self._targets[name].publish(PoseStamped(pose=pose))
        elif isinstance(order, ActuatorOrder):
            self._actuation.publish(actuation(self._actuators, order.values))
        else:
            raise GdfeError(f"a page sends poses and values, not {type(order).__name__}")

    def set_moduli(self, moduli: Mapping[str, float]) -> Future[str]:
        """Set Young's moduli [Pa] by material, which are parameters of the node; the node sets either all or none.

        The returned ``Future`` has an empty text, because the body shows the effect. It raises a GdfeError if the node
        refuses.

        Raises:
            GdfeError: the node does not answer at present.
        """
        if not self._parameters.services_are_ready():
            raise GdfeError(f"the parameters of {self._name} are not available; is the node running?")
        answer: Future[str] = Future()

        def hear(done: Any) -> None:
            result = done.result().result
            if result.successful:
                answer.set_result("")
            else:
                answer.set_exception(GdfeError(f"{self._name}: {result.reason}"))

        values = [Parameter(MODULUS.name.format(material=name), value=float(young)) for name, young in moduli.items()]
        self._parameters.set_parameters_atomically(values).add_done_callback(hear)
        return answer

    def call(self, ability: Ability, *, on: bool = False) -> Future[str]:
        """Call the service of a request; return a ``Future`` of the answer. ``on`` is the data of a SetBool request.

        The answer is the node's message about a bag, or an empty text for other services, whose effect is visible. It
        raises a GdfeError if the node refuses.

        Raises:
            GdfeError: the node does not offer the service at present.
        """
        client = self._clients[ability]
        if not client.service_is_ready():
            raise GdfeError(f"{client.srv_name} is not available; is the node {self._name} running?")
        request = SetBool.Request(data=on) if client.srv_type is SetBool else Trigger.Request()
        answer: Future[str] = Future()

        def hear(done: Any) -> None:
            response = done.result()
            if response.success:
                answer.set_result(response.message if ability is Ability.RECORD else "")
            else:
                answer.set_exception(GdfeError(f"{client.srv_name}: {response.message}"))

        client.call_async(request).add_done_callback(hear)
        return answer
