# SPDX-License-Identifier: Apache-2.0
"""Input topics of a simulation, and trajectories that an action follows."""

from __future__ import annotations

import threading
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from enum import IntEnum
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rclpy.qos import ReliabilityPolicy
from rclpy.serialization import deserialize_message

from gdfe_ros.actuators import Mode
from gdfe_ros.node.command_messages import ActuatorOrders, pose_order, put_order, twist_order
from gdfe_ros.node.driving.orders import Inbox, Order, TrajectoryOrder
from gdfe_ros.node.interface import TopicSpec, topics
from gdfe_ros.node.interface.topics import pose_key
from gdfe_ros.node.middleware.ros_types import interface_class, subscribe, topic_info
from gdfe_ros.node.refusals import Freshness, Reason, Refusal, require_small
from gdfe_ros.node.run import Followers, Leader, Run, make_follower_order, refuse_followed
from gdfe_ros.recording.bag_info import TopicInfo
from gdfe_ros.recording.recorder import Recorder
from gdfe_ros.recording.step import Step


class Code(IntEnum):
    """Result of a trajectory, as in ``control_msgs/action/FollowJointTrajectory``."""

    SUCCESSFUL = 0
    INVALID_GOAL = -1
    INVALID_JOINTS = -2
    OLD_HEADER_TIMESTAMP = -3
    PATH_TOLERANCE_VIOLATED = -4
    GOAL_TOLERANCE_VIOLATED = -5


@dataclass(frozen=True)
class Tolerances:
    """Allowed deviations of the present commands from a trajectory.

    Attributes:
        path: dict from name to deviation before the end, in the unit of the mode; other names are not checked.
        goal: dict from name to deviation at the end, in the unit of the mode; other names are not checked.
        time: time after the end within which ``goal`` must be met [s].
    """

    path: Mapping[str, float]
    goal: Mapping[str, float]
    time: float


class Pursuit:
    """An action client's trajectory in progress.

    Args:
        order: order of the trajectory.
        tolerances: allowed deviations from the trajectory.
        tell: function that is called after every step with the time since the start [s], the trajectory's commands
            (k,) and the present commands (k,).
        finish: function that is called once with the result and its reason.

    Attributes:
        going: whether the trajectory has not ended.
    """

    def __init__(
        self,
        order: TrajectoryOrder,
        tolerances: Tolerances,
        *,
        tell: Callable[[float, NDArray[np.float64], NDArray[np.float64]], object],
        finish: Callable[[Code, str], object],
    ) -> None:
        self.order, self.going = order, True
        self._tolerances, self._tell, self._finish = tolerances, tell, finish
        self._start, self._before, self._rates = order.start, np.array([]), np.array([])
        self._lock = threading.Lock()

    def begin(self, start: float, before: Collection[float], rates: Collection[float]) -> None:
        """Record the start of the trajectory [s], and the commands and velocities (k,) at that time."""
        self._start, self._before, self._rates = start, np.array(before), np.array(rates)

    def end(self, code: Code, reason: str) -> None:
        """End the trajectory, unless it has ended already."""
        with self._lock:
            going, self.going = self.going, False
        if going:
            self._finish(code, reason)

    def displace(self, later: Order) -> None:
        """End the trajectory if a later order commands one of its names."""
        if taken := sorted(set(later.names) & set(self.order.names)):
            self.end(Code.INVALID_GOAL, f"a later command of {', '.join(taken)} took its place")

    def look(self, time: float, present: Mapping[str, float]) -> None:
        """Report the progress after a step; end the trajectory if it is complete or out of tolerance.

        Args:
            time: simulation time [s].
            present: dict from name to the command of an actuator or load, after a rate limit, or a joint's position.
        """
        if not self.going or not len(self._before) or time < self._start:
            return
        order, elapsed = self.order, time - self._start
        actual = np.array([present[name] for name in order.names])
        desired = order.at(elapsed, self._before, self._rates)
        self._tell(elapsed, desired, actual)
        left = elapsed - order.times[-1]
        over = left >= -1e-9
        wrong = self._beyond(self._tolerances.goal if over else self._tolerances.path, desired, actual)
        if not over and wrong:
            self.end(Code.PATH_TOLERANCE_VIOLATED, f"{elapsed:.6g} s after its start, {wrong}")
        elif over and not wrong:
            self.end(Code.SUCCESSFUL, "")
        elif over and left > self._tolerances.time - 1e-9:
            self.end(Code.GOAL_TOLERANCE_VIOLATED, f"{left:.6g} s after its end, {wrong}")

    def _beyond(self, allowed: Mapping[str, float], desired: NDArray[np.float64], actual: NDArray[np.float64]) -> str:
        """Return a message about commands out of tolerance; empty if there are none."""
        rows = zip(self.order.names, desired, actual, strict=True)
        return ", ".join(
            f"{name} is at {there:.6g} instead of {wanted:.6g}; allowed: {allowed[name]:g} off"
            for name, wanted, there in rows
            if abs(there - wanted) > allowed.get(name, np.inf)
        )


