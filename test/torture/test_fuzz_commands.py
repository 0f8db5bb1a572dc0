# SPDX-License-Identifier: Apache-2.0
"""Fuzzing of commands: each is refused with the state unchanged, or leads to a finite state."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from gdfe_ros.constraints import Pose
from gdfe_ros.errors import CommandError
from gdfe_ros.simulation import Command, Simulation
from test.torture.examples import examples
from test.written import scene_of

SCENE = """\
mesh: {bar: {size: [0.2, 0.05, 0.05], cells: [4, 1, 1]}}
materials: {m: {law: neo_hookean, young: 1.0e5, poisson: 0.45, density: 1.0e3}}
handles:
  base: {where: {face: x-}, fixed: true}
  tip: {where: {face: x+}}
actuators:
  tendon: {cable: {points: [[0.0, 0.0, 0.02], [0.15, 0.0, 0.02]], command: tension, range: [0.0, 50.0]}}
loads: {weight: {gravity: [0, 0, -9.81]}}
solver: {tolerance: 1.0e-3, max_iterations: 300}
"""
pytestmark = pytest.mark.usefixtures("limited")
QUICK = examples(60)
NUMBER = st.one_of(st.floats(-0.3, 0.3), st.floats(), st.sampled_from([0.0, 1e-300, 1e300, 1e3, -1e3]))
VECTOR = st.tuples(NUMBER, NUMBER, NUMBER)
NAMES = st.sampled_from(["tip", "base", "nobody", ""])


@pytest.fixture(scope="module")
def simulation() -> Simulation:
    """Return one simulation for all examples: each continues from the end of the one before."""
    return Simulation(scene_of(SCENE))


def _snapshot(simulation: Simulation) -> tuple[object, ...]:
    return simulation.time, dict(simulation.targets), dict(simulation.commands), simulation.positions.tobytes()


@given(NAMES, VECTOR, VECTOR, st.sampled_from(["tendon", "weight", "nobody"]), NUMBER, st.floats(0.0, 1.0))
@example("tip", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), "weight", 1e300, 0.1)
@example("tip", (1e3, 0.0, 0.0), (0.0, 0.0, 0.0), "tendon", 50.0, 0.1)
@QUICK
def test_any_command(
    simulation: Simulation,
    name: str,
    translation: tuple[float, float, float],
    rotation: tuple[float, float, float],
    driven: str,
    value: float,
    dt: float,
) -> None:
    """Any command of any handle, actuator or load is refused without a change, or gives finite results."""
    before = _snapshot(simulation)
    try:
        kind = "loads" if driven == "weight" else "actuators"
        command = Command(handles={name: Pose(translation, rotation)}, **{kind: {driven: value}})
        result = simulation.step(command, dt=dt)
    except (CommandError, ValueError):
        assert _snapshot(simulation) == before
        return
    assert np.isfinite(result.positions).all()
    assert np.isfinite([result.energy, result.min_det]).all()
    assert np.isfinite(result.error_estimate) if result.converged else result.message


def test_the_simulation_recovers(simulation: Simulation) -> None:
    """After all examples and a reset, the body bends as a new one does."""
    simulation.reset()
    pose = Pose(translation=(0.0, 0.0, 0.05))
    found = simulation.step(Command({"tip": pose}))
    fresh = Simulation(scene_of(SCENE)).step(Command({"tip": pose}))
    assert found.converged
    np.testing.assert_array_equal(found.positions, fresh.positions)


@given(st.lists(VECTOR, min_size=20, max_size=20))
@QUICK
def test_any_positions(simulation: Simulation, rows: list[tuple[float, float, float]]) -> None:
    """Any positions are refused, or lead to a finite state."""
    before = _snapshot(simulation)
    try:
        simulation.set_positions(np.array(rows))
    except CommandError:
        assert _snapshot(simulation) == before
        return
    result = simulation.step()
    assert np.isfinite(result.positions).all()
    assert result.converged or result.message
