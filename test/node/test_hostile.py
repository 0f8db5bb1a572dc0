# SPDX-License-Identifier: Apache-2.0
"""Malformed commands in large numbers: no crash, no motion, all counted, constant memory."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.parameter import Parameter
from std_srvs.srv import SetBool

from test.node import hostile
from test.node.meter import read_memory, read_processor

FLOODS = {
    "handles": (hostile.HANDLE_TOPICS, hostile.handle_commands, hostile.HANDLE_REASONS),
    "actuators": (hostile.ACTUATOR_TOPICS, hostile.actuator_commands, hostile.ACTUATOR_REASONS),
}
"""Dict from name to topics, the generator of bad commands, and the reasons of refusals."""
BATCH, AHEAD = 250, 1000
"""Number of commands at once, and largest number in transit, the depth of a topic: a slow node would lose more."""


@pytest.fixture
def publishers(client: Any) -> Callable[[dict[str, type]], dict[str, Any]]:
    """Give a function that makes a publisher of each topic, and waits until the node subscribes to it."""

    def make(topics: dict[str, type]) -> dict[str, Any]:
        made = {name: client.node.create_publisher(kind, client.full(name), AHEAD) for name, kind in topics.items()}
        client.wait(lambda: all(publisher.get_subscription_count() for publisher in made.values()))
        return made

    return make


@pytest.mark.parametrize("kind", FLOODS)
@pytest.mark.parametrize("count", [3000, pytest.param(50_000, marks=pytest.mark.torture)])
def test_hostile_commands_change_nothing(
    client: Any, launch: Callable, coarse: dict, publishers: Callable, kind: str, count: int
) -> None:
    """Thousands of bad commands per second are all counted, mesh and memory stay, and the node ends in order."""
    topics, make, reasons = FLOODS[kind]
    process = launch(**(coarse if kind == "handles" else {"scene": "tendon_finger"}), command_max_age=1.0)
    targets, commands, first = publishers(topics), make(1), client.mesh()

    def refused() -> int:
        client.spin(0.06)
        told = [value for part in client.last("/diagnostics").status for value in part.values]
        return next((int(value.value) for value in told if value.key == "commands refused"), 0)

    for sent in range(0, count, BATCH):
        client.wait(lambda sent=sent: sent + BATCH - refused() <= AHEAD)
        if sent <= AHEAD:
            before = read_memory(process.pid)
        for topic, data in itertools.islice(commands, BATCH):
            targets[topic].publish(data)
    client.wait(lambda: refused() >= count)
    values = client.diagnostics()
    counts = {key: int(value) for key, value in values.items() if key.startswith("refused: ")}
    assert int(values["commands refused"]) == sum(counts.values()) == count
    assert all(counts[f"refused: {reason}"] > count / 500 for reason in reasons), counts
    assert all(np.array_equal(mesh, first) for mesh in client.meshes())
    assert read_memory(process.pid) - before < 4_000_000
    assert process.stop() == 0


def test_good_commands_work_among_bad_ones(client: Any, start: Callable, coarse: dict, publishers: Callable) -> None:
    """Among bad commands, which are counted, a good one is carried out."""
    start(**coarse, command_max_age=1.0)
    client.target(0.05)
    commands = hostile.handle_commands(2)
    targets = publishers(hostile.HANDLE_TOPICS)
    for topic, data in itertools.islice(commands, 200):
        targets[topic].publish(data)
    client.target(0.06)
    client.wait(lambda: int(client.diagnostics()["commands refused"]) >= 200)
    client.wait_taken(2)
    client.wait(lambda: client.mesh()[:, 5].max() == pytest.approx(0.06, abs=1e-6))
    values = client.diagnostics()
    assert (values["commands refused"], values["commands taken"]) == ("200", "2")


@pytest.mark.parametrize(
    "text", ["\x1b[2J\a\r\n[ERROR] [1.0] [gdfe_sim]: forged", "\u202ereversed", "z" * 2_000_000, "x" * 300]
)
def test_texts_of_requests_are_plain_in_the_log(client: Any, launch: Callable, coarse: dict, text: str) -> None:
    """Control characters, forged entries and megabytes in names, labels and paths do not reach the log.

    Before, a path erased the terminal, a label of 2 MB became an entry of 2 MB, and the log had a forged error.
    """
    process = launch(**coarse)
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


def test_lists_of_requests_are_limited(client: Any, launch: Callable, coarse: dict) -> None:
    """A list of 10001 parameters is refused, and 10000 names are answered.

    Before, rclpy answered a request for 500000 names in 15 s, in which the node answered nothing else.
    """
    launch(**coarse)
    ask = lambda count: client.call(GetParameters, "get_parameters", GetParameters.Request(names=["rate"] * count))  # noqa: E731
    assert len(ask(10_000).values) == 10_000
    assert len(ask(10_001).values) == 0
    rate = Parameter("rate", value=7.0).to_parameter_msg()
    results = client.call(SetParameters, "set_parameters", SetParameters.Request(parameters=[rate] * 10_001)).results
    assert not any(result.successful for result in results)
    assert results[0].reason == "parameters has 10001 entries; allowed: up to 10000"
    assert ask(1).values[0].double_value != 7.0


def test_a_flood_of_requests_does_not_fill_the_log(client: Any, launch: Callable, coarse: dict) -> None:
    """Of hundreds of refused transitions, the log has at most 100 in five seconds, and how many it left out."""
    process = launch(**coarse)
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
    client.trigger("reset")
    client.target(0.05)
    client.wait(lambda: client.mesh()[:, 5].max() == pytest.approx(0.05, abs=1e-6))
    client.wait(lambda: client.diagnostics()["converged"] == "True")  # the deadline may cut the step; others follow
    assert all(np.isfinite(mesh).all() for mesh in client.meshes())


def test_a_request_that_is_too_large_stays_unread(client: Any, launch: Callable, coarse: dict) -> None:
    """A request of 200000 parameters is refused with its size, and takes the node 2 s at most.

    Before, rclpy made Python objects of it for 5 to 12 s, in which the node answered nothing.
    """
    process = launch(**coarse)
    before = read_processor(process.pid).total
    many = SetParameters.Request(parameters=[Parameter("rate", value=50.0).to_parameter_msg()] * 200_000)
    (result,) = client.call(SetParameters, "set_parameters", many).results
    assert not result.successful
    assert "it has 12800004 bytes; allowed: up to 2000000" in result.reason
    assert read_processor(process.pid).total - before < 2.0
    assert client.set(rate=51.0)[0].successful
