# SPDX-License-Identifier: Apache-2.0
"""Given start positions, restarts from the undeformed state, hard inclusions, limits of precision and divergence."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.torture.actuation import DRIVES, scene_text
from benchmarks.torture.bodies import BAR, LAWS, Driver, distance, make_scene
from benchmarks.torture.contrasts import PATTERNS
from benchmarks.torture.laws import UNSTABLE
from gdfe_ros.constraints import Pose
from gdfe_ros.errors import CommandError
from gdfe_ros.materials import Linear
from gdfe_ros.scene import load_scene
from gdfe_ros.scene.loader import scene_from_text
from gdfe_ros.simulation import Command, Simulation
from gdfe_ros.solver.settings import Policy
from test.written import advance

POSE = Pose(translation=(0.02, 0.0, 0.08))


def _simulation(policy: Policy = Policy.ENERGY, law: str = "linear", tolerance: float = 1e-6) -> Simulation:
    return Simulation(make_scene(BAR, LAWS[law], policy=policy, tolerance=tolerance))


def test_a_sound_start_is_followed() -> None:
    """A start near the equilibrium leads to it without a restart."""
    simulation = _simulation()
    expected = simulation.step(Command({"tip": POSE}))
    simulation.set_positions(expected.positions + np.random.default_rng(0).normal(0.0, 1e-4, BAR.vertices.shape))
    found = simulation.step()
    assert (found.converged, found.restarts, found.message) == (True, 0, "")
    assert found.iterations > 0
    assert distance(found.positions, expected.positions, 0.4) < 1e-5


@pytest.mark.parametrize("policy", list(Policy))
def test_a_start_without_gradients_is_made_again_from_rest(policy: Policy) -> None:
    """A start with all vertices in one point restarts from the undeformed state, says so, and finds the equilibrium."""
    simulation = _simulation(policy)
    expected = simulation.step(Command({"tip": POSE}))
    simulation.set_positions(np.zeros_like(BAR.vertices))
    found = simulation.step()
    assert (found.converged, found.restarts) == (True, 1)
    assert "restarted from rest" in found.message
    assert distance(found.positions, expected.positions, 0.4) < 1e-5
    assert simulation.step().skipped["solve"] == 1


def test_handles_stay_where_they_are_commanded() -> None:
    """Given positions that move the handles' vertices leave the handles at their commanded poses."""
    simulation = _simulation()
    held = simulation.scene.handles[0].vertices
    simulation.set_positions(BAR.vertices + 1.0)
    np.testing.assert_allclose(simulation.positions[held], BAR.vertices[held], atol=1e-12)


def test_unfit_positions_are_refused() -> None:
    """Positions of a wrong shape or with values that are not finite are refused, and the state stays."""
    simulation = _simulation()
    with pytest.raises(CommandError, match=r"shape \(80, 3\); allowed: \(81, 3\)"):
        simulation.set_positions(BAR.vertices[1:])
    broken = BAR.vertices.copy()
    broken[7, 1] = np.nan
    with pytest.raises(CommandError, match=r"vertices 7 are not finite"):
        simulation.set_positions(broken)
    np.testing.assert_allclose(simulation.positions, BAR.vertices, atol=1e-12)


def test_hard_lumps_turn() -> None:
    """In a bent bar with a layer a million times as hard, the energy at the default tolerance is right to 1e-4."""
    materials = [Linear(young=1e4, poisson=0.3), Linear(young=1e10, poisson=0.3)]
    found = []
    for tolerance in (1e-4, 1e-8):
        scene = make_scene(
            BAR, materials, policy=Policy.ENERGY, tolerance=tolerance, cell_material=PATTERNS["one hard layer"]
        )
        result = advance(Simulation(scene), Command({"tip": POSE}))
        found.append(result.energy)
    assert found[0] == pytest.approx(found[1], rel=1e-4)


def test_precision_has_an_end() -> None:
    """A tolerance below double precision ends soon with a message, at the right equilibrium."""
    expected = _simulation(law="neo-hookean", tolerance=1e-9).step(Command({"tip": POSE}))
    found = _simulation(law="neo-hookean", tolerance=1e-12).step(Command({"tip": POSE}))
    assert found.iterations < 1000
    assert found.converged or "precision" in found.message
    assert distance(found.positions, expected.positions, 0.4) < 1e-7


def test_a_law_without_lower_bound_is_reported() -> None:
    """An Ogden body whose energy has no lower bound ends finite and reported, and stays usable."""
    make, _, _ = UNSTABLE["steep negative exponent"]
    driver = Driver(make_scene(BAR, make(), policy=Policy.ENERGY))
    result = driver.step(Pose(translation=(0.4, 0.0, 0.0)))
    assert not result.converged
    assert result.message
    assert np.isfinite(result.positions).all()
    assert np.isfinite(result.energy)
    driver.simulation.reset()
    assert driver.step(Pose(translation=(0.001, 0.0, 0.0))).converged


