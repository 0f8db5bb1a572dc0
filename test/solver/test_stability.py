# SPDX-License-Identifier: Apache-2.0
"""Equilibria that are saddles of the energy are left, in large and small steps; stable ones keep their bits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gdfe_ros import Simulation
from gdfe_ros.constraints import Pose
from gdfe_ros.scene import load_scene
from gdfe_ros.simulation import Command
from gdfe_ros.solver.equilibrium.stability import Stability
from gdfe_ros.solver.settings import Policy
from test.written import advance, scene_of

COLUMN = """
mesh: {bar: {size: [0.2, 0.01, 0.01], cells: [20, 2, 2]}}
materials: {soft: {law: neo_hookean, young: 1.0e6, poisson: 0.3, density: 1000}}
handles: {base: {where: {face: x-}, fixed: true}, tip: {where: {face: x+}}}
"""
STANDING = """
mesh: {bar: {size: [0.01, 0.01, HEIGHT], cells: [2, 2, 24]}}
materials: {soft: {law: neo_hookean, young: 1.0e5, poisson: 0.3, density: 1000}}
handles: {base: {where: {face: z-}, fixed: true}}
loads: {weight: {gravity: [0, 0, -9.81]}}
"""
PUSHED = """
mesh: {bar: {size: [0.2, 0.01, 0.012], cells: [20, 2, 2]}}
materials: {soft: {law: neo_hookean, young: 1.0e6, poisson: 0.45, density: 1100}}
handles: {base: {where: {face: x-}, fixed: true}}
loads: {push: {surface: {where: {face: x+}, force: [-0.3, 0, 0]}}}
program: {duration: 1.0, loads: {push: [{time: 0.0, value: 0.0}, {time: 1.0, value: 1.0}]}}
"""
SHEET = """
mesh: {bar: {size: [0.1, 0.05, 0.001], cells: [20, 10, 1]}}
materials: {soft: {law: neo_hookean, young: 1.0e6, poisson: 0.45}}
handles: {base: {where: {face: x-}, fixed: true}, tip: {where: {face: x+}}}
program: {duration: 1.0, handles: {tip: [{time: 0.0}, {time: 1.0, translation: [0, 0.01, 0]}]}}
"""
SQUARE = """
mesh: {bar: {size: [0.2, 0.004, 0.004], cells: [20, 1, 1]}}
materials: {rubber: {law: neo_hookean, young: 1.0e6, poisson: 0.3}}
handles: {base: {where: {face: x-}, fixed: true}}
loads: {push: {surface: {where: {face: x+}, force: [FORCE, 0, 0]}}}
"""
LENGTH = 0.2


def _shortened(share: float, aside: float = 0.0) -> Command:
    return Command({"tip": Pose((-share * LENGTH, aside, 0.0))})


@pytest.mark.parametrize("share", [0.02, 0.04, 0.1])
def test_a_column_that_is_shortened_in_one_step_bends(share: float) -> None:
    """A straight column pressed past its buckling load in one step has a bent one's energy, and the same bits again."""
    aside = Simulation(scene_of(COLUMN))
    aside.step(_shortened(share, 0.02))
    bent = aside.step(_shortened(share))
    results = [Simulation(scene_of(COLUMN)).step(_shortened(share)) for _ in range(2)]
    assert [result.converged for result in (bent, *results)] == [True] * 3
    assert results[0].energy == pytest.approx(bent.energy, rel=2e-3)
    assert results[0].stable is True
    assert np.array_equal(results[0].positions, results[1].positions)


def test_a_column_that_is_shortened_in_small_steps_bends() -> None:
    """A column shortened by 2 % in steps of a thousandth has the energy of one that bends in a single step."""
    small, large = Simulation(scene_of(COLUMN)), Simulation(scene_of(COLUMN))
    for share in np.linspace(0.0, 0.02, 21)[1:]:
        result = small.step(_shortened(share))
    assert result.converged
    assert result.energy == pytest.approx(large.step(_shortened(0.02)).energy, rel=2e-3)


def test_steps_that_are_each_far_do_not_hide_a_saddle() -> None:
    """A column stands straight at a shortening of 0.7 %, and bends in one more step, to a shortening of 1.9 %."""
    simulation = Simulation(scene_of(COLUMN))
    stands, bends = [simulation.step(_shortened(share)) for share in (0.007, 0.019)]
    sideways = [np.abs(result.positions - simulation.mesh.vertices)[:, 1:].max() for result in (stands, bends)]
    assert (stands.stable, bends.stable) == (True, True)
    assert sideways[0] < 1e-4
    assert sideways[1] > 5e-3


