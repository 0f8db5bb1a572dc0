# SPDX-License-Identifier: Apache-2.0
"""The elasticity benchmark: its law, its Newton method, its measure of the decrement, and small rows."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
import scipy.sparse as sparse
from scipy.spatial.transform import Rotation

from benchmarks.elasticity import felupe_rows, law, newton, own
from benchmarks.elasticity.__main__ import compare, measure
from benchmarks.elasticity.problem import DECREMENT, PROBLEMS, Kind, Problem, lattice
from benchmarks.elasticity.table import size_table
from gdfe_ros.mesh import bar
from gdfe_ros.results.element_fields import strain_energies
from gdfe_ros.solver.body import Body

MILD = Problem(kind=Kind.STRETCH, amount=1.3, ratio=0.3)
NEARLY = Problem(kind=Kind.TWIST, amount=0.6, ratio=0.499, mu=1e4)


def deformations(count: int = 20) -> np.ndarray:
    """Return random F (count, 9), some of them inverted."""
    return (np.eye(3) + 0.7 * np.random.default_rng(7).standard_normal((count, 3, 3))).reshape(count, 9)


@pytest.mark.parametrize("problem", [MILD, NEARLY], ids=["mild", "nearly incompressible"])
def test_stress_and_tangent_are_differences(problem: Problem) -> None:
    """P and dP/dF are central differences of the energy and of P, for inverted F too."""
    f, step = deformations(), 1e-6
    assert (law.volume_ratio(f) < 0.0).any()
    stress, hessian = law.tangent(f, problem.mu, problem.lame)
    for i in range(9):
        move = step * np.eye(9)[i]
        up, down = f + move, f - move
        slope = law.density(up, problem.mu, problem.lame) - law.density(down, problem.mu, problem.lame)
        np.testing.assert_allclose(slope / (2 * step), stress[:, i], rtol=0, atol=1e-7 * np.abs(stress).max())
        change = law.stress(up, problem.mu, problem.lame) - law.stress(down, problem.mu, problem.lame)
        np.testing.assert_allclose(change / (2 * step), hessian[:, i], rtol=0, atol=1e-7 * np.abs(hessian).max())


@pytest.mark.parametrize("problem", [MILD, NEARLY], ids=["mild", "nearly incompressible"])
def test_the_scene_has_the_benchmarks_energy(problem: Problem) -> None:
    """A cube of this solver with the problem's material has the energy of the benchmark's formula."""
    mesh = bar([1.0, 1.0, 1.0], [1, 1, 1])
    body = Body.build(mesh.vertices, mesh.cells, [problem.law], np.zeros(1, np.int32), [])
    for stretches in ([1.3, 0.9, 0.85], [0.8, 1.1, 1.1], [1.0, 1.0, 1.0]):
        u, v = Rotation.random(2, random_state=3).as_matrix()
        f = u @ np.diag(stretches) @ v.T
        expected = float(law.density(f.reshape(9), problem.mu, problem.lame))
        found = float(strain_energies(body, mesh.vertices @ f.T)[0])
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-9 * problem.mu)


@pytest.mark.parametrize("order", [1, 2])
def test_affine_displacements_pass_the_patch_test(order: int) -> None:
    """Under an affine motion F is constant, inner nodes have no force, and the energy is that of the density."""
    body = newton.Tetrahedra(2, order)
    slope = np.array([[0.2, 0.1, 0.0], [-0.1, 0.1, 0.2], [0.0, 0.1, -0.1]])
    u = (body.points @ slope.T).ravel()
    gradients = body.gradients(u)
    np.testing.assert_allclose(gradients, np.broadcast_to((np.eye(3) + slope).ravel(), gradients.shape), atol=1e-12)
    force = body.forces(law.stress(gradients, MILD.mu, MILD.lame)).reshape(-1, 3)
    inside = np.abs(body.points - [0.5, 0.0, 0.0]).max(axis=1) < 0.5 - 1e-9
    assert inside.any()
    assert np.abs(force[inside]).max() < 1e-12
    assert body.energy(u, MILD) == pytest.approx(float(law.density(gradients[0, 0], MILD.mu, MILD.lame)))


@pytest.mark.parametrize("order", [1, 2])
def test_the_matrix_is_the_derivative_of_the_forces(order: int) -> None:
    """The assembled upper triangle is a central difference of the forces of the free unknowns."""
    body, step = newton.Tetrahedra(2, order), 1e-6
    u = 0.05 * np.random.default_rng(1).standard_normal(body.points.size)

    def force(x: np.ndarray) -> np.ndarray:
        return body.forces(law.stress(body.gradients(x), MILD.mu, MILD.lame))[body.free]

    upper = body.pattern.matrix(body.elements(law.tangent(body.gradients(u), MILD.mu, MILD.lame)[1])).toarray()
    whole = upper + np.triu(upper, 1).T
    for column in (0, 5, len(body.free) - 1):
        move = np.zeros_like(u)
        move[body.free[column]] = step
        difference = (force(u + move) - force(u - move)) / (2.0 * step)
        np.testing.assert_allclose(whole[:, column], difference, atol=1e-7 * np.abs(whole).max())


def test_filters_and_factors_refuse_negative_curvature() -> None:
    """The filter leaves no negative eigenvalue, and an indefinite matrix has no factor."""
    hessian = law.tangent(deformations(), 1.0, 1.5)[1]
    assert np.linalg.eigvalsh(hessian).min() < -0.1
    assert np.linalg.eigvalsh(law.positive_part(hessian)).min() > -1e-10
    cholesky = newton.Cholesky()
    matrix = sparse.csr_matrix(np.array([[2.0, 1.0], [0.0, 3.0]]))
    np.testing.assert_allclose(cholesky.solve(matrix, np.array([5.0, 10.0])), [1.0, 3.0])
    assert cholesky.solve(sparse.csr_matrix(np.array([[2.0, 4.0], [0.0, 3.0]])), np.ones(2)) is None
    cholesky.close()


def test_all_rows_agree_on_a_small_problem() -> None:
    """Each row converges on the small meshes, ours by the common criterion, to forces within 3 % of P2's."""
    rows = [newton.solve(MILD, 4, 2), *(own.solve(MILD, n, tetrahedra=n == 2) for n in (2, 4))]
    rows += [felupe_rows.solve(MILD, 2, 2), felupe_rows.solve(MILD, 4, 1)]
    for found in rows:
        assert found["message"] == ""
        assert found["decrement"] < DECREMENT
        assert found["reaction"] == pytest.approx(rows[0]["reaction"], rel=0.03)


