# SPDX-License-Identifier: Apache-2.0
"""Malformed commands in large numbers: no crash, no motion, all counted, constant memory."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.parameter import Parameter
from std_srvs.srv import SetBool, Trigger

from test.node import flood, hostile
from test.node.meter import read_processor

REASONS = {"handles": hostile.HANDLE_REASONS, "actuators": hostile.ACTUATOR_REASONS}


@pytest.mark.parametrize("scene", flood.SCENES)
@pytest.mark.parametrize("count", [3000, pytest.param(50_000, marks=pytest.mark.torture)])
def test_hostile_commands_change_nothing(scene: str, count: int) -> None:
    """Thousands of bad commands per second are all counted, mesh and memory stay, and the node ends in order."""
    found = flood.measure(scene, count=count)
    assert (found.refused, found.finite, found.moved, found.status) == (count, True, 0.0, 0)
    assert sum(found.reasons.values()) == count
    assert all(found.reasons[reason] > count / 500 for reason in REASONS[scene]), found.reasons
    assert found.memory < flood.MOST_GROWTH


def test_good_commands_work_among_bad_ones(client: Any, start: Callable, coarse: dict) -> None:
    """Among bad commands, which are counted, a good one is carried out."""
    start(**coarse, command_max_age=1.0)
    client.target(0.05)
    commands = hostile.handle_commands(2)
    publishers = {
        topic: client.node.create_publisher(kind, client.full(topic), 1000)
        for topic, kind in hostile.HANDLE_TOPICS.items()
    }
    client.wait(lambda: all(publisher.get_subscription_count() for publisher in publishers.values()))
    for _ in range(200):
        topic, data = next(commands)
        publishers[topic].publish(data)
    client.target(0.06)
    client.wait(lambda: int(client.diagnostics()["commands refused"]) >= 200)
    client.wait_taken(2)
    client.wait(lambda: client.mesh()[:, 5].max() == pytest.approx(0.06, abs=1e-6))
    values = client.diagnostics()
    assert (values["commands refused"], values["commands taken"]) == ("200", "2")


@pytest.mark.parametrize(
    "text", ["\x1b[2J\a\r\n[ERROR] [1.0] [gdfe_sim]: forged", "\u202ereversed", "z" * 2_000_000, "x" * 300]
)
def test_texts_of_requests_are_plain_in_the_log(client: Any, start: Callable, coarse: dict, text: str) -> None:
    """Control characters, forged entries and megabytes in names, labels and paths do not reach the log.

    Before, a path erased the terminal, a label of 2 MB became an entry of 2 MB, and the log had a forged error.
    """
    process = start(**coarse)
    client.wait(client.records)
    refused = not text.isprintable() or len(text) > 4096
    for name in ("bag_path", "state_path"):
        assert client.set(**{name: text})[0].successful is not refused
    client.call(SetBool, "record", SetBool.Request(data=True))
    assert client.transition(text) is False
    for label in ("deactivate", "cleanup"):
        assert client.transition(label)
    for name, value in (("scene", text), ("scene_overrides", [text])):
        client.set(**{name: value})
        if client.transition("configure"):
            assert client.transition("cleanup")
    lines = process.log.splitlines()
    assert all(line.isprintable() for line in lines)
    assert max(map(len, lines)) < 25_000
    assert not any(line.startswith("[ERROR] [1.0]") for line in lines)
    assert "Traceback" not in process.log


def test_lists_of_requests_are_limited(client: Any, start: Callable, coarse: dict) -> None:
    """A list of 10001 parameters is refused, and 10000 names are answered.

    Before, rclpy answered a request for 500000 names in 15 s, in which the node answered nothing else.
    """
    start(**coarse)
    client.wait(client.records)
    ask = lambda count: client.call(GetParameters, "get_parameters", GetParameters.Request(names=["rate"] * count))  # noqa: E731
    assert len(ask(10_000).values) == 10_000
    assert len(ask(10_001).values) == 0
    rate = Parameter("rate", value=7.0).to_parameter_msg()
    results = client.call(SetParameters, "set_parameters", SetParameters.Request(parameters=[rate] * 10_001)).results
    assert not any(result.successful for result in results)
    assert results[0].reason == "parameters has 10001 entries; allowed: up to 10000"
    assert ask(1).values[0].double_value != 7.0


def test_a_flood_of_requests_does_not_fill_the_log(client: Any, start: Callable, coarse: dict) -> None:
    """Of hundreds of refused transitions, the log has at most 100 in five seconds, and how many it left out."""
    process = start(**coarse)
    client.wait(client.records)
    assert not client.transition("nonsense")
    change = client.node.create_client(ChangeState, client.full("change_state"))
    client.wait(change.service_is_ready)
    request = ChangeState.Request()
    request.transition.label = "nonsense"
    asked = 0

    def ask() -> bool:
        nonlocal asked
        futures = [change.call_async(request) for _ in range(5)]  # a service keeps ten requests
        client.wait(lambda: all(future.done() for future in futures))
        asked += len(futures)
        return "entries left out since" in process.log

    client.wait(ask)
    assert process.log.count("transition 'nonsense' refused") < asked


def test_wild_commands_at_a_thousand_a_second_leave_finite_meshes(client: Any, start: Callable, coarse: dict) -> None:
    """Poses of up to five body lengths at 1 kHz give finite meshes only, and after a reset commands work again."""
    start(**coarse, deadline=0.05)
    chance = np.random.default_rng(3)
    for _ in range(1000):
        client.target(chance.uniform(-2.5, 2.5), turn=tuple(chance.uniform(-3.0, 3.0, 3)))
        client.spin(0.001)
    client.wait_taken(1000)
    assert client.call(Trigger, "reset", Trigger.Request()).success
    client.target(0.05)
    client.wait(lambda: client.mesh()[:, 5].max() == pytest.approx(0.05, abs=1e-6))
    client.wait(lambda: client.diagnostics()["converged"] == "True")  # the deadline may cut the step; others follow
    assert all(np.isfinite(mesh).all() for mesh in client.meshes())


def test_a_request_that_is_too_large_stays_unread(client: Any, start: Callable, coarse: dict) -> None:
    """A request of 200000 parameters is refused with its size, and takes the node 2 s at most.

    Before, rclpy made Python objects of it for 5 to 12 s, in which the node answered nothing.
    """
    process = start(**coarse)
    client.wait(client.records)
    before = read_processor(process.pid).total
    many = SetParameters.Request(parameters=[Parameter("rate", value=50.0).to_parameter_msg()] * 200_000)
    (result,) = client.call(SetParameters, "set_parameters", many).results
    assert not result.successful
    assert "it has 12800004 bytes; allowed: up to 2000000" in result.reason
    assert read_processor(process.pid).total - before < 2.0
    assert client.set(rate=51.0)[0].successful