_TRAJECTORY = topics.TRAJECTORY.key()
_UNSURE = ReliabilityPolicy.BEST_EFFORT


@dataclass(frozen=True)
class Input:
    """One command topic.

    Attributes:
        spec: description of the topic.
        check: function that returns the order of a message, or raises ``Refusal``.
        key: name of the input in ``command_set`` and in bags, e.g. ``handles/tip/target``.
        stamped: whether the header's stamp is the time of the command.
        leader: topic of the handle's leader; empty: the topic is ``~/`` followed by ``key``.
    """

    spec: TopicSpec
    check: Callable[[Any], Order]
    key: str
    stamped: bool = True
    leader: str = ""


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
        self.followers = Followers(led, run, self._put)
        self._heard: set[str] = set()

    @property
    def keys(self) -> list[str]:
        """Names of the inputs, as in ``command_set``."""
        return [*self._inputs, *(leader.key for leader in self._leaders.values() if leader.frame)]

    def list_leaders(self) -> dict[str, str]:
        """Return a dict from follower to a text about its leader; the text states whether a pose was received."""
        leaders = self._leaders.items()
        return {name: f"{each}{'' if each.key in self._heard else ', not heard yet'}" for name, each in leaders}

    def unheard(self) -> list[str]:
        """Return a text for each command topic with best-effort publishers; their messages do not reach the node."""
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
        return [topic_info(self._inputs[key].spec, each.topic_name, key) for key, each in self._subscriptions.items()]

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
        refused = partial(pursuit.end, Code.INVALID_GOAL)
        self._put(_TRAJECTORY, replace(pursuit.order, begun=pursuit.begin, refused=refused))
        self._pursuits.append(pursuit)
        self._run.refusals.accept()

    def hold(self, pursuit: Pursuit) -> None:
        """End a trajectory: keep its actuators, loads and joints at their present commands."""
        names = pursuit.order.names
        self._put(_TRAJECTORY, TrajectoryOrder(names, None, np.zeros(0), np.zeros((0, len(names)))), announced=False)

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
        """Take over from other inputs: action clients' trajectories, stored stamps, and the keys of heard inputs."""
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
        topic = self._run.node.resolve_topic_name(item.leader or f"~/{item.key}")
        return subscribe(self._run.node, item.spec, partial(self._receive, item, topic), topic, raw=True)

    def _receive(self, item: Input, topic: str, data: bytes) -> None:
        if self.recorder is not None:
            self.recorder.record(topic, data, self._run.log_time)
        try:
            self._take(item, topic, data)
        except Refusal as refusal:
            self._run.refusals.refuse(topic, refusal)
        else:
            self._run.refusals.accept()

    def _take(self, item: Input, topic: str, data: bytes) -> None:
        if self.inbox is None:
            raise Refusal(Reason.INACTIVE, "the node is not active; it takes commands after `activate`")
        message = read_message(data, interface_class(item.spec.type))
        order = item.check(message)
        if item.stamped:
            run, values = self._run, self._run.parameters
            self.freshness.check(
                [f"{topic} {name}" for name in order.names],
                message.header.stamp,
                now=run.now(),
                max_age=values["command_max_age"],
                max_lead=values["command_max_lead"],
            )
        self._put(item.key, replace(order, source=topic))

    def _put(self, key: str, order: Order, *, announced: bool = True) -> None:
        if self.inbox is not None:
            for pursuit in list(self._pursuits) if announced else ():
                pursuit.displace(order)
            self._heard.add(key)
            self.inbox.put(key, order)


