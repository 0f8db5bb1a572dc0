# SPDX-License-Identifier: Apache-2.0
"""One element and one block of quadratic tetrahedra: forces, tangents, motions without energy, fold barrier."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from gdfe_ros.constraints import Handle
from gdfe_ros.materials import Material
from gdfe_ros.mesh import TetMesh, bar
from gdfe_ros.mesh.tetmesh import divide
from gdfe_ros.results.element_fields import corner_forces, element_fields, strain_energies, volume_pressures
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.elements.measures import least_volume_ratio
from gdfe_ros.solver.equilibrium.energy import EquilibriumSolver
from gdfe_ros.solver.minimise.level import add_wall_tangents
from gdfe_ros.solver.solution import Increment
from test.solver.tetrahedra.linear import tangents

MakeBody = Callable[..., Body]
GRADIENT = np.array([[1.2, 0.3, -0.1], [0.1, 0.9, 0.2], [-0.2, 0.1, 1.05]])


@pytest.fixture(scope="module")
def block() -> TetMesh:
    """Return a cube of 48 tetrahedra with displaced corners and straight edges."""
    mesh = bar([0.2, 0.2, 0.2], [2, 2, 2])
    inner = (np.abs(mesh.vertices - mesh.vertices.mean(axis=0)) < 0.09).all(axis=1)
    tets = divide(mesh)
    corners = np.unique(tets.cells[:, :4])
    moved = tets.vertices.copy()
    moved[corners] += np.random.default_rng(3).uniform(-0.015, 0.015, (len(corners), 3)) * (1.0 + inner[:, None])
    ends = np.array([[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]])
    moved[tets.cells[:, 4:]] = moved[tets.cells[:, ends]].mean(axis=2)
    return TetMesh(moved, tets.cells)


@pytest.fixture(scope="module")
def one(block: TetMesh) -> TetMesh:
    """Return one tetrahedron with curved edges."""
    cell = block.cells[:1]
    x = block.vertices[cell[0]] + np.random.default_rng(1).uniform(-0.004, 0.004, (10, 3))
    return TetMesh(x, np.arange(10)[None])


def moved(mesh: TetMesh, share: float, seed: int = 0) -> NDArray[np.float64]:
    """Return positions after a linear deformation and random displacements of a fraction ``share`` of the size."""
    noise = np.random.default_rng(seed).uniform(-1.0, 1.0, mesh.vertices.shape)
    return mesh.vertices @ GRADIENT.T + share * mesh.size * noise


def test_a_linear_field_is_exact(make_body: MakeBody, block: TetMesh, law: Material) -> None:
    """With x = F X on the surface, inner vertices follow, and strain and energy density are uniform."""
    surface = Handle("surface", np.unique(block.surface()).astype(np.int32))
    body = make_body(block, law, [surface])
    exact = block.vertices @ GRADIENT.T
    equilibrium = EquilibriumSolver(body)
    state = equilibrium.at_rest().with_(positions=block.vertices.copy(), base=exact)
    found = equilibrium.solve(Increment.at(state, tolerance=1e-9, limit=2000), state)
    assert found.converged
    np.testing.assert_allclose(found.positions, exact, atol=1e-8 * block.size)
    fields = element_fields(body, found.positions)
    np.testing.assert_allclose(fields.J, np.linalg.det(GRADIENT), rtol=1e-6)
    assert np.ptp(fields.energy_density) < 1e-5 * fields.energy_density.max()


@pytest.mark.exact("a shift bends the edges, which a balance to rounding feels")
def test_constant_stress_is_in_balance_to_rounding(make_body: MakeBody, block: TetMesh, law: Material) -> None:
    """In a linear field the forces on inner vertices vanish to rounding."""
    body = make_body(block, law)
    x = block.vertices @ GRADIENT.T
    force, total = corner_forces(body, x, np.full(block.n_cells, 7e3))[0], np.zeros_like(x)
    np.add.at(total, body.cells, force)
    inner = np.setdiff1d(np.arange(len(x)), block.surface())
    assert np.abs(total[inner]).max() < 1e-12 * np.abs(force).max() * len(force)


def test_forces_are_the_gradient_of_the_energy(make_body: MakeBody, one: TetMesh, law: Material) -> None:
    """The forces equal central differences of the energy at a distorted shape with a pressure."""
    body, x, pressure = make_body(one, law), moved(one, 0.02), np.full(1, 2e3)
    force, scale = corner_forces(body, x, pressure)[0][0], 1e-6 * one.size
    for a, axis in np.ndindex(10, 3):
        move = np.zeros_like(x)
        move[a, axis] = scale
        ends = [corner_forces(body, x + sign * move, pressure)[1][0] for sign in (1.0, -1.0)]
        assert (ends[0] - ends[1]) / (2.0 * scale) == pytest.approx(
            force[a, axis], rel=2e-5, abs=2e-6 * abs(force).max()
        )


def test_a_uniform_strain_has_the_energy_of_the_law(make_body: MakeBody, block: TetMesh, law: Material) -> None:
    """Under a uniform F, the energy density is that of one hexahedron, volume term included."""
    cube = bar([0.1, 0.1, 0.1], [1, 1, 1])
    whole = strain_energies(make_body(cube, law), cube.vertices @ GRADIENT.T)[0] / 1e-3
    body = make_body(block, law)
    density = strain_energies(body, block.vertices @ GRADIENT.T) / body.shape.volume
    np.testing.assert_allclose(density, whole, rtol=1e-9)
    force = corner_forces(body, block.vertices @ GRADIENT.T, volume_pressures(body, block.vertices @ GRADIENT.T))[0]
    assert np.abs(force.sum(axis=1)).max() < 1e-12 * np.abs(force).max()


def test_only_rigid_motions_cost_no_energy(make_body: MakeBody, one: TetMesh, law: Material) -> None:
    """An undeformed element's tangent has exactly six zero eigenvalues, whatever the law."""
    values = np.linalg.eigvalsh(tangents(make_body(one, law))[0])
    assert np.abs(values[:6]).max() < 1e-6 * values[-1]
    assert values[6] > 1e-4 * law.shear0 * one.size


def test_the_corner_measure_is_the_volume_ratio_there(make_body: MakeBody, one: TetMesh) -> None:
    """The least volume ratio is det F in a linear field, and negative once a corner folds."""
    body = make_body(one)
    assert least_volume_ratio(one.vertices @ GRADIENT.T, body.shape) == pytest.approx(np.linalg.det(GRADIENT))
    x = one.vertices.copy()
    x[4] = x[0] - 0.3 * (x[1] - x[0])
    assert least_volume_ratio(x, body.shape) < 0.0


def test_the_barrier_opens_folded_corners(make_body: MakeBody, one: TetMesh) -> None:
    """The fold barrier's tangent at a pressed corner is symmetric and not zero."""
    body, x = make_body(one), one.vertices.copy()
    x[4] = x[0] + 0.27 * (x[1] - x[0])
    out, force = np.zeros((1, 30, 30)), np.zeros((1, 10, 3))
    add_wall_tangents(x, np.zeros(1, np.int32), body.shape, body.material, body.table, force, np.zeros(1), out)
    np.testing.assert_allclose(out[0], out[0].T, atol=1e-5 * np.abs(out).max())
    assert np.abs(out).max() > 0.0
