# SPDX-License-Identifier: Apache-2.0
"""Exceptions in a step: the node pauses in the last good state, its bag stays complete, and it continues."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rclpy
from rclpy.executors import MultiThreadedExecutor
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from gdfe_ros.errors import CommandError, GdfeError, RecordingError
from gdfe_ros.node.driving.orders import PoseOrder
from gdfe_ros.node.driving.stepping_thread import SteppingThread
from gdfe_ros.node.middleware.process import make_executor
from gdfe_ros.node.sim_node import SimNode
from gdfe_ros.recording.reader import BagReader
from gdfe_ros.simulation import Simulation

PARAMETERS = {"scene_overrides": ["mesh.bar.cells=[8, 2, 2]"], "clock": "lockstep", "record": True}


class _Robot:
    """A node in this process."""

    def __init__(self, make: Callable[..., Any] = make_executor, **parameters: Any) -> None:
        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        overrides = [Parameter(name, value=value) for name, value in {**PARAMETERS, **parameters}.items()]
        self.node = SimNode(context=self.context, parameter_overrides=overrides)
        self.executor = make(context=self.context)
        self.executor.add_node(self.node)

    def wait(self, done: Callable[[], Any]) -> None:
        end = time.monotonic() + 300.0
        while not done():
            assert time.monotonic() < end
            self.executor.spin_once(timeout_sec=0.05)

    def wait_for_the_first_step(self) -> None:
        self.wait(lambda: self.node.lifecycle_state == "active" and self.node.session.stepper.count == 1)

    def command(self, z: float) -> None:
        inbox = self.node.session.inputs.inbox
        inbox.put("handles/tip/target", PoseOrder("tip", (0.0, 0.0, z), (0.0, 0.0, 0.0, 1.0)))

    def close(self) -> None:
        self.node.close()
        self.executor.remove_node(self.node)
        self.executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)


def _broken(*_: Any, **__: Any) -> None:
    raise ZeroDivisionError("broken on purpose")


@pytest.mark.parametrize("make", [make_executor, MultiThreadedExecutor], ids=["events", "threads"])
def test_a_failure_while_the_node_becomes_active_is_not_forgotten(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, make: Callable[..., Any]
) -> None:
    """If the first step raises during activation, the node is active, paused, and gives the reason."""
    start = SteppingThread.start

    def start_and_wait(stepper: SteppingThread, *given: Any, **options: Any) -> None:
        monkeypatch.setattr(Simulation, "step", _broken)
        start(stepper, *given, **options)
        while not stepper.failure:
            time.sleep(0.01)
        monkeypatch.undo()

    monkeypatch.setattr(SteppingThread, "start", start_and_wait)
    robot = _Robot(make, bag_path=str(tmp_path / "bag"))
    robot.wait(lambda: robot.node.lifecycle_state == "active")
    stepper = robot.node.session.stepper
    assert "broken on purpose" in stepper.failure
    assert stepper.paused
    stepper.pause(False)
    robot.command(0.1)
    robot.wait(lambda: stepper.count == 1)
    assert not stepper.failure
    robot.close()


def test_a_failing_step_pauses_the_node_in_its_last_good_state(tmp_path: Path) -> None:
    """If the solver raises, the node pauses without a loss; it continues later, and the bag has all steps."""
    robot = _Robot(bag_path=str(tmp_path / "bag"))
    robot.wait_for_the_first_step()
    robot.command(0.05)
    session = robot.node.session
    robot.wait(lambda: session.stepper.count == 2)
    simulation, before = session.simulation, session.simulation.snapshot()
    step = simulation.step
    simulation.step = _broken
    robot.command(0.1)
    robot.wait(lambda: session.stepper.failure)
    assert session.stepper.failure.startswith("step 2 to ")
    assert "broken on purpose" in session.stepper.failure
    assert (robot.node.lifecycle_state, session.stepper.paused) == ("active", True)
    assert simulation.targets == before.targets
    assert np.array_equal(simulation.positions, before.state.positions + simulation.origin)
    simulation.step = step
    robot.command(0.06)
    robot.wait(lambda: session.stepper._inbox.ready())
    session.stepper.pause(False)
    robot.wait(lambda: session.stepper.count == 3)
    assert not session.stepper.failure
    assert simulation.targets["tip"].translation[2] == 0.06
    robot.close()
    assert BagReader(tmp_path / "bag").counts["/gdfe_sim/mesh"] == 3


def test_positions_that_are_no_numbers_are_not_published(tmp_path: Path) -> None:
    """A step with NaN is not published, and the node pauses in the state before it."""
    robot = _Robot(bag_path=str(tmp_path / "bag"))
    robot.wait_for_the_first_step()
    session = robot.node.session
    step = session.simulation.step

    def poisoned(*given: Any, **named: Any) -> Any:
        result = step(*given, **named)
        result.positions[0] = np.nan
        return result

    session.simulation.step = poisoned
    robot.command(0.1)
    robot.wait(lambda: session.stepper.failure)
    assert "not finite numbers" in session.stepper.failure
    assert robot.node.lifecycle_state == "active"
    assert session.simulation.targets["tip"].translation[2] == 0.0
    assert np.isfinite(session.simulation.positions).all()
    robot.close()
    assert BagReader(tmp_path / "bag").counts["/gdfe_sim/mesh"] == 1


def test_what_publishing_raises_is_told_and_ends_nothing(tmp_path: Path) -> None:
    """If publishing a step raises, that is counted as a fault, and the next step is published."""
    robot = _Robot(bag_path=str(tmp_path / "bag"))
    robot.wait_for_the_first_step()
    session = robot.node.session
    session.flush()
    publish, left = session.step_publisher._handle, [1]

    def once(step: Any) -> None:
        if left and left.pop():
            _broken()
        publish(step)

    session.step_publisher._handle = robot.node.guard(once, "publishing a step")
    for count, z in ((2, 0.05), (3, 0.06)):
        robot.command(z)
        robot.wait(lambda count=count: session.stepper.count == count)
    session.flush()
    assert robot.node.faults.count == 1
    assert "publishing a step" in robot.node.faults.last
    assert robot.node.lifecycle_state == "active"
    robot.close()
    assert BagReader(tmp_path / "bag").counts["/gdfe_sim/mesh"] == 2


def _fail_often(robot: _Robot, count: int) -> None:
    """Let every other step raise, and continue after each."""
    session = robot.node.session
    step, made = session.simulation.step, session.stepper.count
    for number in range(count):
        session.simulation.step = _broken
        robot.command(0.05)
        robot.wait(lambda number=number: session.stepper.failures == number + 1)
        session.simulation.step = step
        session.stepper.pause(False)
        robot.command(0.05 + 0.01 * (number % 2))
        robot.wait(lambda number=number: session.stepper.count == made + number + 1)
    assert session.stepper.failures == count
    assert robot.node.lifecycle_state == "active"
    assert session.run.last.result.converged


@pytest.mark.parametrize(
    ("make", "count"),
    [(make_executor, 30), (MultiThreadedExecutor, 10), pytest.param(make_executor, 1000, marks=pytest.mark.torture)],
    ids=["events", "threads", "thousand"],
)
def test_many_failed_steps_lose_nothing(tmp_path: Path, make: Callable[..., Any], count: int) -> None:
    """After each of many failed steps the next step converges, and the bag has all converged steps."""
    robot = _Robot(make, bag_path=str(tmp_path / "bag"))
    robot.wait_for_the_first_step()
    _fail_often(robot, count)
    robot.close()
    assert BagReader(tmp_path / "bag").counts["/gdfe_sim/mesh"] == count + 1


@pytest.mark.parametrize("count", [20, pytest.param(1000, marks=pytest.mark.torture)])
def test_a_node_of_its_own_outlives_failed_steps(client: Any, launch: Callable, tmp_path: Path, count: int) -> None:
    """Steps of 1000 s fail because of too many internal steps; all other steps are made and in the bag."""
    bag = tmp_path / "bag"
    mesh = ["mesh.bar.cells=[10, 1, 1]", "dynamics.step=0.001"]
    process = launch(scene="drop", scene_overrides=mesh, clock="lockstep", record=True, bag_path=str(bag))
    for number in range(count):
        client.set(dt=1e3)
        answer = client.call(Trigger, "step", Trigger.Request())
        assert not answer.success
        assert "paused in the last good state" in answer.message
        client.set(dt=0.01)
        if number % 2:
            client.switch("pause", False)
        client.advance()
    values = client.status()
    assert (values["state"], values["steps failed"], values["steps"]) == ("active", str(count), str(count + 1))
    client.set(dt=1e3)
    assert not client.call(Trigger, "step", Trigger.Request()).success
    assert process.stop() == 0, process.log
    assert "Traceback" not in process.log
    assert BagReader(bag).counts["/gdfe_sim/mesh"] == count + 1


def test_bags_that_failed_and_bags_that_did_not_are_told(tmp_path: Path) -> None:
    """A sound bag, one on a full disk, and a sound one again each end with the right answer."""
    robot = _Robot(bag_path=str(tmp_path / "first"))
    robot.wait_for_the_first_step()
    session = robot.node.session
    assert "0 dropped" in session.record(False)
    for name, fails in (("second", True), ("third", False)):
        robot.node.set_parameters([Parameter("bag_path", value=str(tmp_path / name))])
        session.stepper.post(lambda: session.record(True)).result()
        if fails:
            session.bags.recorder._fail(RecordingError("no space left"))
            with pytest.raises(GdfeError, match="no space left; nothing later is in the bag"):
                session.record(False)
        else:
            assert "0 dropped" in session.record(False)
    robot.close()


def test_a_command_that_the_simulation_refuses_is_counted_and_passed_over(tmp_path: Path) -> None:
    """A command that the simulation refuses is counted, and the step is made without it."""
    robot = _Robot(bag_path=str(tmp_path / "bag"))
    robot.wait_for_the_first_step()
    simulation = robot.node.session.simulation
    step = simulation.step

    def picky(command: Any, **named: Any) -> Any:
        if command.handles:
            raise CommandError("not today")
        return step(command, **named)

    simulation.step = picky
    robot.command(0.1)
    robot.wait(lambda: robot.node.session.stepper.count == 2)
    assert robot.node.lifecycle_state == "active"
    assert robot.node.refusals.counts()["refused: out of range"] == 1
    robot.close()


def test_close_is_harmless_at_any_time() -> None:
    """A node can be closed before it is configured, and twice."""
    robot = _Robot(autostart=False)
    robot.node.close()
    assert robot.node.lifecycle_state == "unconfigured"
    robot.close()
    assert not robot.context.ok()
