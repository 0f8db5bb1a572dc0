# SPDX-License-Identifier: Apache-2.0
"""Services of ``simulation_interfaces`` for rigid bodies: spawn, delete, list, and get and set their state."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from concurrent.futures import Future
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gdfe_ros.constraints import Pose
from gdfe_ros.constraints.rigid_body import RigidBody
from gdfe_ros.errors import GdfeError
from gdfe_ros.node import messages
from gdfe_ros.node.entity_request import EntityRequest, placement_of
from gdfe_ros.node.exchange import SceneExchange
from gdfe_ros.node.interface import services
from gdfe_ros.node.managed import ManagedNode
from gdfe_ros.node.orders import require_near
from gdfe_ros.node.placement import Placement
from gdfe_ros.node.qos import installed, interface_class
from gdfe_ros.node.refusals import Refusal
from gdfe_ros.node.session import SimulationSession
from gdfe_ros.node.standard_answers import Refused, ResultCode, done, failed, later
from gdfe_ros.scene.entity import with_body, without_bodies
from gdfe_ros.scene.scene import Scene
from gdfe_ros.simulation import Simulation

_REPEATED_GROUP = re.compile(r"(?<!\\)\)[*+{]")
_REPETITION = re.compile(r"[*+?{]")
_MOST_REPETITIONS, _LONGEST_FILTER = 3, 100
"""Largest number of repetitions in, and of characters of, an expression that filters names: more could take hours."""


class Entities:
    """The rigid bodies of a node's scene as entities; only spawned ones can be deleted.

    Args:
        node: node that offers the services.
        session: function that returns the running session, or None.
        exchange: carries out the changes of the scene.
    """

    def __init__(
        self, node: ManagedNode, session: Callable[[], SimulationSession | None], exchange: SceneExchange
    ) -> None:
        self._node, self._find, self._exchange = node, session, exchange
        self._inner: dict[str, Placement] = {}
        self._adding = 0
        if not installed(services.SPAWN_ENTITY.type):
            return
        offered = {
            services.SPAWN_ENTITY: self._spawn,
            services.DELETE_ENTITY: self._delete,
            services.GET_ENTITIES: self._list,
            services.GET_ENTITY_STATE: self._get_state,
            services.SET_ENTITY_STATE: self._set_state,
        }
        for spec, answer in offered.items():
            node.offer(interface_class(spec.type), spec.name, partial(self._answer, answer))

    @property
    def any_spawned(self) -> bool:
        """Whether there are spawned bodies, including those that are still being added."""
        return bool(self._inner or self._adding)

    def forget(self) -> None:
        """Forget the spawned bodies, because their scene is gone."""
        self._inner.clear()

    def remove_all(self, *, anew: bool) -> Future[Scene]:
        """Remove all spawned bodies; ``anew``: start again at rest at time 0."""
        return self._remove(None, anew=anew)

    def _answer(self, action: Callable[[Any, Any], Any], request: Any, response: Any) -> Any:
        try:
            return action(request, response)
        except Refused as error:
            return failed(response, error.code, str(error))

    def _session(self) -> SimulationSession:
        session = self._find()
        if session is None:
            raise Refused(ResultCode.INCORRECT_STATE, "the node is unconfigured; call the transition `configure` first")
        return session

    def _spawn(self, request: Any, response: Any) -> Future[Any]:
        session, wanted = self._session(), EntityRequest.of(request)
        if session.scene.dynamics is None:
            raise Refused(ResultCode.FAILED, f"scene {session.scene.name!r} has no `dynamics`, which rigid bodies need")
        outer = placement_of(wanted.pose, session.run.frames)
        _require_near(outer.origin, session)
        found: dict[str, str] = {}

        def add(scene: Scene) -> Scene:
            """Read the resource; called in the thread of the exchange, because reading may take long."""
            entity = wanted.entity()
            found.update(name=wanted.unique_name(entity, _names(scene)), remark=entity.remark)
            return with_body(scene, found["name"], entity, origin=outer.origin, turn=outer.turn)

        work = self._exchange.request(add)
        self._adding += 1
        work.add_done_callback(lambda work: self._spawned(found, outer, work))

        def fill(response: Any, scene: Scene) -> None:
            response.entity_name, response.result.error_message = found["name"], found["remark"]

        return later(work, response, fill)

    def _spawned(self, found: dict[str, str], outer: Placement, work: Future[Scene]) -> None:
        """Note the frame of a body that was added."""
        self._adding -= 1
        if work.exception() is None:
            self._inner[found["name"]] = outer.inverse() @ _rest(self._body(found["name"]))

    def _delete(self, request: Any, response: Any) -> Future[Any]:
        name = request.entity
        self._body(name)
        if name not in self._inner:
            remedy = f"spawned: {', '.join(self._inner) or 'none'}"
            raise Refused(
                ResultCode.FAILED, f"body {name!r} belongs to the scene file; only spawned ones can go; {remedy}"
            )
        return later(self._remove((name,), anew=False), response)

    def _remove(self, names: tuple[str, ...] | None, *, anew: bool) -> Future[Scene]:
        """Remove spawned bodies; None: all that are spawned when the change begins."""
        command_set = self._session().run.parameters.entries("command_set")
        gone: list[str] = []

        def without(scene: Scene) -> Scene:
            gone[:] = self._inner if names is None else names
            if waited := [key for key in command_set if key in {f"bodies/{name}/set" for name in gone}]:
                raise GdfeError(f"command_set has {', '.join(waited)}; remedy: deactivate, and set it without them")
            return without_bodies(scene, gone)

        work = self._exchange.request(without, anew=anew)

        def conclude(work: Future[Scene]) -> None:
            if work.exception() is None:
                for name in gone:
                    self._inner.pop(name, None)

        work.add_done_callback(conclude)
        return work

    def _list(self, request: Any, response: Any) -> Any:
        filters = request.filters
        if filters.categories or filters.tags.tags or filters.bounds.type:
            raise Refused(ResultCode.UNSUPPORTED, "only filters.filter, an expression for names, is supported")
        if why := _too_slow(filters.filter):
            raise Refused(ResultCode.UNSUPPORTED, f"filters.filter {filters.filter[:_LONGEST_FILTER]!r} {why}")
        try:
            pattern = re.compile(filters.filter)
        except re.error as error:
            raise Refused(
                ResultCode.FAILED, f"filters.filter {filters.filter!r} is no regular expression: {error}"
            ) from error
        response.entities = [body.name for body in self._bodies() if pattern.search(body.name)]
        return done(response)

    def _get_state(self, request: Any, response: Any) -> Future[Any]:
        session, body = self._session(), self._body(request.entity)
        inner = self._inner.get(body.name, Placement()).inverse()

        def fill(response: Any, found: tuple[Placement, Any, Any]) -> None:
            place, linear, angular = found
            own = place @ inner
            arm = own.origin - place.origin
            state = response.state
            state.header = messages.header(session.run.now(), session.run.frames.frame_id)
            _write(state.pose.position, own.origin)
            _write(state.pose.orientation, own.turn.as_quat())
            _write(state.twist.linear, linear + np.cross(angular, arm))
            _write(state.twist.angular, angular)

        return later(session.stepper.post(lambda: _motion(session.simulation, body)), response, fill)

    def _set_state(self, request: Any, response: Any) -> Future[Any]:
        session, body = self._session(), self._body(request.entity)
        twist = request.state.twist
        values = [getattr(part, axis) for part in (twist.linear, twist.angular) for axis in "xyz"]
        if getattr(request, "set_twist", any(values)) and any(values):
            raise Refused(ResultCode.UNSUPPORTED, "a velocity cannot be set; a body that is put elsewhere has none")
        if not getattr(request, "set_pose", True):
            return done(response)
        outer = placement_of(request.state, session.run.frames)
        pose = _from_rest(body, outer @ self._inner.get(body.name, Placement()))
        _require_near(pose.translation, session)

        def put() -> None:
            simulation = session.simulation
            simulation.stepper.put(simulation.state, {body.name: pose})  # raises an error if the place is not free
            session.stepper.place({body.name: pose})

        return later(session.stepper.post(put), response)

    def _bodies(self) -> tuple[RigidBody, ...]:
        return self._session().scene.rigid_bodies

    def _body(self, name: str) -> RigidBody:
        for body in self._bodies():
            if body.name == name:
                return body
        names = ", ".join(body.name for body in self._bodies()) or "none"
        raise Refused(ResultCode.NOT_FOUND, f"there is no rigid body {name!r}; bodies: {names}")


def _require_near(place: Iterable[float], session: SimulationSession) -> None:
    """Check that a place [m] is near the body.

    Raises:
        Refused: it is too far.
    """
    try:
        require_near(tuple(place), session.scene.mesh.size)
    except Refusal as refusal:
        raise Refused(ResultCode.INVALID_POSE, str(refusal)) from refusal


def _too_slow(pattern: str) -> str:
    """Return why the search for an expression could take too long; empty if it cannot."""
    if len(pattern) > _LONGEST_FILTER:
        return f"has {len(pattern)} characters; allowed: up to {_LONGEST_FILTER}"
    if _REPEATED_GROUP.search(pattern):
        return "repeats a group, which is not supported"
    if (count := len(_REPETITION.findall(pattern))) > _MOST_REPETITIONS:
        return f"has {count} repetitions; allowed: up to {_MOST_REPETITIONS}"
    return ""


def _names(scene: Scene) -> set[str]:
    """Return the names of a scene that a body cannot have."""
    items = (*scene.handles, *scene.actuators, *scene.loads, *scene.fibres)
    return {item.name for item in items}


def _rest(body: RigidBody) -> Placement:
    """Return the initial placement of a body's frame."""
    return Placement(np.array(body.origin), Rotation.from_rotvec(body.turn))


def _from_rest(body: RigidBody, place: Placement) -> Pose:
    """Return the pose relative to rest of a body whose frame has the placement ``place``."""
    rest = _rest(body)
    return Pose(tuple(place.origin - rest.origin), tuple((place.turn * rest.turn.inv()).as_rotvec()))


def _motion(simulation: Simulation, body: RigidBody) -> tuple[Placement, NDArray[np.float64], NDArray[np.float64]]:
    """Return the placement of a body's frame, and its linear and angular velocity (3,) [m/s] and [rad/s]."""
    origin, axes = body.found(simulation.state.positions + simulation.origin)
    velocities = simulation.stepper.velocities(simulation.state)[body.vertices]
    arms = simulation.state.positions[body.vertices] + simulation.origin - origin
    spread = np.vdot(arms, arms) * np.eye(3) - arms.T @ arms
    angular = np.linalg.solve(spread, np.cross(arms, velocities).sum(axis=0))
    return Placement(origin, Rotation.from_matrix(axes)), velocities.mean(axis=0), angular


def _write(message: Any, values: NDArray[np.float64]) -> None:
    for name, value in zip("xyzw", values, strict=False):
        setattr(message, name, float(value))
