# SPDX-License-Identifier: Apache-2.0
"""Errors with few cells across a body against closed forms."""

from __future__ import annotations

import pytest

from benchmarks.cases import CASES, CaseName
from benchmarks.references import load_reference, measure_error
from gdfe_ros.scene import load_scene
from gdfe_ros.simulation import Simulation
from gdfe_ros.solver.settings import Torsion
from test.solver.elements.coarse import error


@pytest.mark.parametrize(
    ("name", "across", "expected", "within"),
    [
        ("torsion", 1, 0.0, 1e-4),
        ("torsion", 2, 0.1392, 2e-4),
        ("torsion", 4, 0.0427, 1e-3),
        ("bending", 1, 0.0, 2e-3),
        ("bending, nu 0.495", 2, 0.0, 2e-3),
        ("tube", 1, -0.0835, 2e-3),
        ("tube", 2, -0.0357, 2e-3),
        ("tube", 4, -0.0105, 2e-3),
        ("pad", 1, 9.868, 0.01),
        ("pad", 2, 0.302, 2e-3),
        ("pad", 4, 0.0914, 2e-3),
    ],
)
def test_errors_are_those_of_the_element(name: str, across: int, expected: float, within: float) -> None:
    """The solver's error with few cells across is the known error of its element."""
    assert error(name, across) == pytest.approx(expected, abs=within)


@pytest.mark.parametrize(
    ("name", "across", "within"),
    [*(("torsion", across, 1e-4) for across in (1, 2, 3, 4)), ("torsion", 6, 2e-3), ("torsion 2:1", 2, 0.01)],
)
def test_sections_twist_as_saint_venants(name: str, across: int, within: float) -> None:
    """With torsion by sections, square bars of up to four cells across are exact, and others nearly so."""
    assert error(name, across, Torsion.SECTION) == pytest.approx(0.0, abs=within)


def test_a_bar_turned_by_a_right_angle_needs_the_moment_that_it_should() -> None:
    """The moment of a bar two cells across twisted by 90 degrees is 11.6 % too high by cells, and exact by sections."""
    case, reference = CASES[CaseName.TWIST90_UNIFORM], load_reference(CaseName.TWIST90_UNIFORM)
    moments, errors = {}, {}
    for torsion in Torsion:
        overrides = {"mesh.bar.cells": [8, 2, 2], "solver.tolerance": 1e-6, "solver.torsion": torsion.value}
        simulation = Simulation(load_scene(case.name.value, overrides=overrides))
        result = list(simulation.play(1))[-1]
        assert result.converged, result.message
        moved = simulation.positions - simulation.mesh.vertices
        moved = case.grid((8, 2, 2)).evaluate(moved, reference.vertices)
        moments[torsion] = result.reactions["tip"][3] / reference.reaction[3] - 1.0
        errors[torsion] = measure_error(moved, reference.displacement).mean
    assert moments[Torsion.CELL] == pytest.approx(0.116, abs=2e-3)
    assert abs(moments[Torsion.SECTION]) < 5e-3
    assert errors[Torsion.SECTION] < 1.01 * errors[Torsion.CELL]
