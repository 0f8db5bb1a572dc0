# SPDX-License-Identifier: Apache-2.0
"""Viscosity and Prony series: derivatives, rigid motion without dissipation, and relaxation in closed form."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gdfe_ros import Command, Pose
from gdfe_ros.materials import NeoHookean
from gdfe_ros.mesh.generators import bar
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.motion.viscosity import Viscosity
from gdfe_ros.solver.settings import Branch, Damping, Dynamics
from gdfe_ros.solver.terms.term import TermTable
from test.differences import assert_derivative, assert_tangent, force_of
from test.written import advance, simulate

DYNAMICS = Dynamics(damping=Damping(viscosity=300.0), prony=(Branch(0.2, 0.05), Branch(0.1, 0.5)))
H = 0.01


def make_body() -> Body:
    """Build two warped cells without handles."""
    mesh = bar([0.04, 0.02, 0.02], [2, 1, 1])
    vertices = mesh.vertices + 0.001 * np.random.default_rng(0).standard_normal(mesh.vertices.shape)
    material = NeoHookean(young=1e6, poisson=0.4, density=1000.0)
    return Body.build(vertices, mesh.cells, (material,), np.zeros(mesh.n_cells, np.int32), ())


def test_the_force_is_the_derivative() -> None:
    """The viscous force equals central differences of its energy along random directions, after strained steps."""
    body, random = make_body(), np.random.default_rng(1)
    term = Viscosity(body, DYNAMICS, H)
    x = body.rest + 0.001 * random.standard_normal(body.rest.shape)
    saved = term.neutral()
    for _ in range(2):
        term.begin({}, saved, x, 1.0)
        saved = term.finish(saved, x)
        x = x + 0.001 * random.standard_normal(x.shape)
    term.begin({}, saved, x, 1.0)
    assert_derivative(TermTable.of(term), x)


def test_the_tangent_is_the_derivative_of_the_force() -> None:
    """At the strains of the last step, the tangent equals central differences of the viscous force."""
    body, random = make_body(), np.random.default_rng(1)
    term, x = Viscosity(body, DYNAMICS, H), body.rest + 0.001 * random.standard_normal(body.rest.shape)
    saved = term.neutral()
    saved = {**saved, "strain": term._strains(x), "before": term._strains(x)}
    saved["branches"] = np.repeat(saved["strain"][None], len(DYNAMICS.prony), axis=0)
    term.begin({}, saved, x, 1.0)
    assert_tangent(term, x)


def test_rigid_motion_is_not_resisted() -> None:
    """Rigid motion of a strained body at any rate causes no viscous force and no dissipation."""
    body = make_body()
    term = Viscosity(body, Dynamics(damping=Damping(viscosity=300.0)), H)
    x = body.rest * [1.3, 0.9, 0.9]
    saved = term.neutral()
    for _ in range(4):
        term.begin({}, saved, x, 1.0)
        saved = term.finish(saved, x)
    lost = saved["lost"][0]
    for angle in (0.3, 1.7, 3.0):
        rotation = Rotation.from_rotvec([0.2, angle, -0.1]).as_matrix()
        turned = np.ascontiguousarray(x @ rotation.T + np.array([5.0, 0.0, 1.0]))
        term.begin({}, saved, turned, 1.0)
        assert np.abs(force_of(turned, TermTable.of(term))).max() < 1e-9
        saved = term.finish(saved, turned)
    assert saved["lost"][0] - lost < 1e-12 * lost


@pytest.mark.parametrize("scheme", ["generalised_alpha", "newmark", "bdf2"])
def test_what_dashpots_dissipate_is_the_work_on_them(moving: Callable, scheme: str) -> None:
    """A nearly massless bar is pulled to and fro at jumping velocities: all work that it does not store is dissipated.

    With the rate of the stress, which overshoots at each jump, the dissipated energy was 1.7 times the work.
    """
    ends = {"base": {"where": {"face": "x-"}, "fixed": True}, "tip": {"where": {"face": "x+"}}}
    dynamics = {"dynamics__scheme": scheme, "dynamics__step": 0.005, "dynamics__damping": {"viscosity": 2e4}}
    pulled = moving(handles=ends, materials__rubber__density=1.0, solver__tolerance=1e-6, **dynamics)
    for turn in range(12):
        energies = pulled.step(Command(handles={"tip": Pose((1e-3 * (turn % 2 == 0), 0.0, 0.0))}), dt=0.02).energies
    assert energies["dissipated"] == pytest.approx(energies["work"], rel=0.02)


def test_stress_relaxes_as_the_series_says(moving: Callable) -> None:
    """After a sudden stretch of 1 %, the force relaxes as the sum of all Prony branches.

    The default tolerance allows errors of a tenth of this stretch.
    """
    branches = [{"share": 0.3, "time": 0.1}, {"share": 0.2, "time": 1.0}]
    ends = {"base": {"where": {"face": "x-"}, "free": ["y", "z"]}, "tip": {"where": {"face": "x+"}, "free": ["y", "z"]}}
    free = {"materials__rubber__poisson": 0.0, "materials__rubber__density": 1e-3, "solver__tolerance": 1e-6}
    held = moving(handles=ends, dynamics__prony=branches, dynamics__step=0.005, **free)
    held.step(Command(handles={"tip": Pose((1e-4, 0.0, 0.0))}), dt=0.005)
    slow = 1e6 * 0.02**2 * 1e-3
    for _ in range(200):
        result = held.step(dt=0.005)
        since = result.time - 0.0025
        expected = slow * (1.0 + (0.3 * np.exp(-since / 0.1) + 0.2 * np.exp(-since)) / 0.5)
        if result.time > 0.02:
            assert result.reactions["tip"][0] == pytest.approx(expected, rel=0.01)


def test_a_body_does_not_sleep_while_its_stress_relaxes() -> None:
    """The force on a bar that is stretched once and held falls to that of the relaxed material, though nothing moves.

    A body whose vertices were at rest made no more steps, and kept 73 % too much force.
    """
    text = """
mesh: {bar: {size: [0.04, 0.01, 0.01], cells: [4, 1, 1]}}
materials: {m: {law: linear, young: 1.0e5, poisson: 0, density: 1000}}
handles: {left: {where: {face: x-}}, right: {where: {face: x+}}}
dynamics: {scheme: bdf2, step: 0.01, prony: [{share: 0.5, time: 0.3}]}
"""
    simulation = simulate(text)
    result = advance(simulation, Command(handles={"right": Pose((4e-4, 0.0, 0.0))}))
    force, times = 1e5 * 1e-4 * 1e-2, []
    while not simulation.settled:
        result = advance(simulation)
        times.append(result.time)
        expected = force * (1.0 + np.exp(-result.time / 0.3))
        assert result.time < 0.1 or result.reactions["right"][0] == pytest.approx(expected, rel=0.02)
    assert times[-1] > 1.5
    assert result.reactions["right"][0] == pytest.approx(force, rel=1e-3)
