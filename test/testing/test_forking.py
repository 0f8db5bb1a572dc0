# SPDX-License-Identifier: Apache-2.0
"""A node forked from a prepared process and one started afresh behave the same."""

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
    """Return the class of nodes for either method of starting."""
    request.param(monkeypatch)
    return NodeProcess


def _wait(done: Callable[[], bool]) -> None:
    end = time.monotonic() + 300.0
    while not done():
        assert time.monotonic() < end
        time.sleep(0.02)


def test_a_node_logs_and_ends_by_a_signal(start: type[NodeProcess]) -> None:
    """An active node ends in order after SIGTERM, and has its own log."""
    with start(COARSE) as node:
        _wait(lambda: "active, clock wall" in node.log)
        assert node.running
        assert node.stop(signal.SIGTERM) == 0
        assert not node.running


def test_a_killed_node_says_which_signal_it_was(start: type[NodeProcess]) -> None:
    """The exit status of a node killed at its start is the negative number of the signal."""
    with start(COARSE) as node:
        assert node.stop(signal.SIGKILL) == -signal.SIGKILL


def test_a_node_that_cannot_start_says_why(start: type[NodeProcess]) -> None:
    """A node with a rate of zero ends with status 2 and one line."""
    with start({"rate": 0}) as node:
        assert node.wait() == 2
        assert node.log == "sim_node: parameter rate is 0; allowed: 0.01 to 10000 Hz\n"


def test_a_node_has_the_environment_of_its_caller(start: type[NodeProcess], monkeypatch: pytest.MonkeyPatch) -> None:
    """A node started with an invalid ROS_DOMAIN_ID in its environment ends with an error about it."""
    monkeypatch.setenv("ROS_DOMAIN_ID", "9999")
    with start(COARSE) as node:
        assert node.wait() != 0
        assert "domainId is over 232" in node.log
