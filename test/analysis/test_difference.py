# SPDX-License-Identifier: Apache-2.0
"""The threshold between small and large differences of two runs."""

from __future__ import annotations

import numpy as np
import pytest

from gdfe_ros.analysis.difference import Difference, Differences
from gdfe_ros.analysis.difference_table import unit_of
from gdfe_ros.analysis.message_values import Values
from gdfe_ros.scene import load_scene

TOLERANCE = 1e-8


def _differences() -> Differences:
    return Differences(load_scene("bend5", overrides={"solver.tolerance": TOLERANCE, "mesh.bar.cells": [10, 1, 1]}))


def _record(*, converged: bool, error_estimate: float) -> Values:
    return {"converged": np.array([float(converged)]), "error_estimate": np.array([error_estimate])}


def _step(gap: float, *, converged: bool, error_estimate: float) -> tuple[dict[str, Values], dict[str, Values]]:
    """Return one step of two runs whose positions differ by ``gap`` times the body's size of 0.5 m."""
    record = _record(converged=converged, error_estimate=error_estimate)
    first, second = np.array([0.1, 0.2]), np.array([0.1, 0.2 + 0.5 * gap])
    return {"step_record": record, "mesh": {"x": first}}, {"step_record": dict(record), "mesh": {"x": second}}


@pytest.mark.parametrize(
    ("gap", "converged", "error_estimate", "verdict"),
    [
        (5e-8, True, 9e-9, Difference.WITHIN),
        (5e-7, True, 9e-9, Difference.DIFFERENT),
        (5e-7, False, 9e-8, Difference.WITHIN),
        (5e-6, False, 9e-8, Difference.DIFFERENT),
    ],
)
def test_a_step_is_judged_by_what_it_was_solved_to(
    gap: float, converged: bool, error_estimate: float, verdict: Difference
) -> None:
    """A converged step may differ by ten tolerances, a step cut by a deadline by ten times its error estimate."""
    differences = _differences()
    differences.add((0, 0), *_step(gap, converged=converged, error_estimate=error_estimate))
    assert differences.verdict(10.0) is verdict
    needed = differences.factor_needed()
    assert 0.0 < needed < gap / (TOLERANCE if converged else error_estimate)
    assert differences.verdict(needed * (1.0 + 1e-9)) is Difference.WITHIN


def test_a_cut_step_excuses_no_other() -> None:
    """A difference that is allowed in a cut step is too large in a converged step."""
    differences = _differences()
    differences.add((0, 0), *_step(5e-5, converged=False, error_estimate=1e-5))
    assert differences.verdict(10.0) is Difference.WITHIN
    differences.add((1, 0), *_step(5e-5, converged=False, error_estimate=1e-7))
    assert differences.verdict(10.0) is Difference.WITHIN  # it went on from the first
    differences.add((2, 0), *_step(4e-5, converged=True, error_estimate=1e-9))
    assert differences.verdict(10.0) is Difference.DIFFERENT


def test_whether_a_step_converges_is_judged_only_where_it_did() -> None:
    """A step that converges only in the first run counts as different, but not one that does so only in the second."""
    for converged, verdict in ((True, Difference.DIFFERENT), (False, Difference.WITHIN)):
        differences = _differences()
        first, second = ({"step_record": _record(converged=c, error_estimate=5e-8)} for c in (converged, not converged))
        differences.add((0, 0), first, second)
        assert differences.verdict(10.0) is verdict


@pytest.mark.parametrize(
    ("field", "unit"),
    [
        ("ux", "m"),
        ("vy", "m/s"),
        ("wrench.force.z", "N"),
        ("pose.position.x", "m"),
        ("position", ""),
        ("pose.orientation.x", ""),
        ("orientation.x", ""),
        ("angular_velocity.x", "rad/s"),
        ("linear_acceleration.z", "m/s^2"),
        ("energies.kinetic", "J"),
    ],
)
def test_fields_have_their_units(field: str, unit: str) -> None:
    """A component's unit is that of its vector, if the component belongs to one."""
    assert unit_of(field) == unit
