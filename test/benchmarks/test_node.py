# SPDX-License-Identifier: Apache-2.0
"""The node's benchmark in small: real processes and consistent figures."""

from __future__ import annotations

import pytest

from benchmarks.node import cost, latency
from gdfe_ros.threads import COURIER, RECORDER


def test_a_command_takes_longer_than_its_solve() -> None:
    """In 20 round trips, the medians are below the percentiles, and the solve is shorter than the whole."""
    found = latency.measure(500, steps=20)
    assert 0.0 < found.solve_p50 < found.p50 <= found.p99
    assert found.solve_p50 <= found.solve_p99


def test_what_a_step_costs_is_told_by_thread() -> None:
    """For 100 commands with subscribers and a bag, each working thread has a positive processor time."""
    found = cost.measure(500, subscribed=True, recorded=True, steps=100)
    assert found.period == pytest.approx(found.solve + found.delay)
    assert found.alone > 0.0
    assert found.threads[COURIER] > 0.0
    assert found.threads[RECORDER] > 0.0
