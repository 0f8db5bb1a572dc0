# SPDX-License-Identifier: Apache-2.0
"""Every actuator's force is the derivative of its energy."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from gdfe_ros.actuators import Cable, Chamber, Embedding, Gravity, Growth, Mode, PointLoad, SurfaceLoad, embed
from gdfe_ros.materials import Linear, Material, NeoHookean
from gdfe_ros.mesh import HexMesh, bar
from gdfe_ros.mesh.cavities import find_cavities
from gdfe_ros.mesh.cells.faces import enclosed_volume
from gdfe_ros.mesh.generators import sphere
from gdfe_ros.mesh.outside import carry_skin
from gdfe_ros.results.element_fields import corner_forces
from gdfe_ros.solver.body import Body, Growths
from gdfe_ros.solver.forces.actuation import Actuation, tell_limit_point
from gdfe_ros.solver.terms.cable import EFFORT, STIFFNESS, TARGET, cable_length
from gdfe_ros.solver.terms.volume import face_forces
from test.differences import assert_derivative, assert_tangent, force_of

RUBBER = NeoHookean(young=1e6, poisson=0.4, density=1000.0)
LINEAR = Linear(young=1e6, poisson=0.4)
"""A law with constant hourglass stiffness, so that its forces are the derivative of its energy in every state."""


def make_body(mesh: HexMesh, material: Material = RUBBER) -> Body:
    """Build a body of one material, without handles."""
    return Body.build(mesh.vertices, mesh.cells, (material,), np.zeros(mesh.n_cells, np.int32), ())


@pytest.mark.parametrize(("effort", "stiffness", "target"), [(3.0, 0.0, 0.0), (0.5, 400.0, 0.1), (0.0, 400.0, 0.9)])
def test_cable_force_is_the_derivative(effort: float, stiffness: float, target: float) -> None:
    """A cable's force is the derivative of its energy at given tension and given length, and zero when slack."""
    mesh = bar([0.2, 0.05, 0.05], [4, 2, 2])
    points = embed(mesh, [[0.0, 0.01, 0.02], [0.07, 0, 0.02], [0.12, -0.01, 0.0], [0.2, 0, -0.02]], what="cable")
    actuation = Actuation(make_body(mesh), [Cable(name="c", mode=Mode.TENSION, points=points)])
    actuation.terms[0].reals[[EFFORT, STIFFNESS, TARGET]] = effort, stiffness, target
    x = mesh.vertices + 0.003 * np.random.default_rng(0).standard_normal(mesh.vertices.shape)
    assert_derivative(actuation.table, x)
    if not stiffness:
        assert_tangent(actuation.terms[0], x)
    force = force_of(x, actuation.table)
    assert force.any() == (target < 0.5), "a slack cable must not pull"
    np.testing.assert_allclose(force.sum(axis=0), 0.0, atol=1e-12)


def test_a_cable_is_exact_at_rest_and_smooth_where_points_meet() -> None:
    """At rest a cable has the length between its points. Where two meet, its force is bounded, and the derivative."""
    mesh = bar([0.2, 0.05, 0.05], [4, 2, 2])
    points = embed(mesh, [[0.0, 0.0, 0.0], [0.05, 0.0, 0.0], [0.1, 0.0, 0.025], [0.2, 0.0, 0.0]], what="cable")
    actuation = Actuation(make_body(mesh), [Cable(name="c", mode=Mode.TENSION, points=points)])
    (cable,) = actuation.terms
    exact = np.linalg.norm(np.diff(points.at(mesh.vertices), axis=0), axis=1).sum()
    assert cable_length(mesh.vertices, cable.reals, cable.integers) == pytest.approx(exact, rel=1e-14)
    cable.reals[EFFORT] = 2.0
    middle = np.flatnonzero(np.isclose(mesh.vertices, [0.05, 0.0, 0.0]).all(axis=1))
    met = mesh.vertices.copy()
    met[middle] = points.at(met)[0]
    for off in (0.0, 1e-6, 1e-5, 1e-4):
        x = met + off * np.eye(len(met))[middle].T
        assert_derivative(actuation.table, x, h=3e-9)
        force = force_of(x, actuation.table)
        assert np.linalg.norm(force[middle]) <= 2.0 * 2.0


@pytest.mark.parametrize(("effort", "stiffness"), [(5e4, 0.0), (2e4, 1e12)])
def test_chamber_force_is_the_derivative(effort: float, stiffness: float) -> None:
    """A chamber's force is the derivative of its energy at given pressure and given volume, on warped quads."""
    mesh = sphere(0.01, 0.015, [3, 1])
    cavity = find_cavities(mesh)[0]
    actuation = Actuation(make_body(mesh), [Chamber(name="c", mode=Mode.PRESSURE, quads=cavity.quads)])
    actuation.terms[0].reals[[EFFORT, STIFFNESS, TARGET]] = effort, stiffness, cavity.volume
    x = mesh.vertices + 0.0005 * np.random.default_rng(0).standard_normal(mesh.vertices.shape)
    assert_derivative(actuation.table, x)
    if not stiffness:
        assert_tangent(actuation.terms[0], x)
    far = x + np.array([3.0, -2.0, 5.0])
    volume = face_forces(far, actuation.terms[0].integers, far[0], 0.0, 0.0, np.zeros((0, 3)))
    assert volume == pytest.approx(enclosed_volume(x, cavity.quads), rel=1e-10)


