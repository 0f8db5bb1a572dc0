# SPDX-License-Identifier: Apache-2.0
"""A busy node answers, and long work can be ended."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.srv import GetParameters
from std_srvs.srv import Trigger

from gdfe_ros.testing import forking
from gdfe_ros.testing.client import await_discovery


def _parts(client: Any) -> dict[str, DiagnosticStatus]:
    """Return a dict of the node's diagnostics by part."""
    client.status()
    return {status.name.partition(": ")[2]: status for status in client.last("/diagnostics").status}


def _reasons(client: Any) -> list[str]:
    """Return the messages of every part of all diagnostics so far."""
    client.spin(0.1)
    return [status.message for message in client.received["/diagnostics"] for status in message.status]


def _begin(client: Any, kind: type, name: str, request: Any) -> Any:
    """Call a service without waiting for its answer; return the future."""
    service = client.node.create_client(kind, client.full(name))
    client.wait(service.service_is_ready)
    await_discovery(client.node, "/gdfe_sim", client.wait)
    return service.call_async(request)


def test_many_steps_leave_the_node_responsive_and_can_be_ended(client: Any, launch: Callable, coarse: dict) -> None:
    """During a million requested steps, other services answer, a second request is refused, and ~/pause ends them."""
    launch(**coarse, clock="lockstep", step_count=1_000_000)
    walk = _begin(client, Trigger, "step", Trigger.Request())
    client.wait(lambda: client.record().step > 10)
    assert client.state() == "active"
    assert client.set(rate=50.0)[0].successful
    second = client.call(Trigger, "step", Trigger.Request())
    assert not second.success
    assert "of 1000000 steps; ~/pause or ~/reset ends it" in second.message
    assert "of 1000000 steps" in client.diagnostics()["working on"]
    assert not walk.done()
    client.switch("pause", True)
    client.wait(walk.done)
    assert not walk.result().success
    assert walk.result().message.startswith("~/pause ended it; ")
    client.set(step_count=3)
    assert client.call(Trigger, "step", Trigger.Request()).message.startswith("3 steps, time ")


def test_a_node_that_ends_answers_those_who_wait(client: Any, launch: Callable, coarse: dict) -> None:
    """A deactivation during a million requested steps answers their request with the reason."""
    launch(**coarse, clock="lockstep", step_count=1_000_000)
    walk = _begin(client, Trigger, "step", Trigger.Request())
    client.wait(lambda: client.record().step > 10)
    assert client.transition("deactivate")
    client.wait(walk.done)
    assert (walk.result().success, walk.result().message) == (False, "the stepping has ended")


def test_a_node_that_is_being_configured_answers(client: Any, start: Callable) -> None:
    """While configure factors a fine mesh, the node gives state and parameters, and refuses transitions."""
    start(scene="bend5", scene_overrides=["mesh.bar.cells=[90, 20, 20]"], autostart=False)
    request = ChangeState.Request()
    request.transition.label = "configure"
    configured = _begin(client, ChangeState, "change_state", request)
    client.wait(lambda: client.state() == "configuring")
    assert client.call(GetParameters, "get_parameters", GetParameters.Request(names=["scene"])).values
    for label in ("configure", "transition_success"):
        assert not client.transition(label)
    assert not configured.done()
    client.wait(configured.done)
    assert configured.result().success
    assert client.state() == "inactive"
    assert client.transition("activate")
    client.wait(client.records)


def test_a_long_solve_is_ended_where_somebody_waits_for_its_end(client: Any, start: Callable) -> None:
    """Long solves report their progress, and deactivate, reset and SIGINT cut them.

    A solve may end by itself before `deactivate` arrives. The node is then kept busy once more.
    """
    fine = {"scene": "bend5", "scene_overrides": ["mesh.bar.cells=[40, 12, 12]", "solver.tolerance=1e-12"]}
    process = start(**fine, clock="lockstep")

    def is_solving() -> bool:
        return "rounds of iterations" in client.status().get("working on", "")

    def keep_busy() -> None:
        for number in range(20):
            client.target(0.2, turn=(1.5 * (-1) ** number, 0.0, 0.0))
        client.wait(is_solving)

    def deactivation_cuts() -> bool:
        keep_busy()
        assert client.transition("deactivate")
        end = time.monotonic() + 20.0
        client.wait(lambda: client.records()[-1].cut or time.monotonic() > end)
        cut = client.records()[-1].cut
        assert client.transition("activate")
        return cut

    assert any(deactivation_cuts() for _ in range(5))
    keep_busy()
    assert client.call(Trigger, "reset", Trigger.Request()).message == "at rest, time 0"
    client.wait(lambda: client.records()[-1].time == 0.0)
    keep_busy()
    assert process.stop() == 0


def test_diagnostics_come_in_parts(client: Any, start: Callable, coarse: dict) -> None:
    """After a refused command in lockstep, diagnostics of commands warn with the reason and the awaited inputs."""
    start(**coarse, clock="lockstep", command_set=["handles/tip/target", "handles/tip/velocity"])
    client.target(0.01)
    client.wait_taken(1)
    parts = _parts(client)
    assert list(parts) == ["simulation", "solver", "commands", "recording", "clock"]
    assert parts["commands"].message == "waits for ~/handles/tip/velocity"
    # Nodes of the same name that another test has killed are remembered for some seconds, and warned of.
    client.wait(lambda: {part.level for part in _parts(client).values()} == {DiagnosticStatus.OK})
    client.target(1e9)
    client.wait(lambda: "1 commands refused since the last report; the log says why" in _reasons(client))
    client.wait(lambda: _parts(client)["commands"].level == DiagnosticStatus.OK)
    assert parts["recording"].message == "no bag"
    assert parts["clock"].message == "lockstep"


def test_a_second_node_and_a_second_clock_are_told(client: Any, start: Callable, coarse: dict) -> None:
    """Two nodes with one name that both publish /clock warn in the log and on /diagnostics."""
    first = start(**coarse, clock="lockstep", publish_clock=True)
    start(**coarse, clock="lockstep", publish_clock=True)
    client.wait(lambda: "2 nodes are called /gdfe_sim" in first.log and "2 publishers of /clock" in first.log)
    assert client.wait(lambda: any("2 nodes are called /gdfe_sim" in reason for reason in _reasons(client)))


@pytest.mark.parametrize(
    ("arguments", "status", "said"),
    [
        (["--help"], 0, ["usage: sim_node", "command_set"]),
        (["bend5"], 2, ["unknown arguments bend5"]),
        (["--ros-args", "--params-file", "/nonexistent.yaml"], 2, ["/nonexistent.yaml"]),
        (["--ros-args", "--params-file", "BROKEN"], 2, ["params file"]),
        (["--ros-args", "-p", "rate:=fast"], 2, ["rate"]),
    ],
)
def test_bad_arguments_end_with_a_line_not_a_traceback(
    tmp_path: Path, arguments: list[str], status: int, said: list[str]
) -> None:
    """Help, unknown arguments, and missing or broken parameter files give a clear text without a traceback."""
    broken = tmp_path / "broken.yaml"
    broken.write_text("a: [b\n c: d", encoding="utf-8")
    given = [str(broken) if argument == "BROKEN" else argument for argument in arguments]
    log = tmp_path / "log.txt"
    found = forking.start(given, log, os.environ).wait(300)
    text = log.read_text(encoding="utf-8")
    assert found == status, text
    assert all(words in text for words in said)
    assert "Traceback" not in text
    assert "/project/src" not in text.replace("[ERROR]", "")