def read_message(data: bytes, kind: type) -> Any:
    """Deserialise a message of the class ``kind``.

    Raises:
        Refusal: the bytes are too many, or are not a message of this class.
    """
    require_small(data)
    try:
        return deserialize_message(data, kind)
    except Exception as error:  # rclpy does not document the exceptions
        text = f"the bytes are not a valid {kind.__module__.partition('.')[0]}/msg/{kind.__name__}: {error!r}"
        raise Refusal(Reason.MALFORMED, text) from error


def _inputs(run: Run, leaders: Mapping[str, Leader]) -> Iterator[Input]:
    """Yield the inputs of a scene; inputs of fixed handles and of followers refuse all commands."""
    yield from _handle_inputs(run, leaders)
    scene = run.scene
    if scene.actuators or scene.loads or scene.arms:
        yield from _actuator_inputs(run, ActuatorOrders(scene))


def _handle_inputs(run: Run, leaders: Mapping[str, Leader]) -> Iterator[Input]:
    """Yield the inputs that move handles, obstacles and rigid bodies."""
    scene, frames, size = run.scene, run.frames, run.scene.mesh.size
    # First: in lockstep, a teleport that arrives before the command set is complete belongs to the same step.
    for body in scene.rigid_bodies:
        yield Input(topics.BODY_SET, partial(put_order, handle=body, size=size, frames=frames), pose_key(body))
    for handle in scene.handles:
        if handle.section not in topics.VELOCITY_COMMANDS:
            continue
        leader = leaders.get(handle.name)
        for commands, check in ((topics.POSE_COMMANDS, pose_order), (topics.VELOCITY_COMMANDS, twist_order)):
            spec, take = commands[handle.section], partial(check, handle=handle, size=size, frames=frames)
            if leader is not None:
                take = partial(refuse_followed, leader=leader)
            yield Input(spec, take, spec.key(**{handle.noun: handle.name}))
        if leader is not None and leader.topic:
            take = partial(make_follower_order, leader=leader, size=size, frames=frames)
            yield Input(topics.FOLLOWED, take, leader.key, leader=leader.topic)


def _actuator_inputs(run: Run, orders: ActuatorOrders) -> Iterator[Input]:
    """Yield the inputs that command actuators, loads and joints."""
    scene = run.scene
    if any(arm.joints for arm in scene.arms):
        yield Input(topics.JOINT_COMMAND, orders.from_joint_state, topics.JOINT_COMMAND.key())
    yield Input(topics.ACTUATION, orders.from_joint_state, topics.ACTUATION.key())
    if scene.actuators:
        yield Input(topics.ACTUATOR_COMMANDS, orders.from_array, topics.ACTUATOR_COMMANDS.key(), stamped=False)
    if any(actuator.mode is Mode.GRIP for actuator in scene.actuators):
        for spec, holds in ((topics.ATTACH, 1.0), (topics.RELEASE, 0.0)):
            take = partial(orders.from_grip, holds=holds, present=lambda: run.simulation.commands)
            yield Input(spec, take, spec.key(), stamped=False)

    def follow(message: Any) -> Order:
        return orders.from_trajectory(message, now=run.simulation_time(run.now()), convert=run.simulation_time)

    yield Input(topics.TRAJECTORY, follow, _TRAJECTORY, stamped=False)
