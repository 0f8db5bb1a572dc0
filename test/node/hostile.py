# SPDX-License-Identifier: Apache-2.0
"""Endless sequences of bad commands, all of which a node must refuse: numbers, stamps, sizes, bytes, names, ranges."""

from __future__ import annotations

import math
import random
from collections.abc import Iterator

from builtin_interfaces.msg import Duration
from geometry_msgs.msg import PoseStamped, TwistStamped
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

_NUMBERS = [math.nan, math.inf, -math.inf, 1e308, -1e300, 1e9]
_INFINITE = [math.inf, -math.inf]
"""Infinite numbers. NaN is not included, because in a JointState it means that there is no command."""
HANDLE_TOPICS = {
    "handles/tip/target": PoseStamped,
    "handles/base/target": PoseStamped,
    "handles/tip/velocity": TwistStamped,
}
"""Dict from topic to message type, for a scene with the handle ``tip`` and the fixed handle ``base``."""
ACTUATOR_TOPICS = {"actuation": JointState, "commands": Float64MultiArray, "trajectory": JointTrajectory}
"""Dict from topic to message type, for the scene ``tendon_finger``."""
HANDLE_REASONS = ("malformed", "not finite", "quaternion not of unit length", "stale", "too far", "too fast",
                  "handle is fixed")  # fmt: skip
ACTUATOR_REASONS = ("malformed", "not finite", "wrong size", "unknown name", "out of range", "out of order", "stale")
"""Reasons of refusals that the node must have counted."""


def handle_commands(seed: int) -> Iterator[tuple[str, bytes]]:
    """Yield bad commands of handles: topic and bytes."""
    chance = random.Random(seed)
    while True:
        kind = chance.randrange(6)
        pose, twist = PoseStamped(), TwistStamped()
        if kind == 0:
            setattr(pose.pose.position, chance.choice("xyz"), chance.choice(_NUMBERS))
        elif kind == 1:
            setattr(pose.pose.orientation, chance.choice("xyzw"), chance.choice([*_NUMBERS, 2.0, -0.5]))
        elif kind == 2:
            pose.header.stamp.sec = chance.randrange(1, 1000)
            pose.pose.position.z = 0.1
        elif kind == 3:
            setattr(twist.twist.linear, chance.choice("xyz"), chance.choice(_NUMBERS))
            yield "handles/tip/velocity", serialize_message(twist)
            continue
        elif kind == 4:
            yield "handles/tip/target", _cut(serialize_message(pose), chance, 60)
            continue
        yield f"handles/{'base' if kind == 5 else 'tip'}/target", serialize_message(pose)


def actuator_commands(seed: int) -> Iterator[tuple[str, bytes]]:
    """Yield bad commands of the two tendons of ``tendon_finger``: topic and bytes."""
    chance = random.Random(seed)
    while True:
        yield chance.choice((_joint_state, _array, _trajectory))(chance)


def _joint_state(chance: random.Random) -> tuple[str, bytes]:
    message = JointState(name=["flexor", "extensor"], effort=[1.0, 1.0])
    kind = chance.randrange(6)
    if kind == 0:
        message.effort[chance.randrange(2)] = chance.choice(_INFINITE)
    elif kind == 1:
        message.name = chance.choice([["flexxor", "extensor"], ["flexor", "flexor"], ["", "extensor"], []])
    elif kind == 2:
        message.effort = [1.0] * chance.choice([0, 1, 3, 100])
    elif kind == 3:
        message.effort[chance.randrange(2)] = chance.choice([-1e-9, 40.1, 1e6])
    elif kind == 4:
        message.header.stamp.sec = chance.randrange(1, 1000)
    else:
        return "actuation", _cut(serialize_message(message), chance, 30)
    return "actuation", serialize_message(message)


def _array(chance: random.Random) -> tuple[str, bytes]:
    values = [1.0, 1.0]
    kind = chance.randrange(4)
    if kind == 0:
        values[chance.randrange(2)] = chance.choice(_NUMBERS)
    elif kind == 1:
        values = [1.0] * chance.choice([0, 1, 3, 1000])
    elif kind == 2:
        values[chance.randrange(2)] = chance.choice([-1.0, 41.0])
    data = serialize_message(Float64MultiArray(data=values))
    return "commands", _cut(data, chance, 12) if kind == 3 else data


def _trajectory(chance: random.Random) -> tuple[str, bytes]:
    points = [
        JointTrajectoryPoint(positions=[1.0], time_from_start=Duration(sec=1)),
        JointTrajectoryPoint(positions=[2.0], time_from_start=Duration(sec=2)),
    ]
    message = JointTrajectory(joint_names=["flexor"], points=points)
    kind = chance.randrange(5)
    if kind == 0:
        points[1].positions = [chance.choice(_NUMBERS)]
    elif kind == 1:
        points[chance.randrange(2)].positions = [1.0] * chance.choice([0, 2, 50])
    elif kind == 2:
        points[1].time_from_start = Duration(sec=chance.choice([-1, 0, 1]))
    elif kind == 3:
        message.joint_names = chance.choice([["nobody"], [], ["flexor", "flexor"]])
    else:  # without points it would end what runs
        message.joint_names, message.points = ["nobody"], []
    return "trajectory", serialize_message(message)


def _cut(data: bytes, chance: random.Random, most: int) -> bytes:
    """Return a truncated message. The CDR header remains, because Fast DDS does not deliver a shorter message."""
    return data[: chance.randrange(4, most)]
