# SPDX-License-Identifier: Apache-2.0
"""Random messages and requests to a node: it refuses or obeys them, answers soon, and does not grow."""

from __future__ import annotations

import os
import random
import time
from collections.abc import Callable
from typing import Any

from geometry_msgs.msg import PoseStamped, TwistStamped
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from test.node.meter import read_memory

MESSAGES = int(os.environ.get("TORTURE_EXAMPLES", "0")) * 20 or 1000
"""Number of random messages; a tenth as many requests."""
GROWTH, PATIENCE = 40.0, 60.0
"""Largest growth of the memory [MB], and longest time of an answer on a busy machine [s]."""
NUMBERS = (0.0, -1.0, 0.01, 1e-300, 1e300, float("inf"), float("nan"), 1e6)
TEXTS = (
    "",
    "flexor",
    "tip",
    "base_link",
    "moon",
    "a" * 5000,
    "\x1b[31m",
    "{",
    "[" * 500,
    "../x",
    "9" * 5000,
    "&a [*a]",
)
KINDS: dict[str, type] = {
    "actuation": JointState,
    "commands": Float64MultiArray,
    "trajectory": JointTrajectory,
    "handles/base/target": PoseStamped,
    "handles/base/velocity": TwistStamped,
}


def _fill(message: Any, dice: random.Random) -> Any:
    """Give some fields of a message, and of the messages in it, random values of their types."""
    for name, kind in message.get_fields_and_field_types().items():
        value = getattr(message, name)
        if dice.random() < 0.3:
            continue
        if hasattr(value, "get_fields_and_field_types"):
            _fill(value, dice)
        elif kind == "double":
            setattr(message, name, dice.choice(NUMBERS))
        elif kind == "string":
            setattr(message, name, dice.choice(TEXTS))
        elif kind == "sequence<double>":
            setattr(message, name, [dice.choice(NUMBERS) for _ in range(dice.choice((0, 1, 2, 3, 500)))])
        elif kind == "sequence<string>":
            setattr(message, name, [dice.choice(TEXTS) for _ in range(dice.randrange(4))])
        elif kind in ("int32", "uint32"):
            setattr(message, name, dice.choice((0, 1, 2**31 - 1)))
    if isinstance(message, JointTrajectory):
        message.points = [_fill(JointTrajectoryPoint(), dice) for _ in range(dice.randrange(4))]
    return message


def _bytes(kind: type, dice: random.Random) -> bytes:
    """Return a random message of a kind, whole, cut, changed, or any bytes."""
    data = bytearray(serialize_message(_fill(kind(), dice)))
    match dice.randrange(5):
        case 0:
            del data[dice.randrange(len(data)) :]
        case 1:
            data[dice.randrange(len(data))] = dice.randrange(256)
        case 2:
            data[4:] = dice.randbytes(dice.randrange(200))
    return bytes(data)


def _ask(client: Any, dice: random.Random) -> float:
    """Send a random request, and return the time of its answer [s]."""
    from simulation_interfaces import srv

    began = time.monotonic()
    match dice.randrange(3):
        case 0:
            request = srv.SpawnEntity.Request(name=dice.choice(TEXTS), allow_renaming=True)
            request.entity_resource.resource_string = dice.choice(TEXTS)
            client.call(srv.SpawnEntity, "spawn_entity", request)
        case 1:
            request = srv.GetEntities.Request()
            request.filters.filter = dice.choice((*TEXTS, ".*" * 20 + "!", "(a+)+$", "(", "a{1,60000}"))
            client.call(srv.GetEntities, "get_entities", request)
        case _:
            value = ParameterValue(type=dice.randrange(10), double_value=dice.choice(NUMBERS))
            value.string_value, value.string_array_value = dice.choice(TEXTS), [dice.choice(TEXTS)]
            names = ("rate", "dt", "follow", "scene_overrides", "state_path", "command_set", "nothing", "marker_field")
            parameters = [Parameter(name=dice.choice(names), value=value)]
            client.call(SetParameters, "set_parameters", SetParameters.Request(parameters=parameters))
    return time.monotonic() - began


def test_random_messages_and_requests(client: Any, launch: Callable, interfaces: Callable) -> None:
    """A node under random messages and requests stays active, answers soon, does not grow, and obeys afterwards."""
    for package in ("tf2_msgs", "simulation_interfaces"):
        interfaces(package)
    process = launch(scene="tendon_finger", heartbeat=0.2)
    slowest, before, count = 0.0, 0.0, 0
    publishers = {
        topic: client.node.create_publisher(kind, client.full(topic), 100)
        for topic, kind in KINDS.items()
        if not topic.startswith("handles") or client.node.count_subscribers(client.full(topic))
    }

    # A node keeps its state: an example that fails cannot be played again, or made smaller.
    @settings(
        max_examples=MESSAGES // 10,
        deadline=None,
        database=None,
        derandomize=MESSAGES == 1000,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(st.randoms(use_true_random=False))
    def attack(dice: random.Random) -> None:
        nonlocal slowest, before, count
        for _ in range(10):
            topic = dice.choice(list(publishers))
            publishers[topic].publish(_bytes(KINDS[topic], dice))
            client.spin(0.001)
        slowest, count = max(slowest, _ask(client, dice)), count + 10
        if count == MESSAGES // 40 * 10:
            before = read_memory(process.pid)

    attack()
    assert client.state() == "active"
    assert slowest < PATIENCE
    growth = 1e-6 * (read_memory(process.pid) - before)
    print(f"{count} messages; slowest answer {slowest:.2f} s, growth {growth:.1f} MB")
    assert growth < GROWTH
    assert "\x1b" not in process.log
    assert process.stop() == 0


def test_huge_messages_delay_no_answer(client: Any, launch: Callable, interfaces: Callable) -> None:
    """Messages of 10 MB are refused without being read; before, one trajectory of 200 000 points took seconds."""
    interfaces("tf2_msgs")
    launch(scene="tendon_finger", heartbeat=0.2)
    publishers = [
        client.node.create_publisher(kind, client.full(topic), 10)
        for topic, kind in (("trajectory", JointTrajectory), ("commands", Float64MultiArray), ("actuation", JointState))
    ]
    client.wait(lambda: all(each.get_subscription_count() for each in publishers))
    point = serialize_message(JointTrajectory(points=[JointTrajectoryPoint()]))[-36:]
    head = serialize_message(JointTrajectory())
    data = head[:-4] + (200_000).to_bytes(4, "little") + 200_000 * point
    for publisher in publishers:
        for _ in range(5):
            publisher.publish(data)
    client.wait(lambda: int(client.diagnostics()["commands refused"]) >= 15)
    began = time.monotonic()
    assert client.state() == "active"
    assert time.monotonic() - began < PATIENCE
    assert client.diagnostics()["refused: wrong size"] == "15"
