# SPDX-License-Identifier: Apache-2.0
"""Convergence of quadratic tetrahedra with the mesh, also for nearly incompressible materials."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from gdfe_ros.materials import Linear, Material, NeoHookean
from gdfe_ros.mesh import HexMesh, TetMesh, bar
from gdfe_ros.mesh.assembly import keep_cells
from gdfe_ros.mesh.cells.tetrahedra import POINTS, quadratic_weights
from gdfe_ros.mesh.generators import sphere
from gdfe_ros.mesh.tetmesh import divide
from test.solver.tetrahedra.linear import displacements, pushed, round_faces, snapped, starred, stresses

INNER, OUTER, PRESSURE = 0.05, 0.1, 1.0


def ball(cells: int, *, curved: bool = True) -> TetMesh:
    """Return a mesh of an eighth of a hollow ball."""
    whole = sphere(INNER, OUTER, [cells, cells // 2])
    mesh = starred(keep_cells(whole, (whole.centroids > 0.0).all(axis=1)))
    return snapped(mesh, INNER, OUTER) if curved else mesh


def lame(points: NDArray[np.float64], law: Material) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return displacements [m] and stresses [Pa] of a hollow ball under inner pressure at ``points`` (Lame)."""
    young, nu = law.young0, law.poisson
    r = np.linalg.norm(points, axis=-1, keepdims=True)
    base, decay = PRESSURE * INNER**3 / (OUTER**3 - INNER**3), OUTER**3 / r**3
    u = base / young * ((1.0 - 2.0 * nu) + 0.5 * (1.0 + nu) * decay) * points
    n = points / r
    across = np.eye(3) - n[..., :, None] * n[..., None, :]
    radial, hoop = base * (1.0 - decay), base * (1.0 + 0.5 * decay)
    return u, radial[..., None] * n[..., :, None] * n[..., None, :] + hoop[..., None] * across


def ball_errors(mesh: TetMesh, law: Material) -> tuple[float, float]:
    """Return the relative root mean square errors of displacements and of stresses."""
    force = pushed(mesh, round_faces(mesh, 0.0, 0.5 * (INNER + OUTER)), PRESSURE)
    u = displacements(mesh, law, force, mesh.vertices < 1e-12)
    exact, _ = lame(mesh.vertices, law)
    points = np.einsum("ga,eai->egi", quadratic_weights(POINTS), mesh.vertices[mesh.cells])
    found, stress = stresses(mesh, law, u), lame(points, law)[1]
    return (
        float(np.linalg.norm(u - exact) / np.linalg.norm(exact)),
        float(np.linalg.norm(found - stress) / np.linalg.norm(stress)),
    )


@pytest.mark.parametrize(
    ("law", "stress_rate"),
    [
        (Linear(young=1e5, poisson=0.3), 1.6),
        (NeoHookean(young=1e5, poisson=0.499), 1.5),
        (Linear(young=1e5, poisson=0.4999), 1.4),
    ],
    ids=["0.3", "neo-hookean 0.499", "0.4999"],
)
def test_a_ball_under_pressure_converges(law: Material, stress_rate: float) -> None:
    """Displacements converge to Lame's solution at order 2.6, to below 0.3 % with 576 cells; stresses at about 1.5."""
    (u_coarse, s_coarse), (u_fine, s_fine) = (ball_errors(ball(n), law) for n in (4, 6))
    assert u_coarse < 0.003
    assert np.log(u_coarse / u_fine) > 2.6 * np.log(1.5)
    assert s_fine < 0.02
    assert np.log(s_coarse / s_fine) > stress_rate * np.log(1.5)


def test_straight_edges_at_a_curved_boundary_cost_accuracy() -> None:
    """Straight edges at a curved boundary give ten times the displacement error of curved ones."""
    law = Linear(young=1e5, poisson=0.3)
    assert ball_errors(ball(4, curved=False), law)[0] > 10.0 * ball_errors(ball(4), law)[0]


def cook(cells: int) -> TetMesh:
    """Return Cook's membrane: a tapered panel, 48 mm wide and 44 to 16 mm high, one cell thick."""
    grid = bar([48.0, 1.0, 48.0 / cells], [cells, cells, 1])
    x, y, z = grid.vertices.T
    share = x / 48.0
    low, high = 44.0 * share, 44.0 + 16.0 * share
    return divide(HexMesh(np.stack([x, low + (y + 0.5) * (high - low), z], axis=1), grid.cells))


def cook_rise(cells: int, law: Material) -> float:
    """Return the rise of the upper right corner under a unit shear force per thickness, in plane strain."""
    mesh = cook(cells)
    faces, right = mesh.surface(), mesh.vertices[:, 0] > 48.0 - 1e-9
    force = pushed(mesh, faces[right[faces[:, :3]].all(axis=1)], np.array([0.0, 1.0 / 16.0, 0.0]))
    held = np.zeros(mesh.vertices.shape, dtype=bool)
    held[mesh.vertices[:, 0] < 1e-9] = True
    held[:, 2] = True
    u = displacements(mesh, law, force, held)
    corner = right & (mesh.vertices[:, 1] > 60.0 - 1e-9)
    return float(u[corner, 1].mean())


@pytest.mark.parametrize("poisson", [0.3333, 0.4999])
def test_cooks_membrane_does_not_lock(poisson: float) -> None:
    """The rise of Cook's membrane is within 2 % of a finer mesh and converges, for any Poisson's ratio."""
    law = Linear(young=1.0, poisson=poisson)
    rises = [cook_rise(cells, law) for cells in (4, 8, 16)]
    assert rises[1] == pytest.approx(rises[2], rel=0.02)
    assert abs(rises[2] - rises[1]) < 0.6 * abs(rises[1] - rises[0])
