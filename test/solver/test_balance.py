# SPDX-License-Identifier: Apache-2.0
"""The energy balance of an increment: smooth load paths pass, jumps are reported, inverted elements are refused."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from benchmarks.torture.actuation import DRIVES, scene_text
from benchmarks.torture.bodies import Driver
from benchmarks.torture.snaps import JUMPED, LAWS, SHELLS
from gdfe_ros.constraints import Handle, Pose
from gdfe_ros.materials import Linear
from gdfe_ros.mesh import bar
from gdfe_ros.scene import load_scene
from gdfe_ros.scene.loader import scene_from_text
from gdfe_ros.simulation import Command, Simulation
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.outcome import Outcome
from gdfe_ros.solver.settings import Policy, SolverSettings
from gdfe_ros.solver.solution import Solution
from gdfe_ros.solver.state import Balance, State
from gdfe_ros.solver.stepping.path import has_jumped, work_between
from gdfe_ros.solver.stepping.stepper import Stepper
from test.written import advance


@pytest.fixture(scope="module")
def stepper() -> Stepper:
    """Return the stepper of a bar that is clamped at one end and pulled by a handle at the other."""
    mesh = bar([0.1, 0.1, 0.1], [1, 1, 1])
    x = mesh.vertices[:, 0]
    handles = [Handle(name, np.flatnonzero(x == end).astype(np.int32)) for name, end in (("base", 0.0), ("tip", 0.1))]
    body = Body.build(mesh.vertices, mesh.cells, [Linear(young=1e5, poisson=0.3)], np.zeros(1, np.int32), handles)
    return Stepper(body, SolverSettings())


def _spring(stepper: Stepper, stretch: float, lost: float = 0.0) -> Solution:
    """Return an equilibrium of a spring of 2 N/m pulled along x by a handle, with ``lost`` [J] less energy."""
    rest = stepper.at_rest()
    wrench = {"base": np.zeros(6), "tip": np.array([2.0 * stretch, 0.0, 0.0, 0.0, 0.0, 0.0])}
    summary = dataclasses.replace(rest.summary, energy=stretch**2 - lost, reactions=wrench)
    poses = {"base": Pose(), "tip": Pose((stretch, 0.0, 0.0))}
    return _solution(rest.with_(summary=summary, poses=poses))


def _solution(state: State) -> Solution:
    found = state.with_(balance=Balance(potential=0.0, slopes={}))
    return Solution(state=found, iterations=1, ended=Outcome.NEAR, began=state.positions + 1.0)


def test_a_spring_keeps_its_energy(stepper: Stepper) -> None:
    """The work on a spring is exact; the same energy loss is a jump in a short increment, but not in a long one."""
    handles, begin, end = stepper.equilibrium.handles, _spring(stepper, 1.0).state, _spring(stepper, 1.1)
    work, doubt = work_between(begin, end.state, handles)
    assert work == pytest.approx(0.21)
    assert doubt == pytest.approx(0.01)
    assert not has_jumped(begin, end, handles, 0.1)
    assert has_jumped(begin, _spring(stepper, 1.1, lost=0.1), handles, 0.1)
    assert not has_jumped(_spring(stepper, 0.0).state, _spring(stepper, 1.1, lost=0.1), handles, 0.1)


def test_moments_work_on_turns_in_world_axes(stepper: Stepper) -> None:
    """The rotation of a handle between two poses is the relative rotation, not the difference of rotation vectors."""
    begin, end = (1.0, 0.4, -0.3), (1.01, 0.41, -0.28)
    turn = (Rotation.from_rotvec(end) * Rotation.from_rotvec(begin).inv()).as_rotvec()
    rest = stepper.at_rest()
    for axis in range(3):
        wrench = {"base": np.zeros(6), "tip": np.eye(6)[3 + axis]}
        summary = dataclasses.replace(rest.summary, reactions=wrench)
        first, last = (
            _solution(rest.with_(summary=summary, poses={"base": Pose(), "tip": Pose(rotation=pose)}))
            for pose in (begin, end)
        )
        work, _ = work_between(first.state, last.state, stepper.equilibrium.handles)
        assert work == pytest.approx(turn[axis], abs=1e-6)


@pytest.mark.parametrize("name", ["tendon_finger", "gripper", "three_chamber_arm"])
def test_driven_scenes_balance(name: str) -> None:
    """In small steps of a program, energy and work of cables, chambers and weights balance, and no jump is reported."""
    scene = load_scene(name)
    scene = dataclasses.replace(scene, solver=dataclasses.replace(scene.solver, tolerance=1e-6))
    simulation, last, worst = Simulation(scene), None, 0.0
    for _, result in zip(range(12), simulation.play(steps=40), strict=False):
        assert JUMPED not in result.message
        state = simulation.snapshot().state
        if last is not None and last.balance is not None and state.balance is not None:
            work, _ = work_between(last, state, simulation.stepper.equilibrium.handles)
            before, after = (each.summary.energy + each.balance.potential for each in (last, state))
            worst = max(worst, abs(before + work - after) / max(state.summary.energy, abs(state.balance.potential)))
        last = state
    assert 0.0 < worst < 0.02


@pytest.mark.parametrize("name", SHELLS)
def test_snapping_through_is_told_once(name: str) -> None:
    """A shallow shell loaded in small steps reports a jump in exactly one step, and the next steps converge."""
    shell = SHELLS[name]
    driver = Driver(shell.scene(LAWS["linear"](), 1e-6))
    told = [JUMPED in driver.step(loads={"push": share * shell.weight}).message for share in np.linspace(0.05, 1.0, 20)]
    assert sum(told) == 1
    assert driver.results[-1].converged


def test_nothing_is_left_inside_out() -> None:
    """A ball evacuated far too much stops at its last sound equilibrium, says so, and returns when released."""
    simulation = Simulation(scene_from_text(scene_text(DRIVES["vacuum of 10 bar"], "linear", Policy.ENERGY)))
    result = simulation.step(Command(actuators={"a": -1e6}))
    assert not result.converged
    assert "inside out" in result.message
    assert result.min_det > 0.0
    assert -1e6 < simulation.snapshot().state.commands["a"] < 0.0
    back = advance(simulation, Command(actuators={"a": 0.0}))
    assert np.abs(back.positions - simulation.mesh.vertices).max() < 1e-4 * simulation.mesh.size
