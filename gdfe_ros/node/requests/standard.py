# SPDX-License-Identifier: Apache-2.0
"""The services and actions of ``simulation_interfaces``, and the action ``FollowJointTrajectory``, if installed.

They have the same effects as the node's own services and topics. They have the standard names, below the node's name.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import replace
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray
from trajectory_msgs.msg import JointTrajectoryPoint

from gdfe_ros.errors import GdfeError
from gdfe_ros.node import interface
from gdfe_ros.node.inputs import Code, Pursuit, Tolerances
from gdfe_ros.node.interface import FOLLOW_TRAJECTORY, ServiceSpec
from gdfe_ros.node.messages import header
from gdfe_ros.node.middleware.ros_types import (
    LARGEST,
    available,
    bound_action,
    interface_class,
    is_installed,
    unread_size,
)
from gdfe_ros.node.refusals import Reason, Refusal, Refused, ResultCode, fail, succeed
from gdfe_ros.node.requests.entities import Entities
from gdfe_ros.node.requests.services import SessionNode, Worlds
from gdfe_ros.node.simulation_session import SimulationSession


class _State(IntEnum):
    """States of ``simulation_interfaces/msg/SimulationState``."""

    STOPPED = 0
    PLAYING = 1
    PAUSED = 2
    QUITTING = 3
    NO_WORLD = 4
    LOADING = 5


_FEATURES = {
    interface.SPAWN_ENTITY: (0, 9),
    interface.DELETE_ENTITY: (1,),
    interface.GET_NAMED_POSES: (2,),
    interface.GET_ENTITIES: (4, 6, 8),
    interface.GET_ENTITY_BOUNDS: (5,),
    interface.GET_ENTITY_STATE: (10,),
    interface.SET_ENTITY_STATE: (11,),
    interface.GET_ENTITY_INFO: (12,),
    interface.GET_SPAWNABLES: (14,),
    interface.RESET_SIMULATION: (20, 23),
    interface.GET_STATE: (24,),
    interface.SET_STATE: (25, 26),
    interface.STEP_SIMULATION: (31, 32),
    interface.SIMULATE_STEPS: (33,),
    interface.LOAD_WORLD: (40, 41),
    interface.UNLOAD_WORLD: (43,),
    interface.GET_CURRENT_WORLD: (44,),
    interface.GET_AVAILABLE_WORLDS: (45,),
    interface.SPAWN_ENTITIES: (50,),
}
"""Codes of the features that each service supports, as `SimulatorFeatures` numbers them.

9: spawn from text. 4, 6, 8: filters by tags, boxes and categories. 23: reset of spawned bodies; 21 and 22 are missing
because time and state are reset together only. 26: pause. 32: several steps. 41: worlds from text; 42, tags of worlds,
is missing.
"""
_FORMATS = ("urdf", "gdfe_ros")
"""Formats of spawned bodies; the second one is YAML: an entry of a scene's `bodies`, or a mesh with a material."""
_TIME, _STATE, _SPAWNED, _ALL = 1, 2, 4, 255
"""Bits of a reset's scope: time, state, spawned bodies; a scope of 0 means all."""


