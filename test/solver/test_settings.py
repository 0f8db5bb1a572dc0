# SPDX-License-Identifier: Apache-2.0
"""Settings of the solver are checked when they are made."""

from __future__ import annotations

import math
from typing import Any

import pytest

from gdfe_ros.solver.settings import Policy, SolverSettings, Torsion


def test_defaults() -> None:
    """Make settings of nothing: the energy policy at 1e-4, steps chosen by the solver."""
    settings = SolverSettings()
    assert (settings.policy, settings.tolerance, settings.steps) == (Policy.ENERGY, 1e-4, None)


def test_policy_may_be_named_by_text() -> None:
    """Give the text of a YAML file: the enum comes out; an unknown one is refused."""
    assert SolverSettings(policy="relative").policy is Policy.RELATIVE
    with pytest.raises(ValueError, match="newton"):
        SolverSettings(policy="newton")


def test_sections_are_refused_beside_the_policy_relative() -> None:
    """Ask for sections where there is no hourglass energy; both may be named by text."""
    assert SolverSettings(torsion="section").torsion is Torsion.SECTION
    with pytest.raises(ValueError, match="relative has no hourglass energy; leave it out"):
        SolverSettings(policy="relative", torsion="section")


@pytest.mark.parametrize("tolerance", [0.0, -1e-4, 1e-13, 0.2, math.nan, math.inf])
def test_tolerance_is_checked(tolerance: float) -> None:
    """Refuse tolerances that cannot be reached or mean nothing; name the range and the value."""
    with pytest.raises(ValueError, match=r"tolerance must lie in 1e-12 \.\. 1e-1, got"):
        SolverSettings(tolerance=tolerance)


@pytest.mark.parametrize("name", ["steps", "max_iterations"])
@pytest.mark.parametrize("value", [0, -1, 1_000_001])
def test_counts_are_checked(name: str, value: int) -> None:
    """Refuse counts that are not between one and a million."""
    options: dict[str, Any] = {name: value}
    with pytest.raises(ValueError, match=rf"{name} must lie in 1 \.\. 1000000, got"):
        SolverSettings(**options)


@pytest.mark.parametrize("threads", [0, 1025])
def test_threads_are_checked(threads: int) -> None:
    """Refuse numbers of threads that no machine has."""
    with pytest.raises(ValueError, match=r"threads must lie in 1 \.\. 1024, got"):
        SolverSettings(threads=threads)
