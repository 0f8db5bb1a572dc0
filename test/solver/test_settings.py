# SPDX-License-Identifier: Apache-2.0
"""Solver settings are checked when they are made."""

from __future__ import annotations

import math
from typing import Any

import pytest

from gdfe_ros.solver.settings import Policy, SolverSettings, Torsion


def test_defaults() -> None:
    """The default settings are the energy policy with a tolerance of 1e-4 and steps chosen by the solver."""
    settings = SolverSettings()
    assert (settings.policy, settings.tolerance, settings.steps) == (Policy.ENERGY, 1e-4, None)


def test_policy_may_be_named_by_text() -> None:
    """A policy given as text becomes the enum, and an unknown one is refused."""
    assert SolverSettings(policy="relative").policy is Policy.RELATIVE
    with pytest.raises(ValueError, match="newton"):
        SolverSettings(policy="newton")


def test_sections_are_refused_beside_the_policy_relative() -> None:
    """Torsion and policy may be given as text; torsion by sections with the policy relative is refused."""
    assert SolverSettings(torsion="section").torsion is Torsion.SECTION
    with pytest.raises(ValueError, match="relative has no hourglass energy; leave it out"):
        SolverSettings(policy="relative", torsion="section")


@pytest.mark.parametrize("tolerance", [0.0, -1e-4, 1e-13, 0.2, math.nan, math.inf])
def test_tolerance_is_checked(tolerance: float) -> None:
    """A tolerance that is impossible is refused with its range and the given value."""
    with pytest.raises(ValueError, match=r"tolerance = .*: allowed is a number: 1e-12 <= .* <= 0\.1"):
        SolverSettings(tolerance=tolerance)


@pytest.mark.parametrize("name", ["steps", "max_iterations"])
@pytest.mark.parametrize("value", [0, -1, 1_000_001])
def test_counts_are_checked(name: str, value: int) -> None:
    """Iteration counts that are not between one and a million are refused."""
    options: dict[str, Any] = {name: value}
    with pytest.raises(ValueError, match=rf"{name} = {value}: allowed is a whole number: 1 <= .* <= 1e\+06"):
        SolverSettings(**options)


@pytest.mark.parametrize("threads", [0, 1025])
def test_threads_are_checked(threads: int) -> None:
    """Numbers of threads that no machine has are refused."""
    with pytest.raises(ValueError, match=rf"threads = {threads}: allowed is a whole number: 1 <= .* <= 1024"):
        SolverSettings(threads=threads)