def test_the_decrement_sees_a_state_that_is_no_equilibrium() -> None:
    """Moved away from the equilibrium by 1 % of an edge, a mesh has a decrement far above the criterion."""
    mesh = own.cube(2, tetrahedra=True)
    x = mesh.vertices
    held = np.flatnonzero((x[:, 0] < 1e-9) | (x[:, 0] > 1.0 - 1e-9))
    assert own.measure_decrement(NEARLY, mesh, x, held)[0] < 1e-20
    moved = x.copy()
    moved[np.linalg.norm(x - [0.5, 0.0, 0.0], axis=1) < 1e-9] += [0.0, 0.01, 0.0]
    assert own.measure_decrement(NEARLY, mesh, moved, held)[0] > 10.0 * DECREMENT


def test_meshes_share_the_lattice() -> None:
    """The lattice's points are the same for hexahedra and tetrahedra; another mesh is refused."""
    points = [own.cube(4, tetrahedra=False).vertices, newton.Tetrahedra(2, 2).points]
    for each in points:
        np.testing.assert_allclose(each[lattice(each)], points[0][lattice(points[0])], atol=1e-12)
    with pytest.raises(ValueError, match="inner points of the lattice of 4 intervals"):
        lattice(own.cube(3, tetrahedra=False).vertices)


def test_the_table_has_each_row() -> None:
    """The table of a small measurement names each row, and a failed run is counted instead of compared."""
    rows = {"gdfe_ros, tetrahedra": partial(own.solve, tetrahedra=True), "Newton, P2": partial(newton.solve, order=2)}
    sweep = tuple(problem for problem in PROBLEMS if problem.amount == 1.3)[:5]
    runs = compare(measure(rows, sweep, 4))
    runs[-1] = {**runs[-1], "message": "failed"}
    table = size_table(runs)["elasticity"]
    assert "Newton, P2" in table
    assert "1 of 5" in table
