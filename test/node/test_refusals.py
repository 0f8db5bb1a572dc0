# SPDX-License-Identifier: Apache-2.0
"""Bad commands are refused with a reason and counted, and the state stays."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import pytest
from geometry_msgs.msg import PoseStamped
from rclpy.qos import qos_profile_sensor_data
from std_msgs.msg import String

from gdfe_ros.node.refusals import Reason, Refusal, RefusalLog


def test_a_best_effort_publisher_is_told_of(client: Any, start: Callable, coarse: dict) -> None:
    """Diagnostics name a best effort publisher and its topic until it is destroyed."""
    start(**coarse)
    publisher = client.node.create_publisher(PoseStamped, client.full("handles/tip/target"), qos_profile_sensor_data)
    told = "client on /gdfe_sim/handles/tip/target: best effort; allowed: reliable"
    client.wait(lambda: client.diagnostics().get("unheard") == told)
    assert client.diagnostics()["message"] == f"commands are not heard of {told}"
    client.node.destroy_publisher(publisher)
    client.wait(lambda: "unheard" not in client.diagnostics())


def test_an_unknown_parameter_is_told(client: Any, start: Callable, coarse: dict) -> None:
    """A misspelt parameter in a file is logged with the likely name; known ones give no message."""
    process = start(**coarse, ratee=5.0, **{"materials.rubber.young": 1e6, "use_sim_time": False})
    client.wait(lambda: client.received["mesh"])
    assert "parameter 'ratee' is unknown and does nothing; did you mean 'rate'?" in process.log
    assert process.log.count("is unknown and does nothing") == 1


def test_each_refusal_is_published_at_once(client: Any, start: Callable, coarse: dict) -> None:
    """Two refused targets within a second are both on ~/refused, with topic, reason and text."""
    start(**coarse)
    told: list[Any] = []
    client.node.create_subscription(String, client.full("refused"), lambda text: told.append(json.loads(text.data)), 10)
    client.wait(lambda: client.node.count_publishers(client.full("refused")))
    client.diagnostics()
    for _ in range(2):
        client.target(1e6)
    client.wait(lambda: len(told) == 2)
    assert {entry["source"] for entry in told} == {"/gdfe_sim/handles/tip/target"}
    assert {entry["reason"] for entry in told} == {"too far"}
    assert all("10 times the body's size" in entry["message"] for entry in told)


def test_warnings_are_throttled_by_input_and_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    """There is one warning in five seconds per input and reason; the next one gives the number of omitted ones."""
    now = [100.0]
    monkeypatch.setattr("gdfe_ros.untrusted.bounded_text.time.monotonic", lambda: now[0])
    warnings: list[str] = []
    log = RefusalLog(warnings.append)
    for _ in range(4):
        log.refuse("/a", Refusal(Reason.STALE, "old"))
    log.refuse("/a", Refusal(Reason.FIXED, "fixed"))
    log.refuse("/b", Refusal(Reason.STALE, "old"))
    assert len(warnings) == 3
    now[0] += 5.1
    log.refuse("/a", Refusal(Reason.STALE, "old"))
    assert warnings[-1] == "command on /a refused: old (3 more like it since the last warning)"
    assert log.counts() == {
        "commands taken": 0,
        "commands refused": 7,
        "refused: stale": 6,
        "refused: handle is fixed": 1,
    }


def test_a_refusal_of_any_length_makes_a_short_line() -> None:
    """A message that names two hundred thousand actuators is refused in a log line below 600 characters."""
    warnings: list[str] = []
    names = ", ".join(f"actuator_{k}" for k in range(200_000))
    RefusalLog(warnings.append).refuse("/a", Refusal(Reason.UNKNOWN, f"no actuator {names}; actuators: flexor"))
    assert len(warnings[0]) < 600
    assert "no actuator actuator_0," in warnings[0]
    assert warnings[0].endswith("actuators: flexor")
