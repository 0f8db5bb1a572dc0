# SPDX-License-Identifier: Apache-2.0
"""Messages that make a node consume exactly the commands that a recorded step consumed."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np
from geometry_msgs.msg import PoseStamped
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from gdfe_ros.analysis.bag_run import BagRun
from gdfe_ros.constraints import Handle, Pose
from gdfe_ros.node.driving.orders import PoseOrder, TeleportOrder, TwistOrder
from gdfe_ros.node.interface.topics import VELOCITY_COMMANDS, pose_key
from gdfe_ros.node.messages import actuation, pose_stamped
from gdfe_ros.recording.step import StepRecord

ACTUATION = "actuation"
Quaternion = tuple[float, float, float, float]


class Consumed:
    """Converts the step records of a run to messages for the node that replays it.

    A step of the replaying node begins once each input that the run uses has received a message. For an input without a
    command in the recorded step, the message repeats the present command, so that nothing changes.

    A step record contains the rotation vector of a target. The node computed it from a quaternion. A quaternion that is
    computed back from the rotation vector may give a rotation vector that differs in the last bit. Therefore the sent
    quaternions are looked up among the messages in the bag.

    Args:
        run: recorded run.

    Attributes:
        inputs: command topics that the run uses, relative to the node's name; each step of the replay waits for a
            message on each of them.
        puts: topics that teleport rigid bodies; their messages are sent before the messages of ``inputs``.
        inexact: number of targets so far that no quaternion reproduces bitwise.
    """

    def __init__(self, run: BagRun) -> None:
        known = {handle.name: handle for handle in run.scene.handles}
        handles = [known[name] for name in dict.fromkeys(name for record in run.records for name in record.handles)]
        self._driven = {name for record in run.records for name in (*record.actuators, *record.loads, *record.joints)}
        self._actuators = {item.name: item for item in run.scene.actuators if item.name in self._driven}
        self.inputs = [*map(pose_key, handles), *([ACTUATION] if self._driven else [])]
        bodies = dict.fromkeys(name for record in run.records for name in record.bodies)
        self._bodies = {name: (pose_key(known[name]), _collect_turns(run, pose_key(known[name]))) for name in bodies}
        self.puts = [key for key, _ in self._bodies.values()]
        self._handles = {handle.name: (pose_key(handle), _SentTurns(run, handle)) for handle in handles}
        self._poses: dict[str, Pose] = {}
        self._values: dict[str, float] = {}
        self.inexact = 0

    def start(self, targets: Mapping[str, Pose], commands: Mapping[str, float]) -> None:
        """Set the present targets and commands, before the next step."""
        self._poses = {name: targets[name] for name in self._handles}
        self._values = {name: commands[name] for name in self._driven}

    def messages(self, record: StepRecord) -> dict[str, PoseStamped | JointState]:
        """Return a dict from topic to message for a step; empty if the step has no commands.

        First are the messages that teleport rigid bodies, then one message for each of ``inputs``.
        """
        values = {**record.actuators, **record.loads, **record.joints}
        messages: dict[str, PoseStamped | JointState] = {}
        for name, pose in record.bodies.items():
            key, sent = self._bodies[name]
            turns = _quaternion(pose), *sent.get(pose.translation, ())
            turn = next((each for each in turns if TeleportOrder(name, pose.translation, each).pose == pose), None)
            messages[key] = pose_stamped(Header(), pose, turn)
            self.inexact += turn is None
        if not (record.handles or values or (messages and self.inputs)):
            return messages
        poses = self._poses | dict(record.handles)
        for name, pose in poses.items():
            key, sent = self._handles[name]
            turn = sent.find(self._poses[name], pose, record.dt)
            messages[key] = pose_stamped(Header(), pose, turn)
            self.inexact += turn is None
        self._poses = poses
        if self._driven:
            messages[ACTUATION] = actuation(self._actuators, values or self._values)
            self._values |= values
        return messages


class _SentTurns:
    """Quaternions and angular velocities that were sent to command one handle or obstacle, read from a bag."""

    def __init__(self, run: BagRun, handle: Handle) -> None:
        self._handle = handle.name
        self._sent = _collect_turns(run, pose_key(handle))
        velocity = VELOCITY_COMMANDS[handle.section].key(**{handle.noun: handle.name})
        twists = [message.twist for message in run.messages(velocity)]
        rates = dict.fromkeys((twist.angular.x, twist.angular.y, twist.angular.z) for twist in twists)
        self._twists = [TwistOrder(handle.name, (0.0, 0.0, 0.0), rate) for rate in rates]
        self._stride = float(run.reader.run.settings.get("node", {}).get("dt", math.inf))

    def find(self, last: Pose, target: Pose, dt: float) -> Quaternion | None:
        """Return a quaternion that, after the target ``last``, gives exactly ``target``; None if there is none."""
        for turn in self._candidates(last, target, min(dt, self._stride)):
            if PoseOrder(self._handle, target.translation, turn).after(last) == target:
                return turn
        return None

    def _candidates(self, last: Pose, target: Pose, dt: float) -> Iterator[Quaternion]:
        yield _quaternion(target)
        yield from self._sent.get(target.translation, ())
        for twist in self._twists:
            turned = Rotation.from_rotvec(dt * np.array(twist.angular)) * Rotation.from_rotvec(last.rotation)
            yield tuple(map(float, turned.as_quat()))


def _collect_turns(run: BagRun, key: str) -> dict[tuple[float, float, float], list[Quaternion]]:
    """Return a dict from translation to the quaternions that were sent with it on a topic."""
    sent: dict[tuple[float, float, float], list[Quaternion]] = {}
    for message in run.messages(key):
        place, turn = message.pose.position, message.pose.orientation
        sent.setdefault((place.x, place.y, place.z), []).append((turn.x, turn.y, turn.z, turn.w))
    return sent


def _quaternion(pose: Pose) -> Quaternion:
    return tuple(map(float, Rotation.from_rotvec(pose.rotation).as_quat()))
