# SPDX-License-Identifier: Apache-2.0
"""Equilibrium of the relative policy: the paper's method (Eqs. 1-10, Algorithm 1)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gdfe_ros.constraints import Axis, Handle
from gdfe_ros.materials import Curve, CurveData, Linear, Material
from gdfe_ros.mesh import HexMesh, bar
from gdfe_ros.paper.relative import RelativeEquilibrium
from gdfe_ros.paper.shape_factor import geometric_ratio
from gdfe_ros.results.element_fields import element_fields, strain_energies
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.elements.measures import least_volume_ratio
from gdfe_ros.solver.solution import Increment, Solution
from gdfe_ros.solver.state import State

MakeBody = Callable[..., Body]
End = Callable[[HexMesh, str], NDArray[np.int32]]
MESH = bar([0.4, 0.1, 0.1], [8, 2, 2])
RIGHT_HALF = (MESH.centroids[:, 0] > 0.2).astype(np.int32)


@pytest.fixture
def series(make_body: MakeBody, end: End) -> Callable[..., tuple[Body, NDArray[np.float64]]]:
    """Return a function that makes a bar of two materials in series, pulled by a fraction of its length."""

    def make(
        left: Material, right: Material, elongation: float = 0.2, free: tuple[Axis, ...] = ()
    ) -> tuple[Body, NDArray[np.float64]]:
        tip = Handle("tip", end(MESH, "x+"), free=free)
        body = make_body(MESH, [left, right], [Handle("base", end(MESH, "x-"), fixed=True), tip], RIGHT_HALF)
        base = MESH.vertices.copy()
        base[tip.vertices, 0] += 0.4 * elongation
        return body, base

    return make


def solution(body: Body, base: NDArray[np.float64], *, start: NDArray[np.float64] | None = None, **options) -> Solution:
    """Solve from the undeformed state or ``start`` [m], with the handles' vertices at ``base`` [m]."""
    equilibrium = RelativeEquilibrium(body)
    state = equilibrium.at_rest().with_(positions=body.rest if start is None else start, base=base)
    return equilibrium.solve(Increment.at(state, **{"tolerance": 1e-5, "limit": 2000, **options}), state)


def solve(body: Body, base: NDArray[np.float64], **options) -> tuple[State, NDArray[np.float64]]:
    """Solve from the undeformed state; return the state and the positions."""
    found = solution(body, base, **options)
    assert found.converged, found.message
    return found.state, found.positions


def joint(x: NDArray[np.float64]) -> float:
    """Return the position of the middle section divided by the length."""
    return float(x[MESH.vertices[:, 0] == 0.2, 0].mean() / x[:, 0].max())


@pytest.mark.exact("it compares with the vertices of the mesh to the bit")
def test_rest_is_an_equilibrium(make_body: MakeBody, end: End, law: Material) -> None:
    """Without a command there is no iteration and no motion."""
    body = make_body(MESH, law, [Handle("base", end(MESH, "x-"), fixed=True)])
    outcome = solution(body, MESH.vertices, tolerance=1e-8, limit=10)
    assert (outcome.converged, outcome.iterations) == (True, 0)
    np.testing.assert_array_equal(outcome.positions, MESH.vertices)


def test_equal_materials_have_equal_factors(series: Callable[..., tuple[Body, NDArray[np.float64]]]) -> None:
    """Two halves of one material have one shape factor, and the joint stays in the middle."""
    soft = Linear(young=1e5, poisson=0.45)
    state, x = solve(*series(soft, soft))
    assert np.ptp(state.shapes.omega) == 0.0
    assert joint(x) == pytest.approx(0.5, abs=1e-4)


def test_factors_follow_equations_seven_and_eight(series: Callable[..., tuple[Body, NDArray[np.float64]]]) -> None:
    """For linear materials of 4 : 1, omega is h / R_G(1) and h / R_G(4) with h = 4/5 (Eqs. 7 and 8)."""
    state, x = solve(*series(Linear(young=4e5, poisson=0.45), Linear(young=1e5, poisson=0.45)))
    expected = 0.8 / geometric_ratio(np.array([1.0, 4.0]))
    np.testing.assert_allclose(state.shapes.omega, expected[RIGHT_HALF], rtol=1e-12)
    assert joint(x) < 0.47


def test_factors_lie_between_zero_and_one(
    series: Callable[..., tuple[Body, NDArray[np.float64]]], law: Material
) -> None:
    """For each law joined to a stiff linear one and pulled, 0 < omega <= 1 everywhere."""
    state, _ = solve(*series(Linear(young=1e7, poisson=0.45), law))
    assert (state.shapes.omega > 0.0).all()
    assert (state.shapes.omega <= 1.0).all()


def test_factors_stay_sound_where_a_measured_curve_dips(
    series: Callable[..., tuple[Body, NDArray[np.float64]]],
) -> None:
    """Where a measured stress curve falls, its tangent is negative, but 0 < omega <= 1 still holds."""
    dip = Curve(data=CurveData.table([0.1, 0.2, 0.4, 1.0], [1e4, 2.2e4, 1.8e4, 6e4]), poisson=0.45)
    body, base = series(Linear(young=1e6, poisson=0.45), dip, elongation=0.15)
    outcome = solution(body, base, tolerance=1e-4, limit=300)
    state = outcome.state
    assert np.isfinite(outcome.positions).all()
    assert (state.shapes.omega > 0.0).all()
    assert (state.shapes.omega <= 1.0).all()


