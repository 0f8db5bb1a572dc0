# SPDX-License-Identifier: Apache-2.0
"""The tests of SOFA (github.com/sofa-framework/sofa) that state a figure for a solid, by their rules."""

from __future__ import annotations

import numpy as np

from benchmarks.public_cases import Row, simulate, solve
from benchmarks.public_cases.mujoco_tests import vertex_forces

SMALL = 1e-4
"""Factor on the tractions and the bounds of the cylinder: SOFA's law is linear at strains of 60 %, ours is not."""
TRACTIONS, MODULI, RATIOS = (0.6, 0.2, -0.2, -0.6), (1.0, 2.0), (0.0, 0.3, 0.49)
ROUNDING = 1e4 * float(np.finfo(np.float64).eps)
"""Bound of SOFA's test of the cube [N]: ten thousand times the precision."""


def sofa_rows() -> list[Row]:
    """Return a row for each test."""
    return [_cube(), *_cylinder()]


def _cube() -> Row:
    body = simulate("pulled_cube").stepper.body
    forces = vertex_forces(body, body.rest * [1.1, 1.0, 1.0])
    expected = np.zeros_like(forces)
    expected[:, 0] = np.where(body.rest[:, 0] > body.rest[:, 0].mean(), 0.25, -0.25)
    wrong = np.abs(forces - expected).max(axis=0)
    along, across = float(wrong[0]), float(wrong[1:].max())
    return Row(
        source="SOFA, HexahedronFEMForceField_test",
        path="Sofa/Component/SolidMechanics/FEM/Elastic/tests/HexahedronFEMForceField_test.cpp",
        body="a unit cube of one cell with E = 10 and nu = 0 is stretched by 10 %",
        rule=f"0.25 N at each vertex along x, none across, within {ROUNDING:.1e} N",
        figure=f"along x within {along:.1e} N, across {across:.4f} N",
        value=max(along, across),
        bound=ROUNDING,
    )


def _cylinder() -> list[Row]:
    found = np.abs([_strains(*case) for case in cylinder_cases()]).max(axis=0)
    given = {
        "source": "SOFA, LinearElasticity_test",
        "path": "applications/plugins/SofaTest/SofaTest_test/LinearElasticity_test.cpp",
        "revision": "01799b6c405275871c034d9a15485368204cc41e",
    }
    return [
        Row(
            **given,
            body=body,
            rule=f"{kind} strain {formula}, within {bound:g} ({SMALL * bound:g} at {SMALL:g} of their tractions)",
            figure=f"within {wrong:.1e}",
            value=float(wrong),
            bound=SMALL * bound,
        )
        for body, kind, formula, bound, wrong in (
            ("a cylinder under traction, 24 cases of p, E and nu", "longitudinal", "p / E", 1e-4, found[0]),
            ("the same cylinder", "radial", "-nu p / E", 2e-4, found[1]),
        )
    ]


def cylinder_cases() -> list[tuple[float, float, float]]:
    """Return traction [Pa], Young's modulus [Pa] and Poisson's ratio of each case."""
    return [(SMALL * pull, young, ratio) for young in MODULI for ratio in RATIOS for pull in TRACTIONS]


def _strains(pull: float, young: float, ratio: float) -> tuple[float, float]:
    """Return by how much the longitudinal and the radial strain at half height differ from Hooke's law."""
    material = {"law": "linear", "young": young, "poisson": ratio}
    simulation = simulate("pulled_cylinder", materials__soft=material, loads__pull__surface__traction=[pull, 0.0, 0.0])
    along, side, _ = solve(simulation).probe_positions()["side"]
    return along / 0.5 - 1.0 - pull / young, side / 0.2 - 1.0 + ratio * pull / young
