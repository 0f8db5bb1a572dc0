# SPDX-License-Identifier: Apache-2.0
"""Convergence is not claimed at a saddle, nor far from the equilibrium because of a stiffened tangent."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.torture.honesty import FORKS, PROMISE, error_of
from benchmarks.torture.slender_bodies import FINGERS, fork
from gdfe_ros import Simulation
from gdfe_ros.simulation import Command
from test.written import advance, scene_of

STRIP = """
mesh: {bar: {size: [0.1, 0.01, 0.01], cells: [10, 2, 2]}}
materials: {soft: {law: neo_hookean, young: 1.0e6, poisson: 0.45, density: 1000}}
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
    true = advance(fine)
    assert error_of(result, true, simulation.mesh.size) <= PROMISE * simulation.settings.tolerance


def test_a_step_that_continues_no_motion_takes_few_iterations() -> None:
    """A strip whose load rises and falls takes at most six iterations for each load, and is near its equilibrium."""
    scene = scene_of(STRIP)
    simulation, fine = Simulation(scene), Simulation(scene, settings=replace(scene.solver, tolerance=1e-8))
    for weight in (1.0, 3.0, 2.0, 4.0, 3.0, 5.0, 4.0, 6.0):
        result = advance(simulation, Command(loads={"weight": weight}))
        assert result.iterations <= 6
        fine.restore(simulation.snapshot())
        assert error_of(result, fine.step(), simulation.mesh.size) <= simulation.settings.tolerance
