# SPDX-License-Identifier: Apache-2.0
"""Rates of environments stepped alone, in threads and in processes, and their table."""

from __future__ import annotations

import pytest

from benchmarks import environments
from benchmarks.environments import Way, environment_table


@pytest.mark.parametrize("way", Way)
def test_each_way_makes_its_steps(way: Way, monkeypatch: pytest.MonkeyPatch) -> None:
    """With each method, three steps of a scene are counted and timed."""
    monkeypatch.setattr(environments, "STEPS", 3)
    found = environments._run("bending_tube", way)
    assert found["steps"] == 3
    assert found["rate"] > 0.0
    if way is not Way.PROCESSES:
        assert found["converged"] == 3 * (1 if way is Way.ALONE else 2)
        assert found["reset"] > 0.0


def test_the_table_has_a_row_for_each_scene() -> None:
    """The table has a row per scene, with rates of three digits and the reset's time in steps."""
    rates = dict(zip((way.value for way in Way), (12.345, 15.0, 24.5), strict=True))
    item = {"scene": "arm", "cells": 96, "rates": rates, "steps": 100, "converged": 99, "reset": 3.21}
    assert environment_table([item]).splitlines()[-1] == "| arm | 96 | 12.3 | 15 | 24.5 | 99 of 100 | 3.2 |"
