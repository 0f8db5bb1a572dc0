# SPDX-License-Identifier: Apache-2.0
"""Commands of a page to a node over topics, services and parameters, and the program that the page plays."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Future
from time import monotonic
from typing import Any

from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool, Trigger

from gdfe_ros.errors import GdfeError
from gdfe_ros.live.interface import Ability
from gdfe_ros.live.session import Programme
from gdfe_ros.node import interface
from gdfe_ros.node.driving.orders import ActuatorOrder, Order, PlaceOrder, require_order
from gdfe_ros.node.interface import MODULUS, topics
from gdfe_ros.node.interface.topics import is_commanded, pose_key
from gdfe_ros.node.messages import actuation, pose_message
from gdfe_ros.node.middleware.ros_types import interface_class, qos_profile
from gdfe_ros.recording.step import Begin, StepRecord
from gdfe_ros.scene.scene import Scene

SERVICES = {
    Ability.PAUSE: interface.PAUSE,
    Ability.STEP: interface.STEP,
    Ability.RESET: interface.RESET,
    Ability.RECORD: interface.RECORD,
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
        self._name, self._size = name, scene.mesh.size
        self._actuators = {actuator.name: actuator for actuator in scene.actuators}
        profile = qos_profile(topics.ACTUATION.delivery)
        self._actuation = node.create_publisher(JointState, f"{name}/{topics.ACTUATION.key()}", profile)
        self._targets = {
            handle.name: node.create_publisher(PoseStamped, f"{name}/{pose_key(handle)}", profile)
            for handle in scene.handles
            if is_commanded(handle) or handle.section == "bodies"
        }
        self._parameters = AsyncParameterClient(node, name)
        self._clients = {
            ability: node.create_client(interface_class(spec.type), spec.name.replace("~", name))
            for ability, spec in SERVICES.items()
        }

    def send(self, name: str, order: Order) -> None:
        """Publish an order for a handle or body ``name``, or for the actuators, loads and joints in the order.

        Raises:
            GdfeError: a number is not finite, a target is too far from rest, or the kind of order is not supported.
        """
        require_order(name, order, self._size)
        if isinstance(order, PlaceOrder):
            self._targets[name].publish(PoseStamped(pose=pose_message(order.translation, order.quaternion)))
        elif isinstance(order, ActuatorOrder):
            self._actuation.publish(actuation(self._actuators, order.values))
        else:
            raise GdfeError(f"a page sends poses and values, not {type(order).__name__}")

    def set_moduli(self, moduli: Mapping[str, float]) -> Future[str]:
        """Set parameters of the node: Young's moduli [Pa] by material. The node sets either all or none.

        The returned ``Future`` has an empty text, because the body shows the effect. It raises a GdfeError if the node
        refuses.

        Raises:
            GdfeError: the node does not answer at present.
        """
        if not self._parameters.services_are_ready():
            raise GdfeError(f"the parameters of {self._name} are not available; is the node running?")

        def read(response: Any) -> str:
            if not response.result.successful:
                raise GdfeError(f"{self._name}: {response.result.reason}")
            return ""

        values = [Parameter(MODULUS.name.format(material=name), value=float(young)) for name, young in moduli.items()]
        return _answer(self._parameters.set_parameters_atomically(values), read)

    def call(self, ability: Ability, *, on: bool = False) -> Future[str]:
        """Call the service of a request; return a ``Future`` of the answer. ``on`` is the data of a SetBool request.

        The answer is the node's message about a bag, or an empty text for other services, because the page shows their
        effects. It raises a GdfeError if the node refuses.

        Raises:
            GdfeError: the node does not offer the service at present.
        """
        client = self._clients[ability]
        if not client.service_is_ready():
            raise GdfeError(f"{client.srv_name} is not available; is the node {self._name} running?")
        request = SetBool.Request(data=on) if client.srv_type is SetBool else Trigger.Request()

        def read(response: Any) -> str:
            if not response.success:
                raise GdfeError(f"{client.srv_name}: {response.message}")
            return response.message if ability is Ability.RECORD else ""

        return _answer(client.call_async(request), read)


def _answer(pending: Any, read: Callable[[Any], str]) -> Future[str]:
    """Return a ``Future`` of the text that ``read`` returns for the response to a request."""
    answer: Future[str] = Future()

    def hear(done: Any) -> None:
        try:
            answer.set_result(read(done.result()))
        except GdfeError as error:
            answer.set_exception(error)

    pending.add_done_callback(hear)
    return answer


LOST = 1.0
"""The player repeats its orders after this wall time without a step [s]. Without this, a lost order or step record
would stop a node that waits for commands.
"""


class Player:
    """Plays the program of a scene; the program begins at the first step that is received after `play`.

    Args:
        scene: scene with the program.
        send: function that publishes an order, given a name and the order.
    """

    def __init__(self, scene: Scene, send: Callable[[str, Order], None]) -> None:
        self._scene, self._send = scene, send
        self._programme: Programme | None = None
        self._time = self._next = 0.0
        self._begun, self._given = False, 0.0

    @property
    def text(self) -> str:
        """Text with the progress of the program; empty while no program is played."""
        programme = self._programme
        return "" if programme is None else programme.progress(self._time)

    def play(self) -> None:
        """Play the program from its beginning. The first orders are sent at once; a waiting node then makes a step."""
        self._begun, programme = False, Programme(self._scene.program, self._time)
        self._programme = programme
        self._give(programme, self._time)

    def stop(self) -> None:
        """Stop the program."""
        self._programme = None

    def leave(self, names: Iterable[str]) -> None:
        """Stop commanding the named handles, actuators, loads and joints, because a viewer commands them now."""
        if self._programme is not None:
            self._programme.leave(names)

    def follow(self, record: StepRecord) -> None:
        """Receive the record of a step, and send the orders for the next step."""
        back, self._time = record.begin is not Begin.LAST, record.time
        programme = self._programme
        if programme is None:
            return
        if not self._begun:
            # Simulation time may have stood still, or jumped, until this step.
            self._begun, programme.start = True, record.time
            self._give(programme, record.time)
        elif back:
            self._programme = None
        elif programme.over(record.time):
            if not programme.over(self._next):  # unreceived steps may have passed the end
                self._give(programme, record.time)
            self._programme = None
        else:
            self._give(programme, record.time + record.dt)

    def remind(self) -> None:
        """Repeat the last orders if no step has followed within `LOST`."""
        programme = self._programme
        if programme is not None and monotonic() - self._given > LOST:
            self._give(programme, self._next)

    def _give(self, programme: Programme, time: float) -> None:
        self._next, self._given = time, monotonic()
        programme.give(time, self._send)