@pytest.mark.parametrize("load", [1.16, 1.2, 1.5, 1.65, 1.93, 2.13, 2.5])
def test_a_square_column_ends_where_its_energy_is_least(load: float) -> None:
    """A column with 1x1 cells across bends in the direction that its cells prefer, within a tolerance, in one step.

    The energy hardly depends on the direction: its valley is flat, and its tangent may be singular on the way.
    """
    euler = np.pi**2 * 1e6 * 0.004**4 / 12.0 / (4.0 * LENGTH**2)
    scene = scene_of(SQUARE.replace("FORCE", str(-load * euler)))
    exact = replace(scene.solver, tolerance=1e-8, max_iterations=20000)
    simulation, finer = Simulation(scene), Simulation(scene, settings=exact)
    result = simulation.step()
    finer.restore(simulation.snapshot())
    truth = finer.step()
    assert (result.converged, truth.converged) == (True, True)
    away = np.linalg.norm(truth.positions - result.positions, axis=1).max()
    assert away < simulation.settings.tolerance * simulation.mesh.size
    assert np.abs(result.positions[:, 1:] - simulation.mesh.vertices[:, 1:]).max() > 0.05 * LENGTH


@pytest.mark.parametrize(("height", "stands"), [(0.07, True), (0.12, False)])
def test_a_column_stands_under_its_weight_up_to_the_critical_height(height: float, *, stands: bool) -> None:
    """A column lower than Greenhill's critical height of 8.7 cm stands under its weight, a higher one does not."""
    simulation = Simulation(scene_of(STANDING.replace("HEIGHT", str(height))))
    result = simulation.step()
    sideways = np.abs(result.positions - simulation.mesh.vertices)[:, :2].max()
    assert (result.converged, result.stable) == (True, True)
    assert (sideways < 0.05 * height) == stands


def test_a_saddle_that_is_not_left_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """A saddle without a found descent is reported as unstable, with a remedy."""
    monkeypatch.setattr(Stability, "leave", lambda self, task, direction: None)
    result = Simulation(scene_of(COLUMN)).step(_shortened(0.04))
    assert result.stable is False
    assert "unstable" in result.message
    assert "push it aside" in result.message


@pytest.mark.parametrize(("text", "flat", "steps"), [(PUSHED, 7.4e-5, 5), (PUSHED, 7.4e-5, 10), (SHEET, 3.6e-3, 20)])
def test_few_steps_of_few_iterations_hide_no_saddle(text: str, flat: float, steps: int) -> None:
    """A column under five times its buckling load bends, a sheared sheet wrinkles, or the step says it is unstable."""
    *_, last = Simulation(scene_of(text)).play(steps)
    assert last.converged
    assert last.stable is False or not np.isclose(last.energy, flat, rtol=0.02)


@pytest.mark.parametrize("steps", [38, 87, 100, 150])
def test_a_saddle_is_left_in_any_number_of_steps(steps: int) -> None:
    """A bar that yields ends at less energy than an even stretch has, however many steps it is pulled in."""
    *_, last = Simulation(load_scene("tensile_curve")).play(steps)
    assert (last.converged, last.stable) == (True, True)
    assert last.energy < 9.77


def test_a_cable_at_the_edge_of_slack_makes_nothing_unstable() -> None:
    """A gripper with one tendon just slack is not called unstable: pushed aside, it returns."""
    simulation = Simulation(load_scene("gripper"))
    result = advance(simulation, Command(actuators={"left": 0.001439, "right": 0.001784, "upper": 0.0}))
    assert result.stable is not False
    assert result.message == ""
    there, noise = simulation.positions.copy(), np.random.default_rng(0).standard_normal(simulation.positions.shape)
    simulation.set_positions(there + 1e-3 * simulation.mesh.size * noise)
    assert np.abs(simulation.step().positions - there).max() < 1e-4 * simulation.mesh.size


def test_a_policy_without_energy_does_not_say() -> None:
    """The policy ``relative``, which has no energy, reports no stability."""
    text = f"{COLUMN}solver: {{policy: {Policy.RELATIVE.value}}}\n"
    assert Simulation(scene_of(text)).step(_shortened(0.001)).stable is None
