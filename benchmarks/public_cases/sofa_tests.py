# SPDX-License-Identifier: Apache-2.0
"""The tests of SOFA (github.com/sofa-framework/sofa) that state a figure for a solid, by their rules."""

from __future__ import annotations

import numpy as np

from benchmarks.public_cases import Row, rows_of, simulate, solve
from benchmarks.public_cases.mujoco_tests import vertex_forces

SMALL = 1e-4
"""Factor on the tractions and the bounds of the cylinder: SOFA's law is linear at strains of 60 %, ours is not."""
TRACTIONS, MODULI, RATIOS = (0.6, 0.2, -0.2, -0.6), (1.0, 2.0), (0.0, 0.3, 0.49)


def sofa_rows() -> list[Row]:
    """Return a row for each test."""
    body = simulate("pulled_cube").stepper.body
    expected = np.zeros_like(body.rest)
    expected[:, 0] = np.where(body.rest[:, 0] > body.rest[:, 0].mean(), 0.25, -0.25)
    wrong = np.abs(vertex_forces(body, body.rest * [1.1, 1.0, 1.0]) - expected).max(axis=0)
    along, across = float(wrong[0]), float(wrong[1:].max())
    longitudinal, radial = np.abs([_strains(*case) for case in cylinder_cases()]).max(axis=0).tolist()
    return rows_of(
        {
            "cube": (max(along, across), f"along x within {along:.1e} N, across {across:.4f} N"),
            "longitudinal": (longitudinal, f"within {longitudinal:.1e}"),
            "radial": (radial, f"within {radial:.1e}"),
        }
    )


def cylinder_cases() -> list[tuple[float, float, float]]:
    """Return traction [Pa], Young's modulus [Pa] and Poisson's ratio of each case."""
    return [(SMALL * pull, young, ratio) for young in MODULI for ratio in RATIOS for pull in TRACTIONS]


def _strains(pull: float, young: float, ratio: float) -> tuple[float, float]:
    """Return by how much the longitudinal and the radial strain at half height differ from Hooke's law."""
    material = {"law": "linear", "young": young, "poisson": ratio}
    simulation = simulate("pulled_cylinder", materials__soft=material, loads__pull__surface__traction=[pull, 0.0, 0.0])
    along, side, _ = solve(simulation).probe_positions()["side"]
    return along / 0.5 - 1.0 - pull / young, side / 0.2 - 1.0 + ratio * pull / young