class StandardServices:
    """Standard services of the node; none is offered if ``simulation_interfaces`` is not installed.

    Args:
        node: node that offers the services.
        entities: the spawned bodies; some requests remove them.
        worlds: loader of scenes.
        quit: event that ends the process; None: this node cannot end it.
    """

    def __init__(self, node: SessionNode, entities: Entities, worlds: Worlds, quit: threading.Event | None) -> None:
        self._node, self._entities, self._worlds, self._quit = node, entities, worlds, quit
        self._at_start = False
        if not is_installed(interface.STEP_SIMULATION.type):
            return
        offered = {
            interface.GET_FEATURES: self._features,
            interface.GET_STATE: self._get_state,
            interface.SET_STATE: self._set_state,
            interface.RESET_SIMULATION: self._reset,
            interface.STEP_SIMULATION: self._step,
        }
        node.offer(offered)
        self._action = _serve(node, interface.SIMULATE_STEPS, self._accept, self._cancel)

    def stop_at_start(self) -> None:
        """Report the state stopped, instead of paused, as long as the simulation stays at time 0."""
        self._at_start = True

    def _features(self, request: Any, response: Any) -> None:
        # The message's only field, which versions of the package name differently.
        features = getattr(response, next(iter(response.get_fields_and_field_types())))
        offered = [codes for spec, codes in _FEATURES.items() if available(spec.type)]
        features.features, features.spawn_formats = sorted(sum(offered, ())), list(_FORMATS)
        features.custom_info = (
            "soft bodies, which can be spawned, too; a world is a scene; see also ~/step, ~/save_state"
        )

    def _get_state(self, request: Any, response: Any) -> None:
        response.state.state = int(self._state())

    def _state(self) -> _State:
        """Return the state of the simulation.

        Stopped means not active, or paused at time 0 after a request to stop or to load a scene.
        """
        session, label = self._node.session, self._node.lifecycle_state
        if session is None:
            if label == "configuring" or self._worlds.loading:
                return _State.LOADING
            return _State.NO_WORLD if available(interface.LOAD_WORLD.type) else _State.STOPPED
        if not session.stepper.running:
            return _State.STOPPED
        if not session.stepper.paused:
            self._at_start = False
            return _State.PLAYING
        return _State.STOPPED if self._at_start and session.simulation.time == 0.0 else _State.PAUSED

    def _set_state(self, request: Any, response: Any) -> Future[Any] | None:
        wanted = request.state.state
        if wanted == _State.QUITTING and self._quit is not None:
            return self._quit.set()
        if wanted not in (_State.STOPPED, _State.PLAYING, _State.PAUSED):
            raise Refused(ResultCode.UNSUPPORTED, f"state {wanted} cannot be set here")
        session = self._node.active()
        if wanted == self._state():
            raise Refused(ResultCode.ALREADY, f"the simulation is {_State(wanted).name.lower()} already")
        if wanted == _State.PLAYING:
            return self._play(session)
        session.interrupt("set_simulation_state ended it")
        session.stepper.pause(True)
        self._at_start = wanted == _State.STOPPED
        return self._restart(session, spawned=True) if self._at_start else None

    def _play(self, session: SimulationSession) -> None:
        try:
            session.play()
        except GdfeError as error:
            raise Refused(ResultCode.INCORRECT_STATE, str(error)) from error

    def _reset(self, request: Any, response: Any) -> Future[Any] | None:
        session, scope = self._node.require_session(), request.scope or _ALL
        if scope != _ALL and scope & ~(_TIME | _STATE | _SPAWNED):
            raise Refused(ResultCode.UNSUPPORTED, f"scope {scope} has unknown bits; allowed: 1, 2, 4")
        whole = scope & (_TIME | _STATE)
        if whole not in (0, _TIME | _STATE):
            raise Refused(ResultCode.UNSUPPORTED, f"scope {scope}: time and state are reset together only")
        if not whole:
            removes = scope & _SPAWNED and self._entities.any_spawned
            return self._entities.remove() if removes else None
        session.interrupt("reset_simulation ended it")
        return self._restart(session, spawned=bool(scope & _SPAWNED))

    def _restart(self, session: SimulationSession, *, spawned: bool) -> Future[Any]:
        """Restart the simulation at rest at time 0; if ``spawned``, remove the spawned bodies."""
        if spawned and self._entities.any_spawned:
            return self._entities.remove(anew=True)
        return session.stepper.post(session.reset, urgent=True)

    def _step(self, request: Any, response: Any) -> Future[str]:
        return self._walk(request.steps)

    def _walk(self, steps: int, on_step: Callable[[int], None] | None = None) -> Future[str]:
        session = self._node.active()
        if steps < 1:
            raise GdfeError(f"steps is {steps}; allowed: 1 or more")
        return session.take_steps(steps, on_step)

    def _cancel(self, goal: Any) -> None:
        if self._node.session is not None:
            self._node.session.interrupt("simulate_steps was cancelled")

    def _accept(self, goal: Any) -> None:
        """Make the steps of a goal, with feedback after each, and send its result at the end."""
        kind, steps = interface_class(interface.SIMULATE_STEPS.type), goal.request.steps

        def tell(done: int) -> None:
            goal.publish_feedback(kind.Feedback(completed_steps=done, remaining_steps=steps - done))

        def finish(error: BaseException | None) -> None:
            def conclude(goal: Any) -> Any:
                _end(goal, succeeded=error is None)
                return succeed(kind.Result()) if error is None else fail(kind.Result(), GdfeError(str(error)))

            goal.execute(conclude)

        try:
            self._walk(steps, tell).add_done_callback(lambda done: finish(done.exception()))
        except GdfeError as error:
            finish(error)


