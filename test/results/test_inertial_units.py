# SPDX-License-Identifier: Apache-2.0
"""Inertial measurement units at material points: their readings equal those of rigid-body mechanics."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gdfe_ros import Command, Pose, Simulation, load_scene
from gdfe_ros.actuators.embedding import embed
from gdfe_ros.errors import CommandError
from gdfe_ros.mesh.cells.operators import shape_operators
from gdfe_ros.results.inertial_units import imu_reading
from test.solver.motion.conftest import BAR
from test.written import advance, simulate

moving = partial(simulate, BAR)
WEIGHT = {"weight": {"gravity": [0.0, 0.0, -9.81]}}
PROBES = {"tip": [0.1, 0.0, 0.0], "side": [0.07, 0.01, 0.01]}


@pytest.mark.exact("an exact zero without a shift")
def test_a_falling_body_reads_nothing() -> None:
    """Units of a freely flying body read no acceleration and no angular velocity, at any velocity."""
    falling = moving(handles={}, loads=WEIGHT, probes=PROBES, dynamics__velocity=[1.0, -2.0, 3.0])
    advance(falling, count=5)
    for reading in falling.imus().values():
        np.testing.assert_allclose(reading.linear_acceleration, 0.0, atol=1e-8)
        np.testing.assert_allclose(reading.angular_velocity, 0.0, atol=1e-9)
        np.testing.assert_allclose(reading.orientation.as_quat(), [0.0, 0.0, 0.0, 1.0], atol=1e-9)


@pytest.mark.parametrize("factor", [1.0, -0.5])
def test_a_body_at_rest_reads_gravity_upward(factor: float) -> None:
    """A unit of a bar at rest reads, in its cell's rotated frame, the upward acceleration that opposes gravity."""
    sagging = moving(loads=WEIGHT, probes=PROBES, dynamics__damping__mass=30.0, dynamics__scheme="bdf2")
    sagging.step(Command(loads={"weight": factor}))
    while not sagging.settled:
        sagging.step(dt=0.02)
    for reading in sagging.imus().values():
        assert np.sign(reading.orientation.as_rotvec()[1]) == np.sign(factor)
        upward = reading.orientation.apply(reading.linear_acceleration)
        np.testing.assert_allclose(upward, [0.0, 0.0, 9.81 * factor], atol=1e-3)
        np.testing.assert_allclose(reading.angular_velocity, 0.0, atol=1e-3)


def test_a_spinning_body_reads_its_turn_and_what_keeps_it_on_its_circle() -> None:
    """Units of a spinning stiff body read the angular velocity about its axis, and omega^2 r toward the centre."""
    motion = {"dynamics__spin": [0.0, 0.0, 20.0], "dynamics__step": 0.0005, "dynamics__scheme": "bdf2"}
    spinning = moving(handles={}, probes=PROBES, materials__rubber__young=1.0e8, **motion)
    advance(spinning, count=200)
    centre = spinning.mesh.vertices.mean(axis=0)
    for name, reading in spinning.imus().items():
        turned = reading.orientation.as_rotvec()
        assert turned[2] == pytest.approx(20.0 * 0.1, rel=1e-2)
        np.testing.assert_allclose(reading.angular_velocity, [0.0, 0.0, 20.0], atol=0.02)
        arm = np.subtract(PROBES[name], centre) * [1.0, 1.0, 0.0]
        np.testing.assert_allclose(reading.linear_acceleration, -400.0 * arm, atol=0.01 * 400.0 * 0.05)


def test_the_turn_of_a_stretching_cell_is_that_of_its_axes() -> None:
    """The angular velocity of a cell that turns and stretches is R^T dR/dt of the polar decomposition."""
    mesh = moving().mesh
    shape, point = shape_operators(mesh.vertices, mesh.cells), embed(mesh, [PROBES["side"]], what="point")

    def at(time: float) -> np.ndarray:
        turn = Rotation.from_rotvec([0.3 + time, -0.7 * time, 2.0 * time]).as_matrix()
        stretch = np.array([[1.2, 0.3 * time, 0.0], [0.3 * time, 0.8 - time, 0.1], [0.0, 0.1, 1.1 + 2.0 * time]])
        return mesh.vertices @ (turn @ stretch).T

    def read(time: float, tick: float = 1e-5):
        velocities = (at(time + tick) - at(time - tick)) / (2.0 * tick)
        none = np.zeros_like(velocities)
        return imu_reading(shape, point, at(time), velocities, none, gravity=np.zeros(3))

    before, now, after = read(0.199), read(0.2), read(0.201)
    np.testing.assert_allclose(now.orientation.as_rotvec(), [0.5, -0.14, 0.4], atol=1e-9)
    change = (before.orientation.inv() * after.orientation).as_rotvec() / 0.002
    np.testing.assert_allclose(now.angular_velocity, change, atol=1e-5)


def test_a_body_without_mass_has_no_unit() -> None:
    """An IMU reading without dynamics is an error that says which section to add."""
    with pytest.raises(CommandError, match="dynamics"):
        Simulation(load_scene("bend5")).imus()


def test_a_unit_in_a_slow_grip_reads_its_slow_motion() -> None:
    """A bar between two jaws that press more and more reads nearly nothing, and its steps start near their ends."""
    jaws = {
        name: {"plane": [0, 0, sign], "at": [0, 0, -0.0101 * sign], "friction": 0.5}
        for name, sign in {"low": 1, "high": -1}.items()
    }
    given = {"dynamics__scheme": "bdf2", "dynamics__damping": {"viscosity": 100.0}, "dynamics__step": 0.005}
    bar = moving(obstacles=jaws, probes={"side": [0.08, 0.0, 0.01]}, mesh__bar__cells=[10, 2, 2], **given)
    readings, iterations = [], []
    for k in range(60):
        shift = 1e-5 * (k + 1)
        poses = {"low": Pose((0.0, 0.0, shift)), "high": Pose((0.0, 0.0, -shift))}
        result = bar.step(Command(handles=poses))
        assert result.converged
        readings.append(np.abs(bar.imus()["side"].linear_acceleration).max())
        iterations.append(result.iterations)
    assert bar.result.reactions["low"][2] > 1.0
    assert max(readings[20:]) < 1.0  # m/s^2; the forces of the jaws alone would accelerate the vertices by thousands
    assert np.mean(iterations[20:]) <= 1.5
