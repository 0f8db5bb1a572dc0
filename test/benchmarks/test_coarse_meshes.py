# SPDX-License-Identifier: Apache-2.0
"""Errors with few cells across a body against closed forms, and the same problems in other codes."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from benchmarks.cases import CaseName
from benchmarks.coarse_meshes.__main__ import error, solvers
from benchmarks.coarse_meshes.calculix_linear import deck
from benchmarks.coarse_meshes.large import bar_errors
from benchmarks.coarse_meshes.own import solve
from benchmarks.coarse_meshes.problem import Found
from benchmarks.coarse_meshes.problems import PRESSURE, PROBLEMS, SIDE, torsion, tube
from benchmarks.coarse_meshes.table import TITLES
from gdfe_ros.constraints import Axis
from gdfe_ros.solver.settings import Torsion


@pytest.mark.parametrize(
    ("name", "across", "expected", "within"),
    [
        ("torsion", 1, 0.0, 1e-4),
        ("torsion", 2, 0.1392, 1e-3),
        ("bending", 1, 0.0, 2e-3),
        ("bending, nu 0.495", 2, 0.0, 2e-3),
        ("tube", 4, 0.0, 0.02),
        ("pad", 1, 9.868, 0.01),
    ],
)
def test_errors_are_those_of_the_element(name: str, across: int, expected: float, within: float) -> None:
    """The solver's error with few cells across is the known error of its element."""
    assert error(name, across, solve) == pytest.approx(expected, abs=within)


@pytest.mark.parametrize(
    ("name", "across", "within"),
    [*(("torsion", across, 1e-4) for across in (1, 2, 3, 4)), ("torsion", 6, 2e-3), ("torsion 2:1", 2, 0.01)],
)
def test_sections_twist_as_saint_venants(name: str, across: int, within: float) -> None:
    """With torsion by sections, square bars of up to four cells across are exact, and others nearly so."""
    assert error(name, across, partial(solve, torsion=Torsion.SECTION)) == pytest.approx(0.0, abs=within)


def test_a_bar_turned_by_a_right_angle_needs_the_moment_that_it_should() -> None:
    """The moment of a bar two cells across twisted by 90 degrees is 11.6 % too high by cells, and exact by sections."""
    cell, section = (bar_errors(CaseName.TWIST90_UNIFORM, (8, 2, 2), torsion) for torsion in Torsion)
    assert cell["reaction"] == pytest.approx(0.116, abs=2e-3)
    assert abs(section["reaction"]) < 5e-3
    assert section["displacement"] < 1.01 * cell["displacement"]


@pytest.mark.parametrize(
    ("code", "expected"), [("FElupe Q1P0", 0.1856), ("CalculiX C3D8I", 0.1856), ("CalculiX C3D8R", -0.083)]
)
def test_others_are_given_the_same_problem(code: str, expected: float) -> None:
    """Installed codes twist the same bar two cells across; elements with full strains and no warping give h^4 / 6."""
    found, missing = solvers()
    if code not in found:
        pytest.skip(missing[code.split()[0]])
    assert error("torsion", 2, found[code]) == pytest.approx(expected, abs=1e-3)


def test_the_pressure_in_the_tube_pulls_no_way() -> None:
    """The tube's forces sum to zero, and their work in uniform growth is the pressure times the change of volume."""
    problem = tube(2)
    np.testing.assert_allclose(problem.forces.sum(axis=0), 0.0, atol=1e-12)
    bore = 16 / 2 * SIDE**2 * np.sin(2.0 * np.pi / 16) * SIDE / 2
    assert np.vdot(problem.forces, problem.mesh.vertices) == pytest.approx(2.0 * PRESSURE * bore, rel=1e-9)


def test_torsion_measures_its_exact_field_as_one() -> None:
    """The torsion measure is one for Saint-Venant's displacement field with his torque."""
    problem = torsion(2)
    twist, places = 1e-3, problem.mesh.vertices - problem.mesh.bounds.mean(axis=0)
    moved = np.stack([0.0 * places[:, 0], -places[:, 0] * places[:, 2], places[:, 0] * places[:, 1]], axis=1) * twist
    torque = 1e5 / 2.6 * 0.14057702 * SIDE**4 * twist
    reactions = {"left": -torque * np.eye(6)[3], "right": torque * np.eye(6)[3]}
    assert problem.measure(Found(displacement=moved, reactions=reactions)) == pytest.approx(1.0, rel=1e-9)


def test_decks_hold_what_is_held_and_pull_what_is_pulled() -> None:
    """The deck of the tube has six given displacements, and a force in the plane on every vertex of the inner wall."""
    problem = tube(1)
    text = deck(problem, "C3D8I")
    assert "*ELEMENT, TYPE=C3D8I, ELSET=BODY" in text
    given = text[text.index("*BOUNDARY") : text.index("*CLOAD")].strip().splitlines()[1:]
    assert len(given) == 6
    assert all(line.endswith(",0") for line in given)
    loads = text[text.index("*CLOAD") : text.index("*NODE FILE")].strip().splitlines()[1:]
    pulled = {(int(node) - 1, int(axis) - 1): float(value) for node, axis, value in (row.split(",") for row in loads)}
    assert not any(axis == Axis.Z for _, axis in pulled)
    assert sum(abs(value) for value in pulled.values()) == pytest.approx(np.abs(problem.forces).sum(), rel=1e-6)


def test_every_problem_has_a_title() -> None:
    """Each problem has a title."""
    assert set(TITLES) == set(PROBLEMS)
