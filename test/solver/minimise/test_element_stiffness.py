# SPDX-License-Identifier: Apache-2.0
"""The tangent stiffness of an element is the derivative of its corner forces, for every law and shape."""

from __future__ import annotations

import numpy as np
import pytest

from gdfe_ros.materials import Material
from gdfe_ros.mesh import HexMesh
from gdfe_ros.solver.elements.barrier import NONE
from gdfe_ros.solver.elements.response import evaluate
from gdfe_ros.solver.elements.tangent_rows import element_tangents
from gdfe_ros.solver.minimise.level import add_wall_tangents

SPACING = 1e-6
"""Spacing of the differences over the element's edge of 0.1 m."""


@pytest.mark.parametrize("stretch", [1.0, 0.1], ids=["whole", "against the wall"])
def test_it_is_the_derivative_of_the_corner_forces(make_body, element: HexMesh, law: Material, stretch: float) -> None:
    """The tangent stiffness equals central differences of the corner forces at a random shape, under pressure."""
    body = make_body(element, law)
    x = body.rest * (1.1, 0.9, stretch) + np.random.default_rng(1).uniform(-4e-3, 4e-3, body.rest.shape) * stretch
    watched = NONE if stretch == 1.0 else np.zeros(1, np.int32)
    given = body.shape, body.blocks, body.material, np.full(1, 1e3), np.full(1, 0.7), body.table
    tangent, columns = np.zeros((1, 24, 24)), np.empty((24, 24))
    element_tangents(x, *given, tangent)
    scratch = np.zeros((1, 8, 3)), np.zeros(1)
    add_wall_tangents(x, watched, body.shape, body.material, body.table, *scratch, tangent)
    for column in range(24):
        sides = []
        for sign in (1.0, -1.0):
            moved, force = x.copy(), np.zeros((1, 8, 3))
            moved[body.cells[0, column // 3], column % 3] += sign * SPACING
            evaluate(moved, *given, watched, force, np.zeros(1), None)
            sides.append(force[0].ravel())
        columns[column] = (sides[0] - sides[1]) / (2.0 * SPACING)
    assert np.abs(tangent[0] - columns).max() < 1e-6 * np.abs(columns).max()
    assert np.abs(tangent[0] - tangent[0].T).max() < 1e-7 * np.abs(columns).max()
