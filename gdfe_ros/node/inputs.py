# SPDX-License-Identifier: Apache-2.0
"""Command topics of a simulation: messages are checked, recorded, and put into the inbox."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from rclpy.qos import ReliabilityPolicy
from rclpy.serialization import deserialize_message

from gdfe_ros.actuators import Mode
from gdfe_ros.node.actuator_orders import ActuatorOrders
from gdfe_ros.node.following import Followers, Leader, followed_order, refuse_followed
from gdfe_ros.node.freshness import Freshness
from gdfe_ros.node.handle_orders import pose_order, put_order, twist_order
from gdfe_ros.node.inbox import Inbox
from gdfe_ros.node.interface import topics
from gdfe_ros.node.orders import ActuatorOrder, Order, TrajectoryOrder
from gdfe_ros.node.pursuit import Code, Pursuit
from gdfe_ros.node.qos import interface_class, qos_profile
from gdfe_ros.node.refusals import Reason, Refusal, require_small
from gdfe_ros.node.run import Run
from gdfe_ros.node.specification import TopicSpec
from gdfe_ros.recording.recorder import Recorder
from gdfe_ros.recording.step import Step
from gdfe_ros.recording.topic import Qos, TopicInfo

_TRAJECTORY = topics.TRAJECTORY.key()
_UNSURE = ReliabilityPolicy.BEST_EFFORT


@dataclass(frozen=True)
class Input:
    """One command topic.

    Attributes:
        key: name of the input in ``command_set`` and in bags, e.g. ``handles/tip/target``.
        topic: name of the topic.
        spec: description of the topic.
        check: function that returns the order of a message, or raises ``Refusal``.
        stamped: whether the header's stamp is the time of the command.
    """

    key: str
    topic: str
    spec: TopicSpec
    check: Callable[[Any], Order]
    stamped: bool


class Inputs:
    """Subscriptions of the command topics.

    Messages are received as bytes, so that a bag contains every message as it was sent, including refused ones.

    Args:
        run: the run that is commanded.
        leaders: dict from the name of a following handle or obstacle to its leader.

    Attributes:
        inbox: queue that receives the commands; None while the node is not active.
        recorder: recorder of the bag in progress, or None.
        freshness: check of the commands' stamps.
    """

    def __init__(self, run: Run, leaders: Mapping[str, Leader]) -> None:
        self._run, self._leaders = run, leaders
        self.inbox: Inbox | None = None
        self.recorder: Recorder | None = None
        self.freshness = Freshness()
        self._pursuits: list[Pursuit] = []
        self._inputs = {item.key: item for item in _inputs(run, leaders)}
        self._subscriptions = {key: self._subscribe(item) for key, item in self._inputs.items()}
        led = [leader for leader in leaders.values() if leader.frame]
        self.followers = Followers(led, run.scene.mesh.size, run.frames, self._put, run.refusals.refuse)
        self._heard: set[str] = set()

    @property
    def keys(self) -> list[str]:
        """Names of the inputs, as in ``command_set``."""
        return [*self._inputs, *(leader.key for leader in self._leaders.values() if leader.frame)]

    def led(self) -> dict[str, str]:
        """Return a dict from follower to a text about its leader; the text states whether a pose was received."""
        leaders = self._leaders.items()
        return {name: f"{each}{'' if each.key in self._heard else ', not heard yet'}" for name, each in leaders}

    def unheard(self) -> list[str]:
        """Return a text for each command topic with best-effort publishers, whose messages do not reach the node."""
        node, found = self._run.node, []
        for subscription in self._subscriptions.values():
            topic = subscription.topic_name
            if node.count_publishers(topic) <= subscription.get_publisher_count():
                continue
            publishers = node.get_publishers_info_by_topic(topic)
            names = {each.node_name for each in publishers if each.qos_profile.reliability is _UNSURE}
            if names:
                found.append(f"{', '.join(sorted(names))} on {topic}: best effort; allowed: reliable")
        return sorted(found)

    def connections(self) -> dict[str, int]:
        """Return a dict from topic to the number of publishers that the middleware has connected."""
        return {each.topic_name: each.get_publisher_count() for each in self._subscriptions.values()}

    @property
    def infos(self) -> list[TopicInfo]:
        """Descriptions of the topics for a bag."""
        return [
            TopicInfo(
                name=subscription.topic_name,
                type=self._inputs[key].spec.type,
                qos=Qos.from_rclpy(qos_profile(self._inputs[key].spec.delivery)),
                role=key,
            )
            for key, subscription in self._subscriptions.items()
        ]

    def trajectory(self, message: Any) -> TrajectoryOrder:
        """Check a JointTrajectory message and return its order.

        Raises:
            Refusal: as for a message on ~/trajectory, or the scene has no actuators, loads and arms.
        """
        if _TRAJECTORY not in self._inputs:
            raise Refusal(Reason.UNKNOWN, f"scene {self._run.scene.name!r} has neither actuators nor loads nor arms")
        return self._inputs[_TRAJECTORY].check(message)

    def pursue(self, pursuit: Pursuit) -> None:
        """Queue the order of an action client's trajectory, and report its progress from now on."""
        self._put(_TRAJECTORY, replace(pursuit.order, begun=pursuit.begin))
        self._pursuits.append(pursuit)
        self._run.refusals.take()

    def hold(self, pursuit: Pursuit) -> None:
        """End a trajectory: keep its actuators, loads and joints at their present commands."""
        names = pursuit.order.names
        self._put(_TRAJECTORY, TrajectoryOrder(names, None, np.zeros(0), np.zeros((0, len(names)))), told=False)

    def look(self, step: Step) -> None:
        """Report a step to every action client's trajectory; called between steps."""
        if not self._pursuits:
            return
        states = self._run.simulation.actuator_states()
        simulation = self._run.simulation
        present = simulation.commands | {name: state.command for name, state in states.items()}
        present |= simulation.joint_positions
        for pursuit in list(self._pursuits):
            pursuit.look(step.record.time, present)
            if not pursuit.going:
                with suppress(ValueError):  # another thread ended all of them meanwhile
                    self._pursuits.remove(pursuit)

    def take_over(self, other: Inputs) -> None:
        """Continue the action clients' trajectories and the checks of stamps of other inputs."""
        self._pursuits, other._pursuits = other._pursuits, []
        self.freshness, self._heard = other.freshness, other._heard & self._inputs.keys()

    def give_up(self, reason: str) -> None:
        """End every action client's trajectory with an error and its reason."""
        pursuits, self._pursuits = self._pursuits, []
        for pursuit in pursuits:
            pursuit.end(Code.INVALID_GOAL, reason)

    def destroy(self) -> None:
        """Remove the topics from the graph."""
        for subscription in self._subscriptions.values():
            self._run.node.destroy_subscription(subscription)

    def _subscribe(self, item: Input) -> Any:
        topic = self._run.node.resolve_topic_name(item.topic)
        kind = interface_class(item.spec.type)
        receive = partial(self._receive, item, topic, kind)
        node = self._run.node
        profile = qos_profile(item.spec.delivery)
        return node.create_subscription(kind, topic, receive, profile, raw=True)

    def _receive(self, item: Input, topic: str, kind: type, data: bytes) -> None:
        if self.recorder is not None:
            self.recorder.record(topic, data, self._run.log_time)
        try:
            self._take(item, topic, kind, data)
        except Refusal as refusal:
            self._run.refusals.refuse(topic, refusal)
        else:
            self._run.refusals.take()

    def _take(self, item: Input, topic: str, kind: type, data: bytes) -> None:
        if self.inbox is None:
            raise Refusal(Reason.INACTIVE, "the node is not active; it takes commands after `activate`")
        require_small(data)
        try:
            message = deserialize_message(data, kind)
        except Exception as error:  # rclpy does not document the exceptions
            raise Refusal(Reason.MALFORMED, f"the bytes are not a valid {item.spec.type}: {error!r}") from error
        order = item.check(message)
        if item.stamped:
            run, values = self._run, self._run.parameters
            names = order.values if isinstance(order, ActuatorOrder) else ("",)
            self.freshness.check(
                [f"{topic} {name}" for name in names],
                message.header.stamp,
                now=run.now(),
                max_age=values["command_max_age"],
                max_lead=values["command_max_lead"],
            )
        self._put(item.key, order)

    def _put(self, key: str, order: Order, *, told: bool = True) -> None:
        if self.inbox is not None:
            for pursuit in list(self._pursuits) if told else ():
                pursuit.displace(order)
            self._heard.add(key)
            self.inbox.put(key, order)


