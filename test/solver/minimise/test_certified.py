# SPDX-License-Identifier: Apache-2.0
"""Convergence is not claimed at a saddle, nor far from the equilibrium because of a stiffened tangent."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.torture.honesty import FORKS, PROMISE, error_of
from benchmarks.torture.slender_bodies import FINGERS, fork
from gdfe_ros import Simulation
from gdfe_ros.constraints import Pose
from gdfe_ros.scene import load_scene, scene_from_text
from gdfe_ros.simulation import Command

COLUMN = """
name: column
mesh: {bar: {size: [0.4, 0.008, 0.006], cells: [100, 2, 2]}}
materials: {soft: {law: neo_hookean, young: 1.0e6, poisson: 0.45}}
regions: [{material: soft}]
handles: {base: {where: {face: x-}, fixed: true}, tip: {where: {face: x+}}}
solver: {max_iterations: 5000}
"""

STRIP = """
name: strip
mesh: {bar: {size: [0.1, 0.01, 0.01], cells: [10, 2, 2]}}
materials: {soft: {law: neo_hookean, young: 1.0e6, poisson: 0.45, density: 1000}}
regions: [{material: soft}]
handles: {base: {where: {face: x-}, fixed: true}}
loads: {weight: {gravity: [0, 0, -1.0]}}
"""


@pytest.mark.parametrize("name", FORKS)
def test_a_fork_that_is_drawn_in_one_step_is_near_or_says_that_it_is_not(name: str) -> None:
    """Three fingers drawn far in one step end near the equilibrium, or say that it is unstable or not found."""
    scene = fork(dict(zip(FINGERS, FORKS[name], strict=True)))
    simulation, fine = Simulation(scene), Simulation(scene, settings=replace(scene.solver, tolerance=1e-8))
    result = next(simulation.play(1))
    if not result.converged:
        assert np.isinf(result.error_estimate)
        assert "edge of its stability" in result.message
        return
    if result.stable is False:
        assert "the equilibrium is unstable" in result.message
        return
    fine.restore(simulation.snapshot())
    true = fine.step()
    assert true.converged, true.message
    assert error_of(result, true, simulation.mesh.size) <= PROMISE * simulation.settings.tolerance


@pytest.mark.parametrize("shorter", [1e-3, 4e-3])
def test_a_column_does_not_stay_at_its_saddle(shorter: float) -> None:
    """A straight column pressed far beyond its buckling load in one step has the energy of one that bends."""
    at_once, aside = Simulation(scene_from_text(COLUMN)), Simulation(scene_from_text(COLUMN))
    aside.step(Command({"tip": Pose((-shorter, 0.0, 0.02))}))
    shortened = Command({"tip": Pose((-shorter, 0.0, 0.0))})
    result, bent = at_once.step(shortened), aside.step(shortened)
    assert (result.converged, bent.converged) == (True, True)
    assert result.energy == pytest.approx(bent.energy, rel=1e-3)


@pytest.mark.parametrize(("name", "steps"), [("bending_tube", 75), ("tendon_finger", 250)])
def test_errors_of_small_steps_do_not_add_up(name: str, steps: int) -> None:
    """Each step of 10 ms in a program ends within a tolerance of the equilibrium.

    Errors of 1.5 tolerances accumulated in the tube when no Newton step was made below an estimate of 0.1 tolerances,
    and 3.5 in the finger when tangents were taken at predicted shapes.
    """
    scene = load_scene(name)
    simulation, fine = Simulation(scene), Simulation(scene, settings=replace(scene.solver, tolerance=1e-8))
    for number, result in zip(range(steps), simulation.play(400), strict=False):
        if number >= steps - 5:
            fine.restore(simulation.snapshot())
            true = fine.step()
            assert true.converged, true.message
            assert error_of(result, true, simulation.mesh.size) <= simulation.settings.tolerance


def test_a_step_that_continues_no_motion_takes_few_iterations() -> None:
    """A strip whose load rises and falls takes at most six iterations for each load, and is near its equilibrium."""
    scene = scene_from_text(STRIP)
    simulation, fine = Simulation(scene), Simulation(scene, settings=replace(scene.solver, tolerance=1e-8))
    for weight in (1.0, 3.0, 2.0, 4.0, 3.0, 5.0, 4.0, 6.0):
        result = simulation.step(Command(loads={"weight": weight}))
        assert result.converged, result.message
        assert result.iterations <= 6
        fine.restore(simulation.snapshot())
        assert error_of(result, fine.step(), simulation.mesh.size) <= simulation.settings.tolerance
