# SPDX-License-Identifier: Apache-2.0
"""A node that is forked off a prepared process, and one that is started afresh: the same to whoever asks."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable

import pytest

from gdfe_ros.testing import NodeProcess, forking

COARSE = {"scene": "bend5", "scene_overrides": ["mesh.bar.cells=[10, 1, 1]"]}


def _afresh(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(forking, "_SERVER", [])


def _forked(monkeypatch: pytest.MonkeyPatch) -> None:
    forking.prepare()


@pytest.fixture(params=[_afresh, _forked])
def start(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> type[NodeProcess]:
    """Give nodes that are started by either method."""
    request.param(monkeypatch)
    return NodeProcess


def _wait(done: Callable[[], bool]) -> None:
    end = time.monotonic() + 300.0
    while not done():
        assert time.monotonic() < end
        time.sleep(0.02)


def test_a_node_logs_and_ends_by_a_signal(start: type[NodeProcess]) -> None:
    """Wait until it is active, send SIGTERM: it ends in good order, and its log is its own."""
    with start(COARSE) as node:
        _wait(lambda: "active, clock wall" in node.log)
        assert node.running
        assert node.stop(signal.SIGTERM) == 0
        assert not node.running


def test_a_killed_node_says_which_signal_it_was(start: type[NodeProcess]) -> None:
    """Kill it while it starts: the status is the negative number of the signal."""
    with start(COARSE) as node:
        assert node.stop(signal.SIGKILL) == -signal.SIGKILL


def test_a_node_that_cannot_start_says_why(start: type[NodeProcess]) -> None:
    """Ask for a rate of zero: status 2, one line."""
    with start({"rate": 0}) as node:
        assert node.wait() == 2
        assert node.log == "sim_node: parameter rate is 0; allowed: 0.01 to 10000 Hz\n"


def test_a_node_has_the_environment_of_its_caller(start: type[NodeProcess], monkeypatch: pytest.MonkeyPatch) -> None:
    """Set a ROS domain that there is none of: the node meets it, and ends."""
    monkeypatch.setenv("ROS_DOMAIN_ID", "9999")
    with start(COARSE) as node:
        assert node.wait() != 0
        assert "domainId is over 232" in node.log
