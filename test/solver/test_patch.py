# SPDX-License-Identifier: Apache-2.0
"""Patch test: a linear displacement field is exact on any mesh (Irons)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from gdfe_ros.constraints import Handle
from gdfe_ros.materials import Material
from gdfe_ros.mesh import HexMesh
from gdfe_ros.paper.relative import RelativeEquilibrium
from gdfe_ros.results.element_fields import element_fields
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.equilibrium.energy import EquilibriumSolver
from test.solver.conftest import solve

MakeBody = Callable[..., Body]
Equilibrium = EquilibriumSolver | RelativeEquilibrium
Boundary = Callable[[HexMesh], Handle]
FIELDS = {
    "tension": np.diag([1.4, 0.9, 0.85]),
    "shear": np.array([[1.0, 0.4, 0.0], [0.0, 1.0, 0.0], [0.0, 0.2, 1.0]]),
    "all": np.array([[1.2, 0.3, -0.1], [0.1, 0.9, 0.2], [-0.2, 0.1, 1.05]]),
    "turned": np.array([[0.0, -1.2, 0.1], [0.9, 0.1, 0.2], [0.0, 0.1, 1.0]]),
}


@pytest.fixture(params=FIELDS.values(), ids=FIELDS)
def gradient(request: pytest.FixtureRequest) -> NDArray[np.float64]:
    """Give deformation gradients of a linear field."""
    return request.param


def test_linear_field_is_exact(
    make_body: MakeBody, boundary: Boundary, distorted: HexMesh, law: Material, gradient: NDArray[np.float64]
) -> None:
    """With x = F X + c on the surface of a distorted mesh, inner vertices follow and the strain is uniform."""
    body = make_body(distorted, law, [boundary(distorted)])
    exact = distorted.vertices @ gradient.T + np.array([0.5, -0.2, 0.1])
    start = distorted.vertices.copy()
    outcome = solve(EquilibriumSolver(body), start, exact, tolerance=1e-9)
    assert outcome.converged
    np.testing.assert_allclose(outcome.positions, exact, atol=1e-8 * distorted.size)
    fields = element_fields(body, outcome.positions)
    np.testing.assert_allclose(fields.J, np.linalg.det(gradient), rtol=1e-6)
    assert np.ptp(fields.eps_eq) < 1e-6
    assert np.ptp(fields.energy_density) < 1e-5 * fields.energy_density.max()


def test_rigid_motion_is_exact_for_the_relative_policy(
    make_body: MakeBody, boundary: Boundary, distorted: HexMesh, law: Material
) -> None:
    """With the relative policy, a rotated surface of a distorted mesh rotates the inside, without strain."""
    body = make_body(distorted, law, [boundary(distorted)])
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    exact = distorted.vertices @ turn.T + np.array([0.5, -0.2, 0.1])
    start = np.where(np.isin(np.arange(len(exact)), body.unknowns.free)[:, None], exact + 0.01, exact)
    outcome = solve(RelativeEquilibrium(body), start, exact, tolerance=1e-8)
    assert outcome.converged
    np.testing.assert_allclose(outcome.positions, exact, atol=1e-8 * distorted.size)
