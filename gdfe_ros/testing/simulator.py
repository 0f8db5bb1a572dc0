# SPDX-License-Identifier: Apache-2.0
"""A node in lockstep in another process, commanded step by step from a test."""

from __future__ import annotations

import itertools
import json
import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from geometry_msgs.msg import PoseStamped
from numpy.typing import NDArray
from rclpy.node import Node
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, Header, String

from gdfe_ros.actuators.load import LOAD_FACTOR
from gdfe_ros.command import Orders
from gdfe_ros.constraints import Pose, nearest_turn
from gdfe_ros.errors import CommandError, GdfeError, OverlapError
from gdfe_ros.node.driving.orders import PoseOrder
from gdfe_ros.node.interface import COMPUTE_JACOBIAN, NODE_NAME, RESET_COMMANDS, STEP
from gdfe_ros.node.interface.topics import JACOBIAN, REFUSED, is_commanded, pose_key, state_topics
from gdfe_ros.node.messages import actuation, pose_stamped
from gdfe_ros.node.middleware.ros_types import interface_class, subscribe
from gdfe_ros.node.refusals import Reason
from gdfe_ros.recording.step import Begin
from gdfe_ros.scene.building.arms import joint_starts
from gdfe_ros.scene.loader import load_scene
from gdfe_ros.scene.override import override_words
from gdfe_ros.simulation import Command
from gdfe_ros.testing.client import LONGEST_WAIT, STATE_QOS, Client, Deadlock
from gdfe_ros.testing.consumed import ACTUATION
from gdfe_ros.testing.node_process import NodeProcess
from gdfe_ros.testing.published_state import PublishedState, StepMessages, unpack

_numbers = itertools.count()


