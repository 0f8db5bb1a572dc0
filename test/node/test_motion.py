# SPDX-License-Identifier: Apache-2.0
"""A node with dynamics: its published motion and its steps."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, TwistStamped
from sensor_msgs.msg import Imu, PointCloud2
from std_srvs.srv import SetBool

from gdfe_ros.analysis.bag_run import BagRun
from gdfe_ros.constraints import Pose
from gdfe_ros.recording.step import Begin
from gdfe_ros.scene import load_scene
from gdfe_ros.simulation import Simulation
from test.node.conftest import Tree, to_nanoseconds, vector, vertices
from test.written import advance

_DROP = {"scene": "drop", "scene_overrides": ["mesh.bar.cells=[10, 1, 1]"]}


def test_velocities_and_energies_are_told(client: Any, launch: Callable) -> None:
    """Velocities of a released bar equal differences of positions; without damping, its energies balance."""
    client.listen("velocity", PointCloud2)
    launch(**_DROP, clock="lockstep", dt=0.001)
    first = client.last("velocity")
    assert [field.name for field in first.fields] == ["x", "y", "z", "vx", "vy", "vz"]
    assert first.header.frame_id == "base_link"
    assert not vertices(first)[:, 3:].any()
    client.advance(40)
    client.wait(lambda: len(client.received["velocity"]) == 41 == len(client.received["mesh"]) == len(client.records()))
    before, now, after = (vertices(message) for message in client.received["velocity"][18:21])
    np.testing.assert_allclose(now[:, :3], client.meshes()[19][:, :3])
    np.testing.assert_allclose(now[:, 3:], (after[:, :3] - before[:, :3]) / 0.002, atol=1e-3)
    assert now[:, 5].min() < -0.1
    energies = client.record().energies
    assert list(energies) == ["kinetic", "elastic", "potential", "work", "dissipated"]
    assert energies["kinetic"] > 0.001
    assert energies["kinetic"] + energies["elastic"] == pytest.approx(-energies["potential"], rel=0.02)
    told = client.diagnostics()
    assert [told[f"energy: {name} [J]"] for name in energies] == [f"{value:.6g}" for value in energies.values()]


def test_diagnostics_warn_of_a_stuck_body(client: Any, launch: Callable) -> None:
    """A crushed bar whose step fails is reported by a warning with the reason."""
    crushed = ["loads.weight.gravity=[-1.0e6, 0, -1.0e6]", "solver.max_iterations=5"]
    overrides = [*_DROP["scene_overrides"], *crushed]
    launch(**{**_DROP, "scene_overrides": overrides}, clock="lockstep", dt=0.01)
    client.advance(3)
    client.wait(lambda: len(client.records()) == 4)
    assert client.record().skipped == {"solve": 1}
    told = client.diagnostics()
    assert told["level"] == "1"
    assert told["message"].startswith("not converged: simulated 0 of 0.01 s: an internal step of")


def test_each_probe_has_an_inertial_unit(client: Any, launch: Callable, tree: Tree) -> None:
    """The IMU of the tip reads gravity before the release, nothing after it, and later the simulation's values.

    Its frame on /tf is at the probe and is rotated as the IMU reports.
    """
    client.listen("probe/tip/imu", Imu)
    client.listen("probe/tip", PoseStamped)
    launch(**_DROP, clock="lockstep", dt=0.002)
    client.advance(10)
    units = client.wait(lambda: client.received["probe/tip/imu"][10:] and client.received["probe/tip/imu"])
    assert units[0].header.frame_id == "tip_imu"
    np.testing.assert_allclose(vector(units[0].linear_acceleration), [0.0, 0.0, 9.81], atol=1e-12)
    np.testing.assert_allclose(vector(units[2].linear_acceleration), 0.0, atol=0.01)
    simulation = Simulation(load_scene("drop", overrides={"mesh.bar.cells": [10, 1, 1]}))
    advance(simulation, dt=0.002, count=10)
    expected, told = simulation.imus()["tip"], units[10]
    assert vector(told.linear_acceleration) == list(expected.linear_acceleration)
    assert vector(told.angular_velocity) == list(expected.angular_velocity)
    assert [*vector(told.orientation), told.orientation.w] == list(expected.orientation.as_quat())
    probe = client.arrived("probe/tip", told.header.stamp)
    frame = client.wait(lambda: tree.told[to_nanoseconds(told.header.stamp)].get("tip_imu")).transform
    assert frame.rotation == told.orientation
    assert vector(frame.translation) == vector(probe.pose.position)


def test_a_body_in_motion_is_stepped_until_it_rests(client: Any, start: Callable) -> None:
    """With the wall clock, a released damped bar is stepped without orders until it is at rest; heartbeats follow."""
    start(scene="drop", scene_overrides=[*_DROP["scene_overrides"], "dynamics.damping.mass=30"], heartbeat=0.3)
    client.wait(lambda: client.record().skipped.get("solve") and client.record().step > 1)
    records = [record for record in client.records() if record.step]
    moving = [record for record in records if "solve" not in record.skipped]
    assert len(moving) > 20
    assert {record.dt for record in moving} == {0.01}
    client.wait(lambda: client.record().dt >= 0.29)
    assert client.record().energies["kinetic"] < 1e-8
    assert client.mesh()[:, 5].min() < -0.05


def test_a_handle_is_shaken_by_velocities_and_the_bag_replays(
    client: Any, start: Callable, replays: Callable, tmp_path: Path
) -> None:
    """The whip, shaken in lockstep and then left alone, swings on, and the bag replays bit for bit."""
    process = start(scene="whip", clock="lockstep", record=True, bag_path=str(tmp_path / "bag"), velocity_timeout=0.05)
    for speed in (0.4, -0.4, 0.4):
        _shake(client, speed, steps=5)
    client.advance(10)
    client.wait_steps(26)
    records = client.records()[1:]
    assert records[4].handles["base"].translation[2] == pytest.approx(0.02)
    assert records[4].energies["kinetic"] > 1e-3
    assert not records[-1].handles
    assert np.ptp([mesh[:, 5].min() for mesh in client.meshes()[-10:]]) > 1e-3
    process.stop()
    assert {"velocity", "probe/tip/imu", "probe/tip", "mesh", "step_record"} <= {
        topic for topic, _ in replays(tmp_path / "bag")
    }


def test_a_bag_begun_in_flight_replays(client: Any, start: Callable, replays: Callable, tmp_path: Path) -> None:
    """A bag started during a motion, with the wall clock and a deadline that cuts steps, replays bit for bit."""
    process = start(**_DROP, deadline=0.004, bag_path=str(tmp_path / "bag"))
    client.wait(lambda: client.record().energies["kinetic"] > 1e-3)
    client.switch("record", True)
    assert "already" in client.call(SetBool, "record", SetBool.Request(data=True)).message
    assert client.set(**{"materials.rubber.young": 3e4})[0].reason.startswith("a bag is being written")
    count = client.record().step
    client.wait(lambda: client.record().step > count + 50)
    process.stop()
    assert {"velocity", "probe/tip/imu", "probe/tip", "mesh", "strain", "step_record"} <= {
        topic for topic, _ in replays(tmp_path / "bag")
    }
    begins = [record.begin for record in BagRun(tmp_path / "bag").records]
    assert begins == [Begin.LOADED] + (len(begins) - 1) * [Begin.LAST]


def test_a_saved_motion_goes_on_as_it_was(client: Any, launch: Callable, tmp_path: Path) -> None:
    """A motion saved and loaded repeats the same bits; after a reset the body starts undeformed and falls again."""
    launch(**_DROP, clock="lockstep", state_path=str(tmp_path / "folder" / "state"))
    client.advance(5)
    client.trigger("save_state")
    client.advance(5)
    client.trigger("load_state")
    client.advance(5)
    client.trigger("reset")
    client.advance(5)
    client.wait_steps(23)
    records, meshes = client.records(), client.meshes()
    assert [records[place].begin for place in (11, 17)] == [Begin.LOADED, Begin.REST]
    for again, first in (*zip(range(11, 17), range(5, 11), strict=True), *zip(range(17, 23), range(6), strict=True)):
        assert records[again].time == records[first].time
        assert records[again].energies == records[first].energies
        assert np.array_equal(meshes[again], meshes[first])
    assert (records[17].time, records[17].energies["kinetic"]) == (0.0, 0.0)


def test_a_command_after_a_rest_acts_in_one_step(client: Any, launch: Callable) -> None:
    """After half a second without commands, one step covers that time, and the next, of one dt, has the command."""
    launch(scene="whip", scene_overrides=["loads={}", "dynamics.damping.mass=30"], heartbeat=0.0)
    client.target(0.0, handle="base")
    client.wait_taken(1)
    client.spin(0.5)
    client.target(0.01, handle="base")
    client.wait(lambda: any(record.handles.get("base", Pose()).translation[2] for record in client.records()))
    record = next(each for each in client.records() if each.handles.get("base", Pose()).translation[2])
    assert record.dt == 0.01
    before = next(each for each in client.records() if each.step == record.step - 1)
    assert before.dt > 0.3
    assert not before.handles


def test_a_modulus_that_changes_sets_a_resting_body_in_motion(client: Any, start: Callable) -> None:
    """A bar at rest that is made four times stiffer swings up and settles at the stiffer bar's equilibrium."""
    damped = [*_DROP["scene_overrides"], "dynamics.damping.mass=30", "dynamics.scheme=bdf2"]
    start(scene="drop", scene_overrides=damped, clock="fast", heartbeat=0.1)
    client.wait(lambda: client.record().skipped.get("solve") and client.record().step > 1)
    sag, time = client.mesh()[:, 5].min(), client.record().time
    assert client.set(**{"materials.rubber.young": 2.0e6})[0].successful
    client.wait(lambda: client.record().begin is Begin.LAST and client.record().time > time + 0.5)
    client.wait(lambda: client.record().energies["kinetic"] < 1e-9)
    overrides = {"mesh.bar.cells": [10, 1, 1], "materials.rubber.young": 2.0e6, "dynamics": None}
    equilibrium = Simulation(load_scene("drop", overrides=overrides)).step().positions
    client.wait(lambda: abs(client.mesh()[:, 2].min() - equilibrium[:, 2].min()) < 1e-4)
    assert client.mesh()[:, 5].min() > 0.5 * sag


def _shake(client: Any, speed: float, *, steps: int) -> None:
    """Command a velocity of the base upward [m/s] and wait until so many lockstep steps are made."""
    message, count = TwistStamped(), len(client.received["step_record"]) if client.received["step_record"] else 1
    message.twist.linear.z = speed
    client.publish("handles/base/velocity", message)
    client.wait_steps(count + 1)
    client.advance(steps - 1)
    client.wait_steps(count + steps)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_body_that_is_put_nowhere_stays(client: Any, start: Callable, value: float) -> None:
    """Puts of a body with a NaN position or rotation are refused and counted, and steps continue."""
    process = start(scene="grasp", clock="lockstep", dt=0.005)
    for part in ("position", "orientation"):
        message = PoseStamped()
        message.pose.orientation.w = 1.0
        getattr(message.pose, part).z = value
        client.publish("bodies/part/set", message)
    client.wait(lambda: client.status().get("refused: not finite") == "2")
    client.advance()
    told = client.status()
    assert (told["state"], told["steps failed"]) == ("active", "0")
    assert "Traceback" not in process.log
