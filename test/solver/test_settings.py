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


def test_policy_and_torsion_may_be_named_by_text() -> None:
    """A policy and a torsion given as text become enums."""
    assert SolverSettings(policy="relative").policy is Policy.RELATIVE
    assert SolverSettings(torsion="section").torsion is Torsion.SECTION


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"policy": "newton"}, "newton"),
        ({"policy": "relative", "torsion": "section"}, "relative has no hourglass energy; leave it out"),
        *(
            ({"tolerance": value}, r"tolerance = .*: allowed is a number: 1e-12 <= .* <= 0\.1")
            for value in (0.0, -1e-4, 1e-13, 0.2, math.nan, math.inf)
        ),
        *(
            ({name: value}, rf"{name} = {value}: allowed is a whole number: 1 <= .* <= {most}")
            for name, most, values in (
                ("steps", r"1e\+06", (0, -1, 1_000_001)),
                ("max_iterations", r"1e\+06", (0, -1, 1_000_001)),
                ("threads", "1024", (0, 1025)),
            )
            for value in values
        ),
    ],
)
def test_unfit_settings_are_refused(given: dict[str, Any], message: str) -> None:
    """An unfit setting is refused with its name, the given value and the range."""
    with pytest.raises(ValueError, match=message):
        SolverSettings(**given)