def _serve(node: SessionNode, spec: ServiceSpec, accept: Callable[[Any], None], cancel: Callable[[Any], None]) -> Any:
    """Return the server of an action; goals that were too large to be read are rejected.

    Args:
        node: node of the action.
        spec: description of the action.
        accept: function that receives each accepted goal, and later ends it.
        cancel: function that receives a goal that its client cancels.
    """
    from rclpy.action import ActionServer, CancelResponse, GoalResponse

    class Server(ActionServer):
        """A server that knows whether the last goal was too large."""

        unread = 0

        async def execute(self, taken_data: Any) -> None:
            """Note whether a goal was too large, and respond to requests as rclpy does."""
            self.unread = unread_size(taken_data["goal"][1]) if "goal" in taken_data else 0
            await super().execute(taken_data)

    def judge(goal: Any) -> GoalResponse:
        if not server.unread:
            return GoalResponse.ACCEPT
        text = f"a goal of {spec.name} is refused: it has {server.unread} bytes; allowed: up to {LARGEST}"
        node.get_logger().warning(text)
        return GoalResponse.REJECT

    kind = interface_class(spec.type)
    server = Server(
        node,
        kind,
        spec.name,
        goal_callback=judge,
        execute_callback=lambda goal: kind.Result(),
        handle_accepted_callback=accept,
        cancel_callback=lambda goal: cancel(goal) or CancelResponse.ACCEPT,
    )
    server._action_type = bound_action(kind, node.get_logger().warning)
    return server


def _end(goal: Any, *, succeeded: bool) -> None:
    """Set the state of a goal at its end: succeeded, cancelled or aborted."""
    end = goal.succeed if succeeded else goal.canceled if goal.is_cancel_requested else goal.abort
    end()


_CODES = {Reason.UNKNOWN: Code.INVALID_JOINTS, Reason.STALE: Code.OLD_HEADER_TIMESTAMP}
"""Result code of a refused trajectory; for any other reason it is INVALID_GOAL."""


