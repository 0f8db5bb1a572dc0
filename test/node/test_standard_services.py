# SPDX-License-Identifier: Apache-2.0
"""The services of simulation_interfaces, answered as by Gazebo and Isaac Sim.

The package is not available as a wheel: where it is not installed, it is built from its definitions.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from std_srvs.srv import SetBool

OK, INCORRECT_STATE, FAILED, ALREADY = 1, 3, 4, 101
STOPPED, PLAYING, PAUSED, QUITTING, NO_WORLD = range(5)


class _Standard:
    """A client of a node's standard services."""

    def __init__(self, client: Any) -> None:
        from simulation_interfaces import action, srv

        self._client, self.srv, self.action = client, srv, action

    def state(self) -> int:
        kind = self.srv.GetSimulationState
        response = self._client.call(kind, "get_simulation_state", kind.Request())
        assert response.result.result == OK
        return response.state.state

    def set(self, state: int) -> tuple[int, str]:
        kind = self.srv.SetSimulationState
        request = kind.Request()
        request.state.state = state
        return self._read(self._client.call(kind, "set_simulation_state", request))

    def step(self, steps: int) -> tuple[int, str]:
        kind = self.srv.StepSimulation
        return self._read(self._client.call(kind, "step_simulation", kind.Request(steps=steps)))

    def reset(self, scope: int) -> tuple[int, str]:
        kind = self.srv.ResetSimulation
        return self._read(self._client.call(kind, "reset_simulation", kind.Request(scope=scope)))

    def _read(self, response: Any) -> tuple[int, str]:
        return response.result.result, response.result.error_message


def test_a_node_is_played_paused_stepped_stopped_and_quit(
    client: Any, start: Callable, coarse: dict, interfaces: Callable
) -> None:
    """With the fast clock, the node plays, pauses, makes steps only when paused, stops with a reset, and quits."""
    interfaces("simulation_interfaces")
    standard = _Standard(client)
    process = start(**coarse, clock="fast", publish_clock=True, autostart=False)
    assert standard.state() == NO_WORLD
    assert standard.set(PLAYING)[0] == INCORRECT_STATE
    assert "configure" in standard.step(1)[1]
    assert client.transition("configure")
    assert client.transition("activate")
    assert standard.state() == PLAYING
    client.wait(lambda: client.records() and client.records()[-1].time > 0.0)
    assert standard.step(2) == (FAILED, "clock fast is running; pause it with ~/pause, or use clock lockstep")
    assert standard.set(PAUSED) == (OK, "")
    assert standard.set(PAUSED) == (ALREADY, "the simulation is paused already")
    before = int(client.status()["steps"])
    assert standard.step(3) == (OK, "")
    assert int(client.status()["steps"]) == before + 3
    assert standard.step(0) == (FAILED, "steps is 0; allowed: 1 or more")
    assert standard.reset(1) == (0, "scope 1: time and state are reset together only")
    assert [standard.reset(scope) for scope in (4, 7, 255, 0)] == [(OK, "")] * 4  # there are no spawned bodies
    assert standard.reset(0) == (OK, "")
    assert standard.state() == PAUSED
    assert client.status()["simulation time [s]"] == "0"
    assert standard.set(STOPPED) == (OK, "")
    assert standard.state() == STOPPED
    assert standard.set(PLAYING) == (OK, "")
    assert standard.state() == PLAYING
    kind = standard.srv.GetSimulatorFeatures
    assert {20, 24, 25, 26, 31, 32, 33} <= set(
        client.call(kind, "get_simulator_features", kind.Request()).features.features
    )
    assert standard.set(9)[0] == 0
    assert standard.set(QUITTING) == (OK, "")
    assert process.wait() == 0


def test_steps_are_an_action_with_feedback_that_can_be_cancelled(
    client: Any, start: Callable, coarse: dict, interfaces: Callable
) -> None:
    """The action of five steps gives feedback for each and a result; a million steps are cancelled."""
    from action_msgs.msg import GoalStatus

    interfaces("simulation_interfaces")
    standard = _Standard(client)
    start(**coarse, clock="lockstep")
    client.wait(client.records)
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
    client: Any, start: Callable, coarse: dict, interfaces: Callable
) -> None:
    """Requests to play by either service are refused while the action makes steps with the wall clock."""
    from action_msgs.msg import GoalStatus

    interfaces("simulation_interfaces")
    standard = _Standard(client)
    start(**coarse, clock="wall")
    client.wait(client.records)
    assert standard.set(PAUSED) == (OK, "")
    action = client.action(standard.action.SimulateSteps, "simulate_steps")
    sent = action.send_goal_async(standard.action.SimulateSteps.Goal(steps=1_000_000))
    client.wait(sent.done)
    code, text = standard.set(PLAYING)
    assert code == INCORRECT_STATE
    assert "of 1000000 steps; cancel it" in text
    refused = client.call(SetBool, "pause", SetBool.Request(data=False))
    assert not refused.success
    assert "of 1000000 steps; cancel it" in refused.message
    assert standard.state() == PAUSED
    before = int(client.status()["steps"])
    client.wait(lambda: int(client.status()["steps"]) > before)
    client.wait(sent.result().cancel_goal_async().done)
    result = sent.result().get_result_async()
    client.wait(result.done)
    assert result.result().status == GoalStatus.STATUS_CANCELED
    assert standard.set(PLAYING) == (OK, "")
    action.destroy()
