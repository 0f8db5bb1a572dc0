# SPDX-License-Identifier: Apache-2.0
"""What happens when stepping itself fails: error processing, a whole bag, and a node that can be configured again."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rclpy
from rclpy.executors import MultiThreadedExecutor
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.parameter import Parameter

from gdfe_ros.errors import CommandError
from gdfe_ros.node.orders import PoseOrder
from gdfe_ros.node.process import make_executor
from gdfe_ros.node.sim_node import SimNode
from gdfe_ros.node.stepper import Stepper
from gdfe_ros.recording.reader import BagReader

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
        self.wait(lambda: self.node.lifecycle_state == "active" and self.node._session.stepper.count == 1)

    def command(self, z: float) -> None:
        inbox = self.node._session.inputs.inbox
        inbox.put("handles/tip/target", PoseOrder("tip", (0.0, 0.0, z), (0.0, 0.0, 0.0, 1.0)))

    def close(self) -> None:
        self.node.close()
        self.executor.remove_node(self.node)
        self.executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)


@pytest.mark.parametrize("make", [make_executor, MultiThreadedExecutor], ids=["events", "threads"])
def test_a_failure_while_the_node_becomes_active_is_not_forgotten(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, make: Callable[..., Any]
) -> None:
    """Let the very first step raise before the transition is over: the node is unconfigured and says why."""

    def broken(*_: Any, **__: Any) -> None:
        raise ZeroDivisionError("broken on purpose")

    start = Stepper.start

    def start_and_wait(stepper: Stepper, *given: Any) -> None:
        monkeypatch.setattr(stepper._simulation, "step", broken)
        start(stepper, *given)
        stepper._thread.join()

    monkeypatch.setattr(Stepper, "start", start_and_wait)
    robot = _Robot(make, bag_path=str(tmp_path / "bag"))
    robot.wait(lambda: robot.node._problem and robot.node.lifecycle_state == "unconfigured")
    assert "broken on purpose" in robot.node._problem
    robot.close()


def test_a_failing_solver_leads_to_error_processing(tmp_path: Path) -> None:
    """Let the solver raise: the node is unconfigured, the bag whole; configured anew, it works again."""
    robot = _Robot(bag_path=str(tmp_path / "bag"))
    robot.wait_for_the_first_step()

    def broken(*_: Any, **__: Any) -> None:
        raise ZeroDivisionError("broken on purpose")

    robot.node._session.simulation.step = broken
    robot.command(0.1)
    robot.wait(lambda: robot.node.lifecycle_state == "unconfigured")
    assert BagReader(tmp_path / "bag").counts["/gdfe_sim/mesh"] == 1
    robot.node.set_parameters([Parameter("bag_path", value=str(tmp_path / "second"))])
    assert robot.node.trigger_configure() is TransitionCallbackReturn.SUCCESS
    assert robot.node.trigger_activate() is TransitionCallbackReturn.SUCCESS
    robot.command(0.1)
    robot.wait(lambda: robot.node._session.stepper.count == 2)
    robot.close()
    assert BagReader(tmp_path / "second").counts["/gdfe_sim/mesh"] == 2


def test_positions_that_are_no_numbers_are_not_published(tmp_path: Path) -> None:
    """Let the solver return NaN: nothing of that step is published, the node goes through error processing."""
    robot = _Robot(bag_path=str(tmp_path / "bag"))
    robot.wait_for_the_first_step()
    simulation = robot.node._session.simulation
    step = simulation.step

    def poisoned(*given: Any, **named: Any) -> Any:
        result = step(*given, **named)
        result.positions[0] = np.nan
        return result

    simulation.step = poisoned
    robot.command(0.1)
    robot.wait(lambda: robot.node.lifecycle_state == "unconfigured")
    robot.close()
    assert BagReader(tmp_path / "bag").counts["/gdfe_sim/mesh"] == 1


def test_a_command_that_the_simulation_refuses_is_counted_and_passed_over(tmp_path: Path) -> None:
    """Let the simulation refuse one command: the step is made without it, the node goes on."""
    robot = _Robot(bag_path=str(tmp_path / "bag"))
    robot.wait_for_the_first_step()
    simulation = robot.node._session.simulation
    step = simulation.step

    def picky(command: Any, **named: Any) -> Any:
        if command.handles:
            raise CommandError("not today")
        return step(command, **named)

    simulation.step = picky
    robot.command(0.1)
    robot.wait(lambda: robot.node._session.stepper.count == 2)
    assert robot.node.lifecycle_state == "active"
    assert robot.node._refusals.counts()["refused: out of range"] == 1
    robot.close()


def test_close_is_harmless_at_any_time() -> None:
    """Close a node before it is configured, and twice."""
    robot = _Robot(autostart=False)
    robot.node.close()
    assert robot.node.lifecycle_state == "unconfigured"
    robot.close()
    assert not robot.context.ok()