class TrajectoryAction:
    """Accepts trajectories as goals: each is an order as on ``~/trajectory``, with feedback and a result.

    Args:
        node: node of the action.
    """

    def __init__(self, node: SessionNode) -> None:
        self._node = node
        if not is_installed(FOLLOW_TRAJECTORY.type):
            return
        self._kind = interface_class(FOLLOW_TRAJECTORY.type)
        self._pursuits: dict[bytes, Pursuit] = {}
        self._action = _serve(node, FOLLOW_TRAJECTORY, self._accept, self._cancel)

    def _accept(self, goal: Any) -> None:
        """Queue the order of a goal, or end the goal at once with the reason of the refusal."""
        key, name = bytes(goal.goal_id.uuid), self._node.resolve_topic_name(FOLLOW_TRAJECTORY.name)

        def finish(code: Code, reason: str) -> None:
            self._pursuits.pop(key, None)
            goal.execute(lambda goal: self._conclude(goal, code, reason))

        try:
            session = self._node.session
            if session is None or not session.stepper.running:
                raise Refusal(Reason.INACTIVE, f"the node is {self._node.lifecycle_state}; `activate` it first")
            tolerances = _tolerances(goal.request)
            order = replace(session.inputs.trajectory(goal.request.trajectory), source=name)
            tell = _feedback(goal, self._kind, order.names, session)
            self._pursuits[key] = pursuit = Pursuit(order, tolerances, tell=tell, finish=finish)
            session.inputs.pursue(pursuit)
        except GdfeError as error:
            refusal = error if isinstance(error, Refusal) else Refusal(Reason.MALFORMED, str(error))
            if session is not None:
                session.run.refusals.refuse(name, refusal)
            finish(_CODES.get(refusal.reason, Code.INVALID_GOAL), str(refusal))

    def _cancel(self, goal: Any) -> None:
        """End a goal: keep its actuators, loads and joints at their present commands."""
        session, pursuit = self._node.session, self._pursuits.get(bytes(goal.goal_id.uuid))
        if pursuit is not None and session is not None:
            session.inputs.hold(pursuit)
        if pursuit is not None:
            pursuit.end(Code.INVALID_GOAL, "it was cancelled")

    def _conclude(self, goal: Any, code: Code, reason: str) -> Any:
        _end(goal, succeeded=code is Code.SUCCESSFUL)
        return self._kind.Result(error_code=int(code), error_string=reason)


def _tolerances(request: Any) -> Tolerances:
    """Return the position tolerances of a goal, as tolerances of commands; a value of 0 or -1 sets no limit.

    Tolerances of velocities and accelerations are ignored.

    Raises:
        Refusal: the goal has a multi-DOF trajectory, or a trajectory without points; or a tolerance is not finite, or
            is for a name that the trajectory does not command.
    """
    if request.multi_dof_trajectory.joint_names or request.multi_dof_trajectory.points:
        raise Refusal(
            Reason.MALFORMED,
            "multi_dof_trajectory is not empty; remedy: put commands of actuators and loads into trajectory",
        )
    if not request.trajectory.points:
        raise Refusal(Reason.WRONG_SIZE, "the trajectory has no points; cancel a goal to end it")
    for each in (*request.path_tolerance, *request.goal_tolerance):
        if each.name not in request.trajectory.joint_names:
            raise Refusal(Reason.UNKNOWN, f"a tolerance is for {each.name!r}, which the trajectory does not command")
        if not np.isfinite(each.position):
            raise Refusal(Reason.NOT_FINITE, f"the tolerance of {each.name} is {each.position!r}; allowed: numbers")
    path, goal = (
        {each.name: each.position for each in given if each.position > 0.0}
        for given in (request.path_tolerance, request.goal_tolerance)
    )
    leeway = request.goal_time_tolerance
    return Tolerances(path, goal, leeway.sec + 1e-9 * leeway.nanosec)


def _feedback(
    goal: Any, kind: Any, names: tuple[str, ...], session: SimulationSession
) -> Callable[[float, NDArray[np.float64], NDArray[np.float64]], None]:
    """Return a function that sends feedback about each step to a goal's client."""

    def tell(elapsed: float, desired: NDArray[np.float64], actual: NDArray[np.float64]) -> None:
        points = [JointTrajectoryPoint(positions=values.tolist()) for values in (desired, actual, desired - actual)]
        for point in points:
            point.time_from_start.sec, point.time_from_start.nanosec = divmod(round(1e9 * elapsed), 10**9)
        head = header(session.run.last.record.stamp, session.run.frames.frame_id)
        values = dict(zip(("desired", "actual", "error"), points, strict=True))
        goal.publish_feedback(kind.Feedback(header=head, joint_names=list(names), **values))

    return tell
