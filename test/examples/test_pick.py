# SPDX-License-Identifier: Apache-2.0
"""A soft hand on a stock arm picks a soft cube, with forces that are measured at the fingertips."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import pytest

from gdfe_ros import Command, Simulation, load_scene
from gdfe_ros.examples.pick import GRAVITY, LIFTED, forces_of, make_schedule, soft_cells, soft_object
from gdfe_ros.examples.picker import motions
from gdfe_ros.examples.soft_grip import BAND, SoftGrip

SWAPPED = {"meshes.cube.at": [0.43, 0.14, 0.02], "bodies.box.at": [0.45, -0.14, 0.02]}
"""Overrides that put the cube where the hand closes first."""
LIFT = 2.9
"""Time [s] at which the first object is in the air."""


def play(simulation: Simulation, forces: Sequence[float]) -> Iterator[Any]:
    """Yield the results of the steps up to `LIFT`; the ``forces`` [N] of the fingers are controlled."""
    scene, dt = simulation.scene, simulation.scene.dynamics.step
    schedule, felt = make_schedule(scene, forces), dict.fromkeys(simulation.actuator_names, 0.0)
    for number in range(round(LIFT / dt)):
        joints = scene.program.joint_positions((number + 1) * dt)
        result = simulation.step(Command(actuators=schedule.commands(number * dt, felt), joints=joints), dt=dt)
        yield result
        felt = {name: abs(float(sensor.wrench(result)[0])) for name, sensor in scene.sensors.items()}


@pytest.mark.parametrize(("scene", "strain"), [("pick_ur5e", 0.02), ("pick_panda", 0.03)])
def test_a_soft_cube_is_lifted_without_crushing(scene: str, strain: float) -> None:
    """The cube's strain stays below the controller's limit, and it receives the published force in each step."""
    simulation = Simulation(load_scene(scene, overrides=SWAPPED))
    (mass, corners), masses = soft_object(simulation.scene), simulation.stepper.mass
    cells, own = soft_cells(simulation.scene), np.unique(corners)
    points, momenta, forces, largest = [], [], [], 0.0
    for result in play(simulation, forces_of(simulation.scene, strain)[1:]):
        assert result.converged, result.message
        points.append(result.positions[own])
        momenta.append((masses[own][:, own] @ result.velocities[own]).sum(axis=0))
        forces.append(-sum(sensor.wrench(result)[:3] for sensor in simulation.scene.sensors.values()))
        largest = max(largest, float(simulation.fields().eps_eq[cells].max()))
    heights = np.array(points)[..., 2].min(axis=1)
    lifted, received = heights > LIFTED, np.diff(momenta, axis=0) / 0.01 - mass * GRAVITY
    errors = np.linalg.norm(forces[1:] - received, axis=1)[lifted[1:] & lifted[:-1]] / (9.81 * mass)
    assert heights[-1] > 0.03
    assert len(errors) > 20
    assert errors.max() < 0.001
    assert 0.5 * strain < largest < strain


def test_pauses_end_a_motion() -> None:
    """Each motion of the program is one trajectory, which ends at the program's joint positions, at rest."""
    program = load_scene("pick_ur5e").program
    found = list(motions(program))
    assert [start for start, _ in found][:4] == [0.0, 2.3, 3.1, 4.1]
    start, trajectory = found[0]
    (point,) = trajectory.points
    end = program.joint_positions(start + point.time_from_start.sec + 1e-9 * point.time_from_start.nanosec)
    assert dict(zip(trajectory.joint_names, point.positions, strict=True)) == end
    assert set(point.velocities) == {0.0}


def test_the_grip_reaches_its_force_on_any_stiffness() -> None:
    """With springs of unequal stiffness and place, the force goes to the goal's band, and the fingers open again."""
    for stiffness in (1e-5, 3e-5):
        grip = SoftGrip({"a": 1.0, "b": 0.5, "c": 0.5}, rate=80e3, gain=240e3, low=-10e3, high=120e3)
        begins, forces = {"a": 30e3, "b": 20e3, "c": 25e3}, dict.fromkeys("abc", 0.0)
        for _ in range(400):
            commands = grip.hold(forces, 0.5, 0.01)
            forces = {name: stiffness * max(commands[name] - begin, 0.0) for name, begin in begins.items()}
        assert sum(forces.values()) == pytest.approx(1.0, rel=BAND)
        for _ in range(200):
            commands = grip.release(0.01)
        assert set(commands.values()) == {-10e3}


@pytest.mark.parametrize("wrong", [{"rate": 0.0}, {"gain": -1.0}, {"high": -20e3}, {"threshold": 0.0}])
def test_a_wrong_grip_is_refused(wrong: dict[str, float]) -> None:
    """Arguments out of their ranges raise an error that gives the values."""
    with pytest.raises(ValueError, match="allowed"):
        SoftGrip({"a": 1.0}, **{"rate": 1.0, "gain": 1.0, "low": 0.0, "high": 1.0, **wrong})
