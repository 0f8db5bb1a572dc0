# SPDX-License-Identifier: Apache-2.0
"""Large actuator commands are followed at a rate at which steps converge."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from sensor_msgs.msg import JointState

from gdfe_ros.actuators import Grip, Mode
from gdfe_ros.node.driving.drive import Slew
from gdfe_ros.scene import load_scene
from gdfe_ros.simulation import Command, Simulation


class _Finger:
    """The flexor's limited command over steps whose outcome is a function of the command."""

    def __init__(self, outcome: Callable[[float], tuple[bool, bool, int]] = lambda value: (True, False, 10)) -> None:
        self.slew, self._outcome = Slew(load_scene("tendon_finger").actuators), outcome
        self.present = {"flexor": 0.0, "extensor": 0.0}

    def step(self, goal: float | None = None, *, dt: float = 0.05, slew_time: float = 0.5) -> float:
        """Make a step, with a new goal or none; return the applied command."""
        command = Command() if goal is None else Command(actuators={"flexor": goal})
        self.present |= self.slew.limit(command, self.present, dt=dt, slew_time=slew_time).actuators
        converged, cut, iterations = self._outcome(self.present["flexor"])
        self.slew.note(converged=converged, cut=cut, iterations=iterations)
        return self.present["flexor"]

    def go(self, goal: float, steps: int) -> list[float]:
        """Make steps towards a goal; return their commands."""
        return [self.step(goal), *(self.step() for _ in range(steps - 1))]


def test_a_command_crosses_the_range_in_its_time() -> None:
    """A goal of 20 N, the whole range, is reached by 2 N per 0.05 s in 0.5 s, or at once with a slew time of zero."""
    finger = _Finger()
    np.testing.assert_allclose(finger.go(20.0, 11), [*np.arange(2.0, 21.0, 2.0), 20.0])
    assert not finger.slew.goals
    assert finger.step(0.0, slew_time=0.0) == 0.0
    assert not finger.slew.moving


def test_a_grip_takes_hold_at_once() -> None:
    """The command of a grip is 0 or 1: it is not limited, and values between them would never take hold."""
    slew = Slew([Grip(name="cup", mode=Mode.GRIP, holder="hand", vertices=np.zeros(1, np.int32), reach=0.01)])
    command = slew.limit(Command(actuators={"cup": 1.0}), {"cup": 0.0}, dt=0.01, slew_time=0.5)
    assert command.actuators == {"cup": 1.0}
    assert not slew.moving


def test_a_command_is_held_until_a_step_converges() -> None:
    """While steps are cut the command stays; after one converges the next change is half as large."""
    outcomes = iter([True, False, False, False, False, True, True, True])
    finger = _Finger(lambda value: ((good := next(outcomes)), not good, 10))
    np.testing.assert_allclose(finger.go(20.0, 8), [2.0, 4.0, 4.0, 4.0, 4.0, 4.0, 5.2, 6.64])
    finger.slew.clear()
    assert not finger.slew.moving


def test_a_goal_is_held_until_a_step_converges() -> None:
    """A command at its goal counts as moving until a step there converges."""
    outcomes = iter([False, False, True, True])
    finger = _Finger(lambda value: ((good := next(outcomes)), not good, 10))
    seen = [(finger.step(1.0 if step == 0 else None), finger.slew.moving) for step in range(4)]
    assert seen == [(1.0, True), (1.0, True), (1.0, False), (1.0, False)]


def test_a_change_that_does_not_converge_is_taken_back() -> None:
    """If no step beyond 5 N converges, the command goes back after 200 iterations, then rises by half the change."""
    finger = _Finger(lambda value: ((good := value <= 5.0), not good, 100))
    seen = finger.go(20.0, 8)
    np.testing.assert_allclose(seen, [2.0, 4.0, 6.0, 6.0, 4.0, 5.0, 6.2, 6.2])


def test_steps_without_iterations_count_too() -> None:
    """If steps beyond 5 N make no iteration, the command goes back after 50 of them."""
    finger = _Finger(lambda value: ((good := value <= 5.0), not good, 0))
    seen = finger.go(20.0, 53)
    assert seen[2:52] == pytest.approx([6.0] * 50)
    assert seen[52] == 4.0