def test_any_unbounded_actuator_is_named_at_its_limit_point() -> None:
    """If the energy has no lower bound, the actuator is named whose command has grown, with the names of its mode."""
    mesh = bar([0.2, 0.05, 0.05], [4, 2, 2])
    points = embed(mesh, [[0.0, 0.0, 0.0], [0.2, 0.0, 0.0]], what="cable")
    actuation = Actuation(make_body(mesh), [Cable(name=name, mode=Mode.TENSION, points=points) for name in "ab"])
    x, before, after = mesh.vertices, {"a": 1.0, "b": -1.0}, {"a": 1.0, "b": -2.0}
    assert actuation.unstable(x, x, after, before) is None
    for term in actuation.terms:
        term.unbounded = True
    assert actuation.unstable(x, x, after, before) is actuation.actuators[1]
    told = tell_limit_point(actuation.actuators[1], before, after)
    assert told.startswith("cable 'b' lost its stability between -1 and -2 N: its tension falls with its length there")


@pytest.mark.parametrize(("effort", "stiffness"), [(5e4, 0.0), (2e4, 1e12)])
def test_force_of_a_carried_chamber_is_the_derivative(effort: float, stiffness: float) -> None:
    """The force of a chamber whose surface is embedded in cells is the derivative of its energy and sums to zero."""
    mesh = bar([0.06, 0.06, 0.06], [3, 3, 3])
    ball = trimesh.creation.icosphere(1, 0.0101)
    ball.apply_translation(mesh.bounds.mean(axis=0))
    skin = carry_skin(mesh.vertices, mesh.cells, ball.vertices, ball.faces)
    quads = skin.faces[:, [0, 1, 2, 2]].astype(np.int32)
    chamber = Chamber(name="c", mode=Mode.PRESSURE, quads=quads, points=Embedding(skin.corners, skin.weights))
    body = make_body(mesh)
    actuation = Actuation(body, [chamber])
    term = actuation.terms[0]
    term.reals[[EFFORT, STIFFNESS, TARGET]] = effort, stiffness, ball.volume
    assert term.state(body.rest).extent == pytest.approx(ball.volume, rel=1e-9)
    x = mesh.vertices + 0.002 * np.random.default_rng(0).standard_normal(mesh.vertices.shape)
    assert_derivative(actuation.table, x)
    force = force_of(x, actuation.table)
    assert np.abs(force).max() > 0.0
    np.testing.assert_allclose(force.sum(axis=0), 0.0, atol=1e-12 * np.abs(force).sum())
    np.testing.assert_allclose(np.cross(x, force).sum(axis=0), 0.0, atol=1e-13 * np.abs(force).sum())
    assert term.state(x + np.array([3.0, -2.0, 5.0])).extent == pytest.approx(term.state(x).extent, rel=1e-9)


def test_dead_loads_sum_to_their_force_and_moment() -> None:
    """Gravity, a point load and a surface load on a graded mesh have the exact total force or moment."""
    mesh = bar([0.2, 0.04, 0.06], [4, 2, 3])
    mesh.vertices[:, 1] *= 1.0 + mesh.vertices[:, 0]
    mesh.vertices[:, 2] += 0.2 * mesh.vertices[:, 0]
    pull = np.array([1.0, -2.0, 3.0])
    weight = Gravity(name="g", acceleration=pull, density=np.full(mesh.n_cells, 1000.0))
    body = make_body(mesh)
    np.testing.assert_allclose(weight.forces(body.rest, body.cells).sum(axis=0), 1000 * body.shape.volume.sum() * pull)
    at = [0.13, 0.005, 0.03]
    forces = PointLoad(name="p", point=embed(mesh, [at], what="p"), force=pull).forces(body.rest, body.cells)
    np.testing.assert_allclose(np.cross(body.rest, forces).sum(axis=0), np.cross(at, pull), atol=1e-9)
    end = mesh.surface()[(mesh.vertices[mesh.surface(), 0] > 0.1999).all(axis=1)]
    forces = SurfaceLoad(name="s", quads=end, traction=pull).forces(body.rest, body.cells)
    np.testing.assert_allclose(forces.sum(axis=0), 0.04 * 1.2 * 0.06 * pull, rtol=1e-9)


@pytest.mark.parametrize("material", [RUBBER, LINEAR])
def test_growth_energy_is_that_of_the_elastic_part(material: Material) -> None:
    """The energy of a grown body is det G W(F G^-1), and its force equals differences of the energy."""
    mesh = bar([0.02, 0.02, 0.02], [2, 2, 2])
    random = np.random.default_rng(2)
    target = np.diag([1.3, 0.9, 1.1])
    body = make_body(mesh, material)
    growth = Growth(name="g", mode=Mode.GROWTH, cells=np.arange(mesh.n_cells), stretch=target)
    growths = Growths(body, [growth])
    operators = growths.at({"g": 1.0}, growths.ungrown)
    gradient = np.eye(3) + 0.2 * random.standard_normal((3, 3))
    none = np.zeros(mesh.n_cells)
    _, grown = corner_forces(body, mesh.vertices @ gradient.T, none, operators=operators)
    elastic = gradient @ np.linalg.inv(target)
    _, plain = corner_forces(make_body(mesh, material), mesh.vertices @ elastic.T, none)
    np.testing.assert_allclose(grown, np.linalg.det(target) * plain, rtol=1e-10)
    amplitude = 0.0005 if material is LINEAR else 0.0
    x = mesh.vertices @ gradient.T + amplitude * random.standard_normal(mesh.vertices.shape)
    force, _ = corner_forces(body, x, none, operators=operators)
    direction, h = random.standard_normal(x.shape), 1e-8
    ends = [corner_forces(body, x + side * h * direction, none, operators=operators)[1].sum() for side in (1, -1)]
    slope = (ends[0] - ends[1]) / (2 * h)
    assert slope == pytest.approx(np.einsum("eai,eai", force, direction[mesh.cells]), rel=1e-6)