def _inputs(run: Run, leaders: Mapping[str, Leader]) -> Iterator[Input]:
    """Yield the inputs of a scene, including those of fixed handles and followers, which refuse all commands."""
    yield from _handle_inputs(run, leaders)
    scene = run.scene
    if scene.actuators or scene.loads or scene.arms:
        joints = [joint for arm in scene.arms for joint in arm.joints]
        yield from _actuator_inputs(run, ActuatorOrders(scene.actuators, [load.name for load in scene.loads], joints))


def _handle_inputs(run: Run, leaders: Mapping[str, Leader]) -> Iterator[Input]:
    """Yield the inputs that move handles, obstacles and rigid bodies."""
    scene, frames, size = run.scene, run.frames, run.scene.mesh.size
    # First: in lockstep, a teleport that arrives before the command set is complete belongs to the same step.
    for handle in scene.handles:
        if spec := topics.MOVED[handle.section].put:
            topic = spec.name.format(**{handle.noun: handle.name})
            take = partial(put_order, handle=handle, size=size, frames=frames)
            yield Input(topic.removeprefix("~/"), topic, spec, take, stamped=True)
    for handle in scene.handles:
        leader, moved = leaders.get(handle.name), topics.MOVED[handle.section]
        if moved.target is None:
            continue
        for spec, check in ((moved.target, pose_order), (moved.velocity, twist_order)):
            topic = spec.name.format(**{handle.noun: handle.name})
            take = partial(check, handle=handle, size=size, frames=frames)
            if leader is not None:
                take = partial(refuse_followed, leader=leader)
            yield Input(topic.removeprefix("~/"), topic, spec, take, stamped=True)
        if leader is not None and leader.topic:
            take = partial(followed_order, leader=leader, size=size, frames=frames)
            yield Input(leader.key, leader.topic, topics.FOLLOWED, take, stamped=True)


def _actuator_inputs(run: Run, orders: ActuatorOrders) -> Iterator[Input]:
    """Yield the inputs that command actuators, loads and joints."""
    scene = run.scene
    if any(arm.joints for arm in scene.arms):
        spec = topics.JOINT_COMMAND
        yield Input("joint_command", spec.name, spec, orders.from_joint_state, stamped=True)
    yield Input("actuation", topics.ACTUATION.name, topics.ACTUATION, orders.from_joint_state, stamped=True)
    if scene.actuators:
        spec = topics.ACTUATOR_COMMANDS
        yield Input("commands", spec.name, spec, orders.from_array, stamped=False)
    if any(actuator.mode is Mode.GRIP for actuator in scene.actuators):
        for spec, holds in ((topics.ATTACH, 1.0), (topics.RELEASE, 0.0)):
            take = partial(orders.from_grip, holds=holds, present=lambda: run.simulation.commands)
            yield Input(spec.key(), spec.name, spec, take, stamped=False)

    def follow(message: Any) -> Order:
        return orders.from_trajectory(message, now=run.simulation_time(run.now()), convert=run.simulation_time)

    yield Input(_TRAJECTORY, topics.TRAJECTORY.name, topics.TRAJECTORY, follow, stamped=False)