def test_a_given_factor_replaces_the_calibration(series: Callable[..., tuple[Body, NDArray[np.float64]]]) -> None:
    """Given factors of 0.9 and 0.03 (Sec. 4.2.1) replace the calibration, and the soft half stretches more."""
    left, right = Linear(young=1e5, poisson=0.45, omega=0.9), Linear(young=1e5, poisson=0.45, omega=0.03)
    body, base = series(left, right, elongation=1.0)
    state, x = solve(body, base)
    np.testing.assert_array_equal(state.shapes.omega, np.array([0.9, 0.03])[RIGHT_HALF])
    strain = element_fields(body, x).eps_eq
    assert strain[RIGHT_HALF == 1].mean() > 5.0 * strain[RIGHT_HALF == 0].mean()


def test_stiffness_is_relative(series: Callable[..., tuple[Body, NDArray[np.float64]]]) -> None:
    """With every modulus multiplied by 1000, the shape stays and the energy is 1000 times as large."""
    bodies = [series(Linear(young=4 * e, poisson=0.45), Linear(young=e, poisson=0.45)) for e in (1e5, 1e8)]
    (soft, x), (hard, y) = ((body, solve(body, base)[1]) for body, base in bodies)
    np.testing.assert_allclose(y, x, atol=1e-12)
    assert strain_energies(hard, y).sum() == pytest.approx(1e3 * strain_energies(soft, x).sum())


def test_state_is_the_energy_formula_at_the_shape(series: Callable[..., tuple[Body, NDArray[np.float64]]]) -> None:
    """The reported energy and least det F equal those of the energy policy's formulas at the same shape."""
    body, base = series(Linear(young=4e5, poisson=0.45), Linear(young=1e5, poisson=0.49))
    state, x = solve(body, base)
    assert state.summary.energy == pytest.approx(strain_energies(body, x).sum(), rel=1e-12)
    assert state.summary.min_det == pytest.approx(least_volume_ratio(x, body.shape), rel=1e-12)


@pytest.mark.parametrize("angle", [0.5, np.pi, 4.0])
def test_rigid_motion_of_all_handles_moves_the_body_rigidly(
    series: Callable[..., tuple[Body, NDArray[np.float64]]], angle: float
) -> None:
    """Both handles turned about one axis turn the body without strain."""
    body, _ = series(Linear(young=4e5, poisson=0.45), Linear(young=1e5, poisson=0.45))
    exact = Rotation.from_rotvec([0.0, angle, 0.3]).apply(MESH.vertices) + np.array([0.1, 0.2, 0.3])
    start = exact + 0.01 * np.random.default_rng(0).normal(size=exact.shape)
    outcome = solution(body, exact, start=start, tolerance=1e-7)
    assert outcome.converged
    np.testing.assert_allclose(outcome.positions, exact, atol=1e-7)


def test_captured_shapes_carry_a_motion_on(series: Callable[..., tuple[Body, NDArray[np.float64]]]) -> None:
    """A second step starts from the captured shapes (Eq. 9), so that its result differs slightly from one step."""
    body, base = series(Linear(young=4e5, poisson=0.45), Linear(young=1e5, poisson=0.45), elongation=0.4)
    half = 0.5 * (base + body.rest)
    middle, _ = solve(body, half)
    equilibrium, there = RelativeEquilibrium(body), middle.with_(base=base)
    second = equilibrium.solve(Increment.at(there, tolerance=1e-5, limit=2000), there).positions
    one_go = solve(body, base)[1]
    assert 1e-4 < np.abs(second - one_go).max() < 0.05
    rest = equilibrium.at_rest().with_(base=base)
    again = equilibrium.solve(Increment.at(rest, tolerance=1e-5, limit=2000), rest).positions
    np.testing.assert_array_equal(again, one_go)


def test_a_failed_solve_captures_nothing(series: Callable[..., tuple[Body, NDArray[np.float64]]]) -> None:
    """A solve that is stopped early and not accepted leaves the next solve unchanged."""
    body, base = series(Linear(young=4e5, poisson=0.45), Linear(young=1e5, poisson=0.45))
    equilibrium = RelativeEquilibrium(body)
    state = equilibrium.at_rest().with_(base=base)
    outcome = equilibrium.solve(Increment.at(state, tolerance=1e-5, limit=2), state)
    assert not outcome.converged
    assert "stopped after 2 iterations" in outcome.message
    again = equilibrium.solve(Increment.at(state, tolerance=1e-5, limit=2000), state)
    np.testing.assert_array_equal(again.positions, solve(body, base)[1])


def test_a_free_axis_finds_its_place(series: Callable[..., tuple[Body, NDArray[np.float64]]]) -> None:
    """A tip that slides along x returns from a stretched start to the undeformed length."""
    soft = Linear(young=1e5, poisson=0.45)
    body, base = series(soft, soft, elongation=0.0, free=(Axis.X,))
    start = body.rest * (1.3, 1.0, 1.0)
    outcome = solution(body, base, start=start, tolerance=1e-6)
    assert outcome.converged
    np.testing.assert_allclose(outcome.positions, body.rest, atol=1e-5)
