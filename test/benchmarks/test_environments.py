# SPDX-License-Identifier: Apache-2.0
"""Rates of environments stepped alone, in threads and in processes, and their table."""

from __future__ import annotations

import pytest

from benchmarks.environments import Way, environment_table, run_way


@pytest.mark.parametrize("way", Way)
def test_each_way_makes_its_steps(way: Way) -> None:
    """With each method, three steps of each environment are counted and timed, and all converge."""
    found = run_way("bending_tube", way, 3)
    assert (found["steps"], found["converged"]) == (3, 1.0)
    assert found["rate"] > 0.0


def test_the_table_has_a_row_for_each_scene() -> None:
    """The table has a row per scene, with rates of three digits."""
    rates = dict(zip((way.value for way in Way), (12.345, 15.0, 24.5, 26.0), strict=True))
    item = {"scene": "arm", "cells": 96, "rates": rates, "steps": 100, "converged": 0.995}
    assert environment_table([item]).splitlines()[-1] == "| arm | 96 | 12.3 | 15 | 24.5 | 26 | 99.5 |"