def test_a_body_far_from_the_origin_is_as_accurate() -> None:
    """A body 1000 m from the origin has the same displacements to 1e-9, and positions in world coordinates."""
    near = _simulation(tolerance=1e-11)
    shifted = type(BAR)(BAR.vertices + 1e3, BAR.cells)
    far = Simulation(make_scene(shifted, LAWS["linear"], policy=Policy.ENERGY, tolerance=1e-11))
    np.testing.assert_allclose(far.positions, shifted.vertices, atol=1e-12)
    results = [simulation.step(Command({"tip": POSE})) for simulation in (near, far)]
    assert all(result.converged for result in results)
    np.testing.assert_allclose(results[1].positions - 1e3, results[0].positions, atol=4e-10)
    np.testing.assert_allclose(far.fields().centroids - 1e3, near.fields().centroids, atol=4e-10)


@pytest.mark.parametrize("cut_after", [150, pytest.param(None, marks=pytest.mark.slow)])
@pytest.mark.parametrize(("tolerance", "off"), [(1e-3, 0.02), (1e-6, 2e-4), (1e-8, 2e-4)])
def test_a_body_of_soft_hinges_comes_home(tolerance: float, off: float, cut_after: int | None) -> None:
    """A finger with soft webs that is pulled far and released returns to its initial shape in one step.

    A single short step is not taken for the equilibrium. Cut off on the way to a far command, the finger is still away
    from its initial shape by more than twice the allowed distance ``off``.
    """
    scene = load_scene("tendon_finger")
    scene = replace(scene, solver=replace(scene.solver, tolerance=tolerance, max_iterations=20000))
    simulation = Simulation(scene)
    loose = {item.name: 0.0 for item in scene.actuators}
    rest = simulation.step(Command(actuators=loose)).positions
    for pulled in ({item.name: item.high for item in scene.actuators}, {**loose, "flexor": 20.0}):
        bent = simulation.step(Command(actuators=pulled), cut_after=cut_after)
        assert distance(bent.positions, rest, scene.mesh.size) > 0.04
        found = simulation.step(Command(actuators=loose))
        assert distance(found.positions, rest, scene.mesh.size) < off


def test_a_step_past_absurdity_is_given_up_early() -> None:
    """A beam loaded with a million times its weight stops in a sound state, says so, and returns when unloaded."""
    scene = scene_from_text(scene_text(DRIVES["a million times its weight"], "linear", Policy.ENERGY))
    simulation = Simulation(scene)
    found = simulation.step(Command(loads={"a": 1e6}))
    assert not found.converged
    assert found.min_det > 0.0
    back = advance(simulation, Command(loads={"a": 0.0}))
    assert distance(back.positions, scene.mesh.vertices, scene.mesh.size) < 1e-3


@pytest.mark.parametrize("seed", [4, 15, 43, 46])
def test_a_finger_that_curls_far_in_one_step_converges_whatever_the_rounding(seed: int) -> None:
    """A finger pulled from 3 to 6 N in one step converges for any perturbation of its vertices by rounding."""
    scene = load_scene("tendon_finger", overrides={"loads": None, "program": None})
    off = 1e-13 * scene.mesh.size * np.random.default_rng(seed).uniform(-1.0, 1.0, scene.mesh.vertices.shape)
    simulation = Simulation(replace(scene, mesh=replace(scene.mesh, vertices=scene.mesh.vertices + off)))
    for tension in (1.0, 3.0, 6.0):
        advance(simulation, Command(actuators={"flexor": tension}))
    # The same steps at a tolerance of 1e-8 end there.
    np.testing.assert_allclose(simulation.probe_positions()["tip"], [0.0190298, 0.0, -0.0531406], atol=3e-5)


def test_a_finger_is_pulled_until_its_cable_points_meet() -> None:
    """A finger pulled to 20 N in one step or in forty ends at one shape: the eyelets of its joints meet and stay so."""
    scene, ends = load_scene("tendon_finger", overrides={"program": None}), []
    for tensions in ([20.0], np.linspace(0.5, 20.0, 40)):
        simulation = Simulation(scene)
        results = [simulation.step(Command(actuators={"flexor": float(tension)})) for tension in tensions]
        assert all(result.converged for result in results), [result.message for result in results]
        assert max(result.iterations for result in results) < 500
        ends.append(results[-1].positions)
    assert distance(ends[0], ends[1], scene.mesh.size) < 3e-4
    gaps = np.linalg.norm(np.diff(scene.actuators[0].points.at(ends[0]), axis=0), axis=1)[1:-1:2]
    assert gaps.max() < 1e-3 * 0.010