class Simulator:
    """Runs a node in a process of its own and commands it in lockstep; a context manager.

    Args:
        scene: name of a scene, or path of a scene file.
        overrides: dict from dotted key to the value that replaces the scene's, e.g. ``{"mesh.bar.cells": [20, 2, 2]}``.
        parameters: parameters of the node; they store precedence over the values that this class sets.
        inputs: command topics, relative to the node's name; each step consumes one message of each topic. None: all
            targets and ``actuation``, which `step` and `run` need. For a controller that is a ROS node, give the topics
            that it publishes.
        bag: directory of a bag to record; None: no bag.
        patience: longest duration of each wait [s]. The very first start compiles kernels, which takes minutes on a
            busy machine.

    Attributes:
        scene: the loaded scene.
        name: full name of the node; the names of its topics begin with it.
        context: ROS context for nodes in the loop.
        state: state after the last step.
    """

    def __init__(
        self,
        scene: str | Path,
        *,
        overrides: Mapping[str, Any] | None = None,
        parameters: Mapping[str, Any] | None = None,
        inputs: Sequence[str] | None = None,
        bag: str | Path | None = None,
        patience: float = LONGEST_WAIT,
    ) -> None:
        self.scene = load_scene(scene, overrides=overrides)
        self._movable = {each.name: pose_key(each) for each in self.scene.handles if is_commanded(each)}
        self._puts = {body.name: pose_key(body) for body in self.scene.rigid_bodies}
        self._actuators = {actuator.name: actuator for actuator in self.scene.actuators}
        self._orders = Orders(self.scene, self.scene.solver)
        self._patience = patience
        namespace = f"/gdfe_test_{os.getpid()}_{next(_numbers)}"
        self.name = f"{namespace}/{NODE_NAME}"
        self.context = rclpy.Context()
        self._client: Client | None = None
        self._own, self._spinning = inputs is None, False
        self._awaited = list(self._inputs() if inputs is None else inputs)
        self._process = NodeProcess(
            {
                "scene": str(scene),
                "scene_overrides": override_words(overrides or {}) or [""],
                "autostart": False,
                "clock": "lockstep",
                # Stamps in simulation time: runs are bitwise equal, and a controller reads the time from any message.
                "publish_clock": "clock" not in (parameters or {}),
                "command_set": self._awaited or [""],
                "record": bag is not None,
                "bag_path": str(bag or ""),
                **(parameters or {}),
            },
            namespace=namespace,
            remaps={"/clock": f"{namespace}/clock"},
        )

    def step(self, command: Command | None = None) -> PublishedState:
        """Make one step and return the state after it. Handles and actuators without a command keep their last command.

        If the node refuses a command, the step is not made, and the command has no effect on later steps. If the step
        itself refuses it, e.g. because a grip is too far away, the step is made without any command.

        Raises:
            CommandError: the command is not allowed, or a handle would turn by more than pi (then no message is sent),
                or the node refuses it.
            OverlapError: a rigid body would overlap something at the pose to which it is teleported; the step was made
                without the teleport.
            GdfeError: ``inputs`` were given, the node takes no commands for an item, several bodies are teleported in a
                scene without other inputs, or the node ended or did not respond.
        """
        command = command or Command()
        if not self._own:
            raise GdfeError("cannot step: `inputs` were given; use `spin`")
        # First the errors that a direct call would raise.
        poses, values = self._orders.targets(command, self._poses), self._orders.values(command, self._values)
        values |= self._orders.positions(command)
        self._orders.places(command)
        given = {**command.actuators, **command.loads, **command.joints}
        named = ((command.handles, self._movable), (given, self._values), (command.bodies, self._puts))
        if unknown := sorted(set().union(*(set(names) - set(known) for names, known in named))):
            raise GdfeError(f"cannot step: the node takes no commands for {', '.join(unknown)}")
        if len(command.bodies) > 1 and not self._inputs():
            raise GdfeError("cannot step: a scene without handles, actuators and loads takes one body in a step")
        messages = {self._puts[name]: pose_stamped(Header(), pose) for name, pose in command.bodies.items()}
        for name, key in self._movable.items():
            order = PoseOrder.toward(name, poses[name], self._targets[name])
            messages[key] = pose_stamped(Header(), poses[name], order.quaternion)
        if ACTUATION in self._inputs():
            messages[ACTUATION] = actuation(self._actuators, values)
        try:
            state = self._order(messages)
        except CommandError:
            self._client.trigger(RESET_COMMANDS.key)  # accepted commands would wait for the next step
            raise
        record = state.record
        if values and not (record.actuators or record.loads or record.joints):
            self._wait(lambda: self._late, "the reason why the step was made without the command")
            raise CommandError(self._late[0])
        self._poses, self._values = poses, values
        if unplaced := sorted(set(command.bodies) - set(record.bodies)):
            self._wait(lambda: self._late, f"the reason why {', '.join(unplaced)} stayed")
            raise OverlapError(self._late[-1])
        return state

    def _order(self, messages: Mapping[str, Any]) -> PublishedState:
        """Send the messages of one step, wait for the step and return its state; raise a refusal as CommandError.

        The message that completes the command set starts the step; those of teleports are before it.
        """
        count = self.state.record.step + 1
        self._refusals.clear()
        self._late.clear()
        self._client.publish(messages)
        if not messages:
            self._client.trigger(STEP.key)
        self._wait(lambda: self._made.record.step >= count or self._refusals, "the step")
        if self._refusals:
            raise CommandError(self._refusals[-1])
        return self._made

    def run(self, controller: Callable[[PublishedState], Command], *, steps: int) -> list[PublishedState]:
        """Make steps with the commands that ``controller`` computes from the last state; return the state of each."""
        return [self.step(controller(self.state)) for _ in range(steps)]

    def jacobian(self) -> NDArray[np.float64]:
        """Return the Jacobian d(probe position) / d(command) at the present equilibrium, (probes, 3, actuators).

        Raises:
            GdfeError: the scene has no probes or no actuators.
        """
        self._jacobians.clear()
        self._client.trigger(COMPUTE_JACOBIAN.key)
        self._wait(lambda: self._jacobians, "the Jacobian")
        message = self._jacobians[-1]
        return np.array(message.data).reshape([dimension.size for dimension in message.layout.dim])

    def spin(self, node: Node, *, steps: int, silence: float = 60.0) -> list[PublishedState]:
        """Spin a controller node of the same ``context`` for a number of steps; return a state for each step.

        Args:
            node: the controller.
            steps: number of steps.
            silence: longest time for which the simulation may wait for a command of the controller [s].

        Raises:
            CommandError: the simulation refuses a command.
            GdfeError: an input has no publisher, no command comes in time, or the simulation ended or did not respond.
        """
        states: list[PublishedState] = []
        self._refusals.clear()
        topics = [f"{self.name}/{key}" for key in self._awaited]
        deadlock = Deadlock(self._node, self.name, topics, node, silence=silence)

        def store(state: PublishedState) -> None:
            deadlock.progress()
            states.append(state)

        def has_ended() -> bool:
            if len(states) < steps and self._refusals:
                raise CommandError(self._refusals[0])
            if len(states) < steps and (reason := deadlock.reason()):
                raise GdfeError(f"{len(states)} of {steps} steps were made: {reason}")
            return len(states) >= steps

        self._listeners.append(store)
        self._spinning = True
        self._client.executor.add_node(node)
        try:
            self._wait(has_ended, f"{steps} steps")
        finally:
            self._client.executor.remove_node(node)
            self._listeners.remove(store)
            self._spinning = False
            deadlock.close()
        return states[:steps]

    def __enter__(self) -> Simulator:
        try:
            self._connect()
        except BaseException as error:
            self.__exit__(type(error))
            raise
        return self

    def __exit__(self, kind: type[BaseException] | None, *error: object) -> None:
        self._process.__exit__(kind)
        if self._client is not None:
            self._client.close()

    def _connect(self) -> None:
        keys = [*self._puts.values(), *self._inputs()] if self._own else []
        commands = {key: JointState if key == ACTUATION else PoseStamped for key in keys}
        triggers = [spec.key for spec in (COMPUTE_JACOBIAN, STEP, RESET_COMMANDS)]
        given = {"topics": commands, "triggers": triggers, "patience": self._patience, "context": self.context}
        self._client = Client(self._process, self.name, "simulator", **given)
        self._sources = [f"{self.name}/{key}" for key in keys]
        self._node, self._wait = self._client.node, self._client.wait
        self.state: PublishedState | None = None
        self._made: PublishedState | None = None
        self._targets = dict.fromkeys(self._movable, Pose())
        self._listeners: list[Callable[[PublishedState], Any]] = []
        topics = state_topics(self.scene)
        self._arrived = StepMessages(topics, most=1000)
        for topic, spec in topics.items():
            callback = partial(self._receive, topic)
            self._node.create_subscription(interface_class(spec.type), f"{self.name}/{topic}", callback, STATE_QOS)
        self._meet()
        for label in ("configure", "activate"):
            self._client.transition(label)
        self._client.await_listeners()
        self._wait(lambda: self.state is not None, "the first state")
        self._poses = dict.fromkeys(self._movable, Pose())
        self._values = {
            name: self.state.joints[name][0] if actuator.mode.by_extent else 0.0
            for name, actuator in self._actuators.items()
        }
        self._values |= {load.name: LOAD_FACTOR for load in self.scene.loads}
        self._values |= joint_starts(self.scene.arms)

    def _meet(self) -> None:
        """Subscribe to Jacobians and refusals, and wait until the node has discovered this object's topics."""
        self._jacobians: list[Float64MultiArray] = []
        topic = JACOBIAN.name.replace("~", self.name)
        self._node.create_subscription(Float64MultiArray, topic, self._jacobians.append, 10)
        self._refusals: list[str] = []
        self._late: list[str] = []
        subscribe(self._node, REFUSED, self._hear, REFUSED.name.replace("~", self.name))
        self._client.meet()

    def _hear(self, message: String) -> None:
        """Store a refusal by the node: by a step, or of a message from one of this object's topics.

        While a controller spins, its messages count, too. A refusal by a step does not prevent the step.
        """
        entries = json.loads(message.data)
        text = f"command on {entries['source']} refused: {entries['message']}"
        if entries["late"] and (entries["reason"] == Reason.OVERLAP.value or not self._spinning):
            self._late.append(text)
        elif self._spinning or entries["source"] in self._sources:
            self._refusals.append(text)

    def _inputs(self) -> list[str]:
        driven = self.scene.actuators or self.scene.loads or self.scene.arms
        return [*self._movable.values()] + ([ACTUATION] if driven else [])

    def _count_turns(self, poses: Mapping[str, Pose]) -> dict[str, Pose]:
        """Return the poses that differ from their targets by whole turns, with rotation vectors near the targets."""
        found = {}
        for name, target in self._targets.items():
            turn = nearest_turn(Rotation.from_rotvec(poses[name].rotation).as_quat(), target)
            if math.dist(turn, poses[name].rotation) > math.pi:
                found[name] = Pose(poses[name].translation, turn)
        return found

    def _receive(self, topic: str, message: Any) -> None:
        """Store a message; when the messages of a step are complete, update the state and inform the listeners."""
        if (messages := self._arrived.add(topic, message)) is None:
            return
        state = unpack(self.scene, messages)
        if state.record.begin is Begin.REST:
            self._targets = dict.fromkeys(self._movable, Pose())
        self._targets |= state.record.handles
        self.state = replace(state, poses=dict(state.poses) | self._count_turns(state.poses))
        # A step that does not start from the last state follows a reset or a loaded state, not a command.
        if self._made is None or self.state.record.begin is Begin.LAST:
            self._made = self.state
        for listener in self._listeners:
            listener(self.state)
