# SPDX-License-Identifier: Apache-2.0
"""The node's benchmark in small: real processes and consistent figures."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import pytest

from benchmarks.node import cost, latency
from gdfe_ros.workers import COURIER, RECORDER


def test_a_command_takes_longer_than_its_solve() -> None:
    """In 20 round trips, the medians are below the percentiles, and the solve is shorter than the whole."""
    found = latency.measure(500, steps=20)
    assert 0.0 < found.solve_p50 < found.p50 <= found.p99
    assert found.solve_p50 <= found.solve_p99


def test_two_nodes_take_the_same_commands_in_turn() -> None:
    """Two nodes at once, one for each directory, have times and ratios of each figure; a solve is part of its step."""
    home = Path(__file__).parents[2]
    found = latency.compare(500, steps=10, before=home, now=home)
    for side in (found.before, found.now):
        assert 0.0 < side.own_p50 < side.p50 <= side.p99
        assert side.processor > 0.0
    assert len(found.ratios) == len(fields(found.now))
    assert min(found.ratios) > 0.0


def test_what_a_step_costs_is_told_by_thread() -> None:
    """For 100 commands with subscribers and a bag, each working thread has a positive processor time."""
    found = cost.measure(500, subscribed=True, recorded=True, steps=100)
    assert found.period == pytest.approx(found.solve + found.delay)
    assert found.alone > 0.0
    assert found.threads[COURIER] > 0.0
    assert found.threads[RECORDER] > 0.0
