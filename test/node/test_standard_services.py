# SPDX-License-Identifier: Apache-2.0
"""The services of simulation_interfaces, answered as by Gazebo and Isaac Sim.

The package is not available as a wheel: where it is not installed, it is built from its definitions.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from action_msgs.msg import GoalStatus
from std_srvs.srv import SetBool

from test.node.standard import Standard

OK, INCORRECT_STATE, FAILED, ALREADY = 1, 3, 4, 101
STOPPED, PLAYING, PAUSED, QUITTING, NO_WORLD = range(5)


def _state(standard: Standard) -> int:
    return standard.ask("GetSimulationState").state.state


def _set(standard: Standard, state: int) -> tuple[int, str]:
    return standard.result("SetSimulationState", state__state=state)


def _step(standard: Standard, steps: int) -> tuple[int, str]:
    return standard.result("StepSimulation", steps=steps)


def test_a_node_is_played_paused_stepped_stopped_and_quit(
    client: Any, start: Callable, coarse: dict, standard: Standard
) -> None:
    """With the fast clock, the node plays, pauses, makes steps only when paused, stops with a reset, and quits."""
    process = start(**coarse, clock="fast", publish_clock=True, autostart=False)
    assert _state(standard) == NO_WORLD
    assert _set(standard, PLAYING)[0] == INCORRECT_STATE
    assert "configure" in _step(standard, 1)[1]
    assert client.transition("configure")
    assert client.transition("activate")
    assert _state(standard) == PLAYING
    client.wait(lambda: client.records() and client.records()[-1].time > 0.0)
    assert _step(standard, 2) == (FAILED, "clock fast is running; pause it with ~/pause, or use clock lockstep")
    assert _set(standard, PAUSED) == (OK, "")
    assert _set(standard, PAUSED) == (ALREADY, "the simulation is paused already")
    before = int(client.status()["steps"])
    assert _step(standard, 3) == (OK, "")
    assert int(client.status()["steps"]) == before + 3
    assert _step(standard, 0) == (FAILED, "steps is 0; allowed: 1 or more")
    assert standard.reset(1) == (0, "scope 1: time and state are reset together only")
    assert [standard.reset(scope) for scope in (4, 7, 255, 0)] == [(OK, "")] * 4  # there are no spawned bodies
    assert standard.reset(0) == (OK, "")
    assert _state(standard) == PAUSED
    assert client.status()["simulation time [s]"] == "0"
    assert _set(standard, STOPPED) == (OK, "")
    assert _state(standard) == STOPPED
    assert _set(standard, PLAYING) == (OK, "")
    assert _state(standard) == PLAYING
    assert {20, 24, 25, 26, 31, 32, 33} <= set(standard.ask("GetSimulatorFeatures").features.features)
    assert _set(standard, 9)[0] == 0
    assert _set(standard, QUITTING) == (OK, "")
    assert process.wait() == 0


def test_steps_are_an_action_with_feedback_that_can_be_cancelled(
    client: Any, launch: Callable, coarse: dict, standard: Standard
) -> None:
    """The action of five steps gives feedback for each and a result; a million steps are cancelled."""
    launch(**coarse, clock="lockstep")
    action = client.action(standard.action.SimulateSteps, "simulate_steps")
    told: list[int] = []
    goal = standard.action.SimulateSteps.Goal

    def send(steps: int) -> Any:
        told.clear()
        sent = action.send_goal_async(
            goal(steps=steps), feedback_callback=lambda message: told.append(message.feedback.completed_steps)
        )
        client.wait(sent.done)
        assert sent.result().accepted
        return sent.result()

    result = send(5).get_result_async()
    client.wait(result.done)
    assert (result.result().status, result.result().result.result.result) == (GoalStatus.STATUS_SUCCEEDED, OK)
    # rclpy drops feedback that is taken after the result, so a slow client may miss the last ones.
    assert told == sorted(set(told) & set(range(1, 6)))
    assert client.status()["steps"] == "6"
    long = send(1_000_000)
    client.wait(lambda: told and told[-1] > 3)
    client.wait(long.cancel_goal_async().done)
    result = long.get_result_async()
    client.wait(result.done)
    assert result.result().status == GoalStatus.STATUS_CANCELED
    assert "simulate_steps was cancelled" in result.result().result.result.error_message
    action.destroy()


def test_nothing_is_played_while_steps_are_made_on_demand(
    client: Any, launch: Callable, coarse: dict, standard: Standard
) -> None:
    """Requests to play by either service are refused while the action makes steps with the wall clock."""
    launch(**coarse, clock="wall")
    assert _set(standard, PAUSED) == (OK, "")
    action = client.action(standard.action.SimulateSteps, "simulate_steps")
    sent = action.send_goal_async(standard.action.SimulateSteps.Goal(steps=1_000_000))
    client.wait(sent.done)
    code, text = _set(standard, PLAYING)
    assert code == INCORRECT_STATE
    assert "of 1000000 steps; cancel it" in text
    refused = client.call(SetBool, "pause", SetBool.Request(data=False))
    assert not refused.success
    assert "of 1000000 steps; cancel it" in refused.message
    assert _state(standard) == PAUSED
    before = int(client.status()["steps"])
    client.wait(lambda: int(client.status()["steps"]) > before)
    client.wait(sent.result().cancel_goal_async().done)
    result = sent.result().get_result_async()
    client.wait(result.done)
    assert result.result().status == GoalStatus.STATUS_CANCELED
    assert _set(standard, PLAYING) == (OK, "")
    action.destroy()
