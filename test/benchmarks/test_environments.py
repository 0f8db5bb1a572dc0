# SPDX-License-Identifier: Apache-2.0
"""Rates of environments stepped alone, in threads and in processes, and their table."""

from __future__ import annotations

import pytest

from benchmarks.environments import Way, environment_table, gain_by_two, run_way


@pytest.mark.parametrize("way", Way)
def test_each_way_makes_its_steps(way: Way) -> None:
    """With each method, three steps of each environment are counted and timed, and all converge."""
    found = run_way("bending_tube", way, 3)
    assert (found["steps"], found["converged"]) == (3, 1.0)
    assert found["rate"] > 0.0
    if way is Way.ALONE:
        assert found["reset"] > 0.0
        assert 1.0 <= found["gain"] <= 2.0


def test_two_environments_wait_for_the_slower_one() -> None:
    """Environments with equal steps gain 2; if each has a step of 3 s where the other needs 1 s, they gain 4/3."""
    assert gain_by_two([1.0, 2.0], [1.0, 2.0]) == pytest.approx(2.0)
    assert gain_by_two([1.0, 3.0], [3.0, 1.0]) == pytest.approx(4.0 / 3.0)


def test_the_table_has_a_row_for_each_scene() -> None:
    """The table has a row per scene, with rates of three digits and the reset's time in steps."""
    rates = dict(zip((way.value for way in Way), (12.345, 15.0, 24.5, 26.0), strict=True))
    counts = {"steps": 100, "converged": 0.995, "reset": 3.21, "gain": 1.456}
    item = {"scene": "arm", "cells": 96, "rates": rates, **counts}
    assert environment_table([item]).splitlines()[-1] == "| arm | 96 | 12.3 | 15 | 24.5 | 26 | 1.46 | 99.5 | 3.2 |"
