# SPDX-License-Identifier: Apache-2.0
"""A node that cannot keep its rate says so: in the log, and in the report of its bag."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import TwistStamped

from gdfe_ros.cli import main
from gdfe_ros.node.driving.pace import Lateness


@dataclass
class _Pace:
    """Counters of a pace."""

    overruns: int = 0
    late: float = 0.0
    moment: int = 0
    behind: float = 0.0


def test_a_warning_has_what_was_asked_and_reached() -> None:
    """Ten steps at 100 Hz that end 0.1 s late in sum reach 50 Hz; the warning comes once in five seconds."""
    lateness = Lateness()
    assert lateness.look(None, steps=0, rate=100.0, at=0.0) is None
    assert lateness.look(_Pace(), steps=10, rate=100.0, at=0.1) is None
    text = lateness.look(_Pace(overruns=9, late=0.1), steps=20, rate=100.0, at=0.2)
    assert text.startswith("the simulation, at 0.2 s, falls behind wall time")
    assert "rate asked 100 Hz, reached 50 Hz, late by 0.100 s so far" in text
    assert "slew_time" not in text
    assert lateness.look(_Pace(overruns=20, late=0.3), steps=30, rate=100.0, at=0.3) is None
    slow = Lateness().look(_Pace(overruns=9, late=0.1), steps=20, rate=100.0, at=0.2, slewing=True)
    assert "a command crosses its range in slew_time / dt steps, with a smaller slew_time in fewer" in slow
    text = lateness.look(_Pace(behind=2.0), steps=40, rate=100.0, at=0.4)
    assert text.startswith("the simulation, at 0.4 s, is 2.000 s behind the clock")


def test_a_node_that_is_too_slow_warns_and_its_report_shows_it(
    client: Any, launch: Callable, coarse: dict, tmp_path: Path
) -> None:
    """At 5000 Hz, the log has a warning, and the report has wall time beside simulation time, and a plot."""
    process = launch(**coarse, rate=5000.0, dt=0.0002, record=True, bag_path=str(tmp_path / "bag"))
    for step in range(60):
        client.target(0.001 * (step + 1))
        client.spin(0.02)
    client.wait(lambda: "falls behind wall time: rate asked 5000 Hz" in process.log)
    assert process.stop() == 0
    assert main(["report", str(tmp_path / "bag"), "--out", str(tmp_path / "report.html")]) == 0
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "wall time" in text
    assert "of real time, late by up to" in text
    assert "Lateness" in text
    assert "faster than real time" not in text


@pytest.mark.parametrize("moving", [True, False])
def test_time_in_which_a_node_was_stopped_is_skipped(client: Any, launch: Callable, coarse: dict, moving: bool) -> None:
    """After a SIGSTOP of 4 s, no step on the wall clock is longer than before, and overruns count the lost time.

    Before, the simulation gained up to 6 s in a few long steps.
    """
    process = launch(**coarse, rate=50.0, dt=0.02, heartbeat=0.5, velocity_timeout=1000.0)
    twist = TwistStamped()
    twist.twist.linear.z = 0.002 if moving else 0.0
    client.publish("handles/tip/velocity", twist)
    client.wait(lambda: len(client.records()) >= 4)
    before, count = client.diagnostics(), len(client.records())
    began = time.monotonic()
    os.kill(process.pid, signal.SIGSTOP)
    time.sleep(4.0)
    os.kill(process.pid, signal.SIGCONT)
    client.wait(lambda: len(client.records()) >= count + 4)
    after = client.diagnostics()
    simulated = float(after["simulation time [s]"]) - float(before["simulation time [s]"])
    assert simulated < time.monotonic() - began - 3.0 + (0.0 if moving else 0.5)
    steps = np.diff([record.time for record in client.records()[count - 1 :]])
    assert steps.max() < (0.03 if moving else 1.6), steps
    assert int(after["overruns"]) - int(before["overruns"]) > 100