def test_an_edge_of_stability_is_passed() -> None:
    """If every step from 6 to 8 N is cut, the command crosses that range with a change of at least 2 N."""
    finger = _Finger(lambda value: ((bad := 6.0 < value < 8.0) is False, bad, 200))
    seen = [finger.step(15.0, dt=0.02), *(finger.step(dt=0.02) for _ in range(299))]
    assert seen[-1] == 15.0
    assert not finger.slew.moving
    assert max(after - before for before, after in pairwise(seen)) >= 2.0


def test_a_goal_that_no_step_converges_at_is_left() -> None:
    """If no step beyond 6 N converges, the command stays at the last converged one, and follows another goal."""
    finger = _Finger(lambda value: ((good := value <= 6.0), not good, 200))
    seen = finger.go(20.0, 300)
    assert finger.slew.stopped
    assert 5.5 < seen[-1] == seen[-50] <= 6.0
    assert finger.step(20.0) == seen[-1]
    assert finger.slew.goals == {"flexor": 20.0}
    assert not finger.slew.moving
    assert finger.go(2.0, 30)[-1] == 2.0
    assert not finger.slew.stopped


def test_what_does_not_converge_at_rest_either_is_not_held_for_long() -> None:
    """If every step is cut, the command reaches its goal all the same."""
    finger = _Finger(lambda value: (False, True, 100))
    assert finger.go(15.0, 60)[-1] == 15.0


def test_a_failure_that_time_does_not_mend_slows_nothing() -> None:
    """If a step fails without a deadline's cut, the command continues at its full rate and stops at the goal."""
    finger = _Finger(lambda value: (False, False, 2000))
    np.testing.assert_allclose(finger.go(5.0, 3), [2.0, 4.0, 5.0])
    assert not finger.slew.moving


def test_the_slender_finger_converges_again_and_again_in_little_time() -> None:
    """With three iterations per step, changes are held, and at least one step of eight converges.

    No step moves the tip farther than steps of the same changes that converge. Iterations stand for a deadline of some
    milliseconds, so that the count is the same on every machine.
    """
    simulation, patient = (Simulation(load_scene("tendon_finger")) for _ in range(2))
    simulation.step()
    free, tips = 20.0 * 0.01 / 0.5, []
    for tension in np.arange(0.0, 20.0, free):
        assert patient.step(Command(actuators={"flexor": float(tension)})).converged
        tips.append(patient.probe_positions()["tip"])
    farthest = np.linalg.norm(np.diff(tips, axis=0), axis=1).max()
    slew, command = Slew(simulation.scene.actuators), Command(actuators={"flexor": 20.0})
    converged, moved, tip = 0, [], simulation.probe_positions()["tip"]
    for _ in range(200):
        given = slew.limit(command, simulation.commands, dt=0.01, slew_time=0.5)
        result = simulation.step(given, dt=0.01, cut_after=2)
        slew.note(converged=result.converged, cut=result.cut_after is not None, iterations=result.iterations)
        converged, command = converged + result.converged, Command()
        before, tip = tip, simulation.probe_positions()["tip"]
        moved.append(np.linalg.norm(tip - before))
    assert converged >= 25
    assert simulation.commands["flexor"] > 1.0
    assert max(moved) < 1.01 * farthest


@pytest.mark.parametrize("clock", ["wall", "lockstep"])
def test_a_hurried_node_steps_as_far_as_it_converges(client: Any, start: Callable, clock: str) -> None:
    """A tension of 5 N with a slow step is reached gradually with the wall clock, and at once in lockstep."""
    hurried = {"deadline": 0.5, "slew_time": 12.0} if clock == "wall" else {"deadline": 0.0}
    start(scene="tendon_finger", clock=clock, dt=0.02, rate=50.0, **hurried)
    client.publish("actuation", JointState(name=["flexor"], effort=[5.0]))
    records = lambda: [record for record in client.records() if record.actuators]  # noqa: E731
    if clock == "lockstep":
        client.wait(records)
        assert records()[0].actuators == {"flexor": 5.0}
        return
    client.wait(lambda: "flexor at" in client.diagnostics().get("on their way", ""))
    client.wait(lambda: records() and records()[-1].actuators["flexor"] == 5.0)
    client.wait(lambda: "on their way" not in client.diagnostics())
    pulled = np.array([record.actuators["flexor"] for record in records()])
    assert len(pulled[pulled < 5.0]) >= 5
    assert (np.diff(pulled) <= 0.8 + 1e-9).all()
    assert np.mean([record.converged for record in records()]) > 0.5
