# SPDX-License-Identifier: Apache-2.0
"""The services of ``simulation_interfaces``, as in Gazebo and Isaac Sim, if that package is installed.

They have the same effects as the node's own services. They have the standard names, below the node's name.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future
from enum import IntEnum
from typing import Any

from gdfe_ros.errors import GdfeError
from gdfe_ros.node.interface import services
from gdfe_ros.node.managed import ManagedNode
from gdfe_ros.node.qos import installed, interface_class
from gdfe_ros.node.session import SimulationSession


class _Result(IntEnum):
    """Result codes of ``simulation_interfaces/msg/Result``, whose names differ between its versions.

    Codes above 100 belong to a single service.
    """

    UNSUPPORTED = 0
    OK = 1
    INCORRECT_STATE = 3
    FAILED = 4
    ALREADY = 101


class _State(IntEnum):
    """States of ``simulation_interfaces/msg/SimulationState``."""

    STOPPED = 0
    PLAYING = 1
    PAUSED = 2
    QUITTING = 3
    INITIALIZING = 4


_FEATURES = (20, 24, 25, 26, 31, 32, 33)
"""Codes of the supported features: reset; get state, set state, pause; one step, several steps, steps as an action."""
_TIME, _STATE = 1, 2
"""Bits of a reset's scope: time, state; a scope of 0 means all."""


class StandardServices:
    """Standard services of the node; none is offered if ``simulation_interfaces`` is not installed.

    Args:
        node: node that offers the services.
        session: function that returns the running session, or None.
        quit: event that ends the process; None: this node cannot end it.
    """

    def __init__(
        self, node: ManagedNode, session: Callable[[], SimulationSession | None], quit: threading.Event | None
    ) -> None:
        self._node, self._session, self._quit = node, session, quit
        self._at_start = False
        if not installed(services.STEP_SIMULATION.type):
            return
        offered = {
            services.GET_FEATURES: self._features,
            services.GET_STATE: self._get_state,
            services.SET_STATE: self._set_state,
            services.RESET_SIMULATION: self._reset,
            services.STEP_SIMULATION: self._step,
        }
        for spec, answer in offered.items():
            node.offer(interface_class(spec.type), spec.name, answer)
        self._offer_action()

    def _features(self, request: Any, response: Any) -> Any:
        # The message's only field, which versions of the package name differently.
        features = getattr(response, next(iter(response.get_fields_and_field_types())))
        features.features = list(_FEATURES)
        features.custom_info = (
            "soft bodies; one scene, loaded by the transition configure; see also ~/step, ~/save_state"
        )
        return response

    def _get_state(self, request: Any, response: Any) -> Any:
        response.state.state = int(self._state())
        response.result.result = int(_Result.OK)
        return response

    def _state(self) -> _State:
        """Return the simulation state; stopped means not active, or paused at time 0 by a request to stop."""
        session, label = self._session(), self._node.lifecycle_state
        if session is None:
            return _State.INITIALIZING if label == "configuring" else _State.STOPPED
        if not session.stepper.running:
            return _State.STOPPED
        if not session.stepper.paused:
            self._at_start = False
            return _State.PLAYING
        return _State.STOPPED if self._at_start and session.simulation.time == 0.0 else _State.PAUSED

    def _set_state(self, request: Any, response: Any) -> Any:
        wanted, session = request.state.state, self._session()
        if wanted == _State.QUITTING and self._quit is not None:
            self._quit.set()
            return _done(response)
        if wanted not in (_State.STOPPED, _State.PLAYING, _State.PAUSED):
            return _failed(response, _Result.UNSUPPORTED, f"state {wanted} cannot be set here")
        if session is None or not session.stepper.running:
            return _failed(response, _Result.INCORRECT_STATE, self._inactive())
        if wanted == self._state():
            return _failed(response, _Result.ALREADY, f"the simulation is {_State(wanted).name.lower()} already")
        if wanted == _State.PLAYING:
            return self._play(session, response)
        session.interrupt("set_simulation_state ended it")
        session.stepper.pause(True)
        self._at_start = wanted == _State.STOPPED
        return (
            self._later(session.stepper.post(session.reset, urgent=True), response)
            if self._at_start
            else _done(response)
        )

    def _play(self, session: SimulationSession, response: Any) -> Any:
        try:
            session.play()
        except GdfeError as error:
            return _failed(response, _Result.INCORRECT_STATE, str(error))
        return _done(response)

    def _reset(self, request: Any, response: Any) -> Any:
        session, scope = self._session(), request.scope or 255
        if session is None:
            return _failed(response, _Result.INCORRECT_STATE, self._inactive())
        whole = scope & (_TIME | _STATE)
        if whole not in (0, _TIME | _STATE):
            return _failed(response, _Result.UNSUPPORTED, f"scope {scope}: time and state are reset together only")
        if not whole:  # the scope is spawned entities only, of which there are none
            return _done(response)
        session.interrupt("reset_simulation ended it")
        return self._later(session.stepper.post(session.reset, urgent=True), response)

    def _step(self, request: Any, response: Any) -> Any:
        try:
            return self._later(self._walk(request.steps), response)
        except GdfeError as error:
            return _failed(response, _Result.FAILED, str(error))

    def _walk(self, steps: int, told: Callable[[int], None] | None = None) -> Future[str]:
        session = self._session()
        if session is None or not session.stepper.running:
            raise GdfeError(self._inactive())
        if steps < 1:
            raise GdfeError(f"steps is {steps}; allowed: 1 or more")
        return session.take_steps(steps, told)

    def _inactive(self) -> str:
        return f"the node is {self._node.lifecycle_state}; call the transitions `configure` and `activate` first"

    def _later(self, work: Future[Any], response: Any) -> Future[Any]:
        """Return a ``Future`` of the response, which is complete when ``work`` is done."""
        answer: Future = Future()

        def respond(done: Future[Any]) -> None:
            error = done.exception()
            answer.set_result(_done(response) if error is None else _failed(response, _Result.FAILED, str(error)))

        work.add_done_callback(respond)
        return answer

    def _offer_action(self) -> None:
        from rclpy.action import ActionServer, CancelResponse

        kind, name = interface_class(services.SIMULATE_STEPS.type), services.SIMULATE_STEPS.name
        self._action = ActionServer(
            self._node,
            kind,
            name,
            execute_callback=lambda goal: kind.Result(),
            handle_accepted_callback=self._accept,
            cancel_callback=lambda goal: self._cancel() or CancelResponse.ACCEPT,
        )

    def _cancel(self) -> None:
        session = self._session()
        if session is not None:
            session.interrupt("simulate_steps was cancelled")

    def _accept(self, goal: Any) -> None:
        """Make the steps of a goal, with feedback after each, and send its result at the end."""
        kind, steps = interface_class(services.SIMULATE_STEPS.type), goal.request.steps

        def tell(done: int) -> None:
            goal.publish_feedback(kind.Feedback(completed_steps=done, remaining_steps=steps - done))

        def finish(error: BaseException | None) -> None:
            def conclude(goal: Any) -> Any:
                result = kind.Result()
                if error is None:
                    goal.succeed()
                    return _done(result)
                (goal.canceled if goal.is_cancel_requested else goal.abort)()
                return _failed(result, _Result.FAILED, str(error))

            goal.execute(conclude)

        try:
            self._walk(steps, tell).add_done_callback(lambda done: finish(done.exception()))
        except GdfeError as error:
            finish(error)


def _done(response: Any) -> Any:
    response.result.result = int(_Result.OK)
    return response


def _failed(response: Any, result: _Result, text: str) -> Any:
    response.result.result, response.result.error_message = int(result), text
    return response
