# SPDX-License-Identifier: Apache-2.0
"""Equilibrium of the energy policy: a minimum, independent of start and material."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from benchmarks.torture.bodies import BAR, distance, make_scene
from gdfe_ros.constraints import Axis, Handle, Pose
from gdfe_ros.materials import Linear, Material, NeoHookean
from gdfe_ros.mesh import HexMesh, bar
from gdfe_ros.results.element_fields import corner_forces, element_fields, strain_energies
from gdfe_ros.simulation import Command, Simulation
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.equilibrium.energy import EquilibriumSolver
from gdfe_ros.solver.forces.actuation import vertex_forces
from gdfe_ros.solver.settings import Policy
from test.solver.conftest import solve

MakeBody = Callable[..., Body]
End = Callable[[HexMesh, str], NDArray[np.int32]]
MESH = bar([0.3, 0.1, 0.1], [6, 2, 2])


@dataclass(frozen=True)
class Bar:
    """A bar clamped at x- and bent by a pose of the handle at x+."""

    body: Body
    base: NDArray[np.float64]

    def solve(self, *, start: NDArray[np.float64] | None = None, **options):
        """Return the solution from the undeformed state, or from ``start``."""
        return solve(EquilibriumSolver(self.body), self.body.rest if start is None else start, self.base, **options)


@pytest.fixture
def bend(make_body: MakeBody, end: End) -> Callable[..., Bar]:
    """Return a function that bends a bar of a material.

    The tip rotates by ``angle`` [rad] about y and moves up; it slides along the axes ``free``.
    """

    def make(material: Material, *, angle: float = 0.7, mesh: HexMesh = MESH, free: tuple[Axis, ...] = ()) -> Bar:
        tip = Handle("tip", end(mesh, "x+"), free=free)
        body = make_body(mesh, material, [Handle("base", end(mesh, "x-"), fixed=True), tip])
        base, centre = mesh.vertices.copy(), tip.centre(mesh.vertices)
        turn = Rotation.from_rotvec([0.0, -angle, 0.0])
        base[tip.vertices] = turn.apply(base[tip.vertices] - centre) + centre + (-0.04, 0.0, 0.1)
        return Bar(body, base)

    return make


def test_forces_of_free_vertices_vanish(bend: Callable[..., Bar], law: Material) -> None:
    """Solved to 1e-7, the forces at free vertices are negligible beside the reactions, for every law."""
    bar_ = bend(law)
    outcome = bar_.solve(tolerance=1e-7)
    assert outcome.converged, outcome.message
    force, _ = corner_forces(bar_.body, outcome.positions, outcome.state.elements.pressures)
    left = vertex_forces(bar_.body, bar_.body.unknowns.free, force)
    reaction = outcome.state.summary.reactions["tip"]
    assert np.abs(left).max() < 1e-4 * np.linalg.norm(reaction[:3])


@pytest.mark.parametrize("poisson", [0.0, 0.3, 0.45])
def test_energy_never_rises(bend: Callable[..., Bar], poisson: float) -> None:
    """After 0, 1, 2, ... iterations of a large bend, the energy falls or stays."""
    bar_ = bend(Linear(young=1e5, poisson=poisson), angle=1.5)
    energies = []
    for limit in range(1, 40):
        outcome = bar_.solve(limit=limit, tolerance=1e-8)
        assert outcome.iterations <= limit
        energies.append(strain_energies(bar_.body, outcome.positions).sum())
    assert (np.diff(energies) <= 1e-12 * energies[0]).all()
    assert energies[-1] < 0.5 * energies[0]


@pytest.mark.parametrize("poisson", [0.3, 0.499])
def test_no_state_nearby_has_less_energy(bend: Callable[..., Bar], poisson: float) -> None:
    """Any small motion of the free vertices from the equilibrium increases the energy."""
    bar_ = bend(Linear(young=1e5, poisson=poisson))
    outcome = bar_.solve(tolerance=1e-9)
    least = strain_energies(bar_.body, outcome.positions).sum()
    random = np.random.default_rng(0)
    for amount in (1e-4, 1e-3):
        for _ in range(10):
            x = outcome.positions.copy()
            x[bar_.body.unknowns.free] += amount * random.normal(size=(len(bar_.body.unknowns.free), 3))
            assert strain_energies(bar_.body, x).sum() > least


def test_a_free_axis_is_unloaded(bend: Callable[..., Bar], law: Material) -> None:
    """A tip that slides along x has no reaction along x and stays plane."""
    bar_ = bend(law, angle=0.0, free=(Axis.X,))
    outcome = bar_.solve(tolerance=1e-7)
    reaction = outcome.state.summary.reactions["tip"]
    assert abs(reaction[0]) < 1e-4 * np.linalg.norm(reaction[:3])
    tip = bar_.body.handles[1].vertices
    moved = outcome.positions[tip] - bar_.base[tip]
    np.testing.assert_allclose(moved - moved[0], 0.0, atol=1e-12)
    np.testing.assert_array_equal(moved[:, 1:], 0.0)
    assert abs(moved[0, 0]) > 1e-3


def test_inverted_elements_recover(make_body: MakeBody, end: End, law: Material) -> None:
    """A body with inner vertices pulled through their neighbours returns to its undeformed shape."""
    mesh = bar([0.3, 0.3, 0.3], [3, 3, 3])
    body = make_body(mesh, law, [Handle("base", end(mesh, "x-"), fixed=True), Handle("tip", end(mesh, "x+"))])
    start = mesh.vertices.copy()
    start[[21, 22, 25, 26]] += (0.25, 0.05, -0.05)
    assert element_fields(body, start).J.min() < 0.0
    outcome = solve(EquilibriumSolver(body), start, mesh.vertices)
    assert outcome.converged, outcome.message
    np.testing.assert_allclose(outcome.positions, mesh.vertices, atol=1e-5 * body.size)


@pytest.mark.parametrize("tolerance", [1e-2, 1e-3, 1e-4, 1e-5])
@pytest.mark.parametrize("poisson", [0.3, 0.495])
def test_tolerance_bounds_the_distance_to_the_equilibrium(
    bend: Callable[..., Bar], tolerance: float, poisson: float
) -> None:
    """The error estimate is at most the tolerance, the distance to the equilibrium less than three tolerances."""
    bar_ = bend(NeoHookean(young=1e5, poisson=poisson))
    exact = bar_.solve(tolerance=1e-9)
    outcome = bar_.solve(tolerance=tolerance)
    assert outcome.converged
    assert 0.0 <= outcome.error_estimate <= tolerance
    distance = np.linalg.norm(outcome.positions - exact.positions, axis=1).max() / bar_.body.size
    assert distance < 3.0 * tolerance


@pytest.mark.parametrize("kind", [Linear, NeoHookean])
def test_nearly_incompressible_elements_keep_their_volume(bend: Callable[..., Bar], kind: type[Linear]) -> None:
    """At nu 0.4999 each element keeps its volume to 2e-4, in less than twice the iterations of nu 0.45."""
    bar_ = bend(kind(young=1e5, poisson=0.4999))
    outcome = bar_.solve(tolerance=1e-5)
    assert outcome.converged
    np.testing.assert_allclose(element_fields(bar_.body, outcome.positions).J, 1.0, atol=2e-4)
    moderate = bend(kind(young=1e5, poisson=0.45)).solve(tolerance=1e-5)
    assert outcome.iterations < 2 * moderate.iterations


@pytest.mark.parametrize("poisson", [0.3, 0.45, 0.46, 0.49, 0.499, 0.4999])
def test_confined_tension_has_the_oedometric_modulus(make_body: MakeBody, end: End, poisson: float) -> None:
    """A layer one element thick, pulled between handles, has the oedometric modulus K + 4/3 mu within 1 % at any nu."""
    law = Linear(young=1e5, poisson=poisson)
    mesh = bar([0.01, 0.1, 0.1], [1, 3, 3])
    handles = [Handle("base", end(mesh, "x-"), fixed=True), Handle("tip", end(mesh, "x+"))]
    body = make_body(mesh, law, handles)
    base = mesh.vertices * (1.01, 1.0, 1.0)
    outcome = solve(EquilibriumSolver(body), base.copy(), base)
    assert outcome.converged
    force = outcome.state.summary.reactions["tip"][0]
    expected = (law.bulk + 4.0 / 3.0 * law.shear0) * 0.01 * 0.01
    assert force == pytest.approx(expected, rel=0.01)


def test_a_body_held_everywhere_needs_no_iteration(make_body: MakeBody) -> None:
    """A body with every vertex held converges without an iteration at the commanded positions."""
    everything = Handle("all", np.arange(MESH.n_vertices, dtype=np.int32))
    body = make_body(MESH, None, [everything])
    base = MESH.vertices * (1.1, 1.0, 1.0)
    outcome = solve(EquilibriumSolver(body), MESH.vertices.copy(), base, tolerance=1e-6, limit=100)
    assert outcome.converged
    np.testing.assert_array_equal(outcome.positions, base)


@pytest.mark.parametrize("kind", [Linear, NeoHookean])
def test_incompressible_is_the_limit(kind: type[Linear]) -> None:
    """A bar of nu 0.5 keeps its volume, and its energy and shape are the limit of those for nu below."""
    near, limit = (
        Simulation(make_scene(BAR, kind(young=1e5, poisson=poisson), policy=Policy.ENERGY, tolerance=1e-7))
        for poisson in (0.49999, 0.5)
    )
    pose = Command({"tip": Pose(translation=(0.04, 0.0, 0.03))})
    before, found = near.step(pose), limit.step(pose)
    assert found.converged
    assert found.energy == pytest.approx(before.energy, rel=1e-4)
    assert distance(found.positions, before.positions, BAR.size) < 1e-4
    np.testing.assert_allclose(limit.fields().J, 1.0, atol=1e-5)
