# SPDX-License-Identifier: Apache-2.0
"""Services of ``simulation_interfaces`` that answer what there is: bodies, their states and bounds, and named poses."""

from __future__ import annotations

import re
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.constraints import Pose
from gdfe_ros.constraints.obstacle import Obstacle
from gdfe_ros.constraints.rigid_body import RigidBody
from gdfe_ros.node import messages
from gdfe_ros.node.entities import Entities, require_place_near, rest_place
from gdfe_ros.node.interface import services
from gdfe_ros.node.managed import ManagedNode
from gdfe_ros.node.session import SimulationSession
from gdfe_ros.node.standard_answers import Refused, ResultCode, done, later
from gdfe_ros.node.things import BOX, EMPTY, OBJECT, SPHERE, EntityMotion, Thing, placement_of, within
from gdfe_ros.node.transforms import Placement
from gdfe_ros.scene.scene import Scene
from gdfe_ros.simulation import Simulation

_REPEATED_GROUP = re.compile(r"(?<!\\)\)[*+{]")
_REPETITION = re.compile(r"[*+?{]")
_MOST_REPETITIONS, _LONGEST_FILTER = 3, 100
"""Largest number of repetitions in, and of characters of, an expression that filters names: more could take hours."""


_ALL = 1
"""Mode of a filter that needs all tags."""


class NamedPose(NamedTuple):
    """A pose of the scene: name, kind (``handle``, ``obstacle`` or ``probe``), and the initial placement."""

    name: str
    kind: str
    place: Placement


class EntityQueries:
    """Answers requests about the bodies of a node's scene, and puts them elsewhere.

    Args:
        node: node that offers the services.
        entities: the bodies.
    """

    def __init__(self, node: ManagedNode, entities: Entities) -> None:
        self._entities = entities
        offered = {
            services.GET_ENTITIES: self._list,
            services.GET_ENTITY_STATE: self._get_state,
            services.GET_ENTITIES_STATES: self._get_states,
            services.SET_ENTITY_STATE: self._set_state,
            services.GET_ENTITY_INFO: self._get_info,
            services.GET_ENTITY_BOUNDS: self._get_bounds,
            services.GET_NAMED_POSES: self._get_poses,
        }
        node.offer_standard(offered)

    def _list(self, request: Any, response: Any) -> Any:
        chosen = self._chosen(request.filters)

        def fill(response: Any, found: list[Thing]) -> None:
            response.entities = [each.name for each in found]

        if request.filters.bounds.type == EMPTY:  # no reason to wait for the step in progress
            fill(response, chosen)
            return done(response)
        return self._after_step(lambda near, _: near, chosen, request.filters, response, fill)

    def _get_states(self, request: Any, response: Any) -> Any:
        session, chosen = self._entities.session(), self._chosen(request.filters)

        def measure(near: list[Thing], simulation: Simulation) -> list[tuple[Thing, EntityMotion]]:
            return [(each, each.motion(simulation)) for each in near]

        def fill(response: Any, found: list[tuple[Thing, EntityMotion]]) -> None:
            kind, response.entities = _state_class(), [each.name for each, _ in found]
            response.states = [_written(kind(), session, motion) for _, motion in found]

        return self._after_step(measure, chosen, request.filters, response, fill)

    def _chosen(self, filters: Any) -> list[Thing]:
        """Return the bodies that pass the filters for names, categories and tags."""
        passes, wanted = _name_filter(filters.filter), {each.category for each in filters.categories}
        _require_bounds(filters.bounds)
        chosen = [each for each in self._entities.all() if passes(each.name) and (not wanted or OBJECT in wanted)]
        return [each for each in chosen if _has_tags(each.tags, filters.tags)]

    def _after_step(
        self,
        measure: Callable[[list[Thing], Simulation], Any],
        chosen: list[Thing],
        filters: Any,
        response: Any,
        fill: Callable[[Any, Any], None],
    ) -> Future[Any]:
        """Answer by what ``measure`` returns of the bodies of ``chosen`` within the bounds, after the present step."""
        session = self._entities.session()

        def look() -> Any:
            near = chosen
            if filters.bounds.type != EMPTY:
                world = Placement()
                near = [each for each in chosen if within(each.bounds(session.simulation, world), filters.bounds)]
            return measure(near, session.simulation)

        return later(session.stepper.post(look), response, fill)

    def _get_state(self, request: Any, response: Any) -> Future[Any]:
        session, thing = self._entities.session(), self._entities.named(request.entity)

        def fill(response: Any, found: EntityMotion) -> None:
            _written(response.state, session, found)

        return later(session.stepper.post(lambda: thing.motion(session.simulation)), response, fill)

    def _set_state(self, request: Any, response: Any) -> Future[Any]:
        session, thing = self._entities.session(), self._entities.named(request.entity)
        twist = request.state.twist
        values = [getattr(part, axis) for part in (twist.linear, twist.angular) for axis in "xyz"]
        if getattr(request, "set_twist", any(values)) and any(values):
            text = "a velocity cannot be set, because the record of a step has none, so that a replay would differ"
            raise Refused(ResultCode.UNSUPPORTED, f"{text}; remedy: a pose only, after which the body is not moving")
        if not getattr(request, "set_pose", True):
            return done(response)
        outer = placement_of(request.state, session.run.frames)
        pose = _from_rest(thing, outer @ thing.inner)
        require_place_near(pose.translation, session)

        def put() -> None:
            session.simulation.put({thing.name: pose})  # raises an error if the place is not free
            session.stepper.drive.place({thing.name: pose})

        return later(session.stepper.post(put), response)

    def _get_info(self, request: Any, response: Any) -> Any:
        thing = self._entities.named(request.entity)
        response.info.category.category = OBJECT
        response.info.description, response.info.tags = thing.description, list(thing.tags)
        return done(response)

    def _get_bounds(self, request: Any, response: Any) -> Future[Any]:
        session, thing = self._entities.session(), self._entities.named(request.entity)

        def fill(response: Any, found: NDArray[np.float64]) -> None:
            from geometry_msgs.msg import Vector3

            response.bounds.type = BOX
            response.bounds.points = [Vector3(x=x, y=y, z=z) for x, y, z in found[::-1].tolist()]

        def look() -> NDArray[np.float64]:
            return thing.bounds(session.simulation, thing.place(session.simulation))

        return later(session.stepper.post(look), response, fill)

    def _get_poses(self, request: Any, response: Any) -> Any:
        import simulation_interfaces.msg

        for each in named_poses(self._entities.session().scene):
            if not _has_tags((each.kind,), request.tags):
                continue
            message = simulation_interfaces.msg.NamedPose(name=each.name, tags=[each.kind])
            message.description = f"rest pose of the {each.kind}" if each.kind != "probe" else "undeformed place"
            _write(message.pose.position, each.place.origin)
            _write(message.pose.orientation, each.place.turn.as_quat())
            response.poses.append(message)
        return done(response)


def named_poses(scene: Scene) -> list[NamedPose]:
    """Return the initial poses of handles, obstacles and probes, in the node's frame."""
    found = []
    for each in scene.handles:
        if isinstance(each, RigidBody):
            continue
        if isinstance(each, Obstacle):
            found.append(NamedPose(each.name, "obstacle", rest_place(each)))
        else:
            found.append(NamedPose(each.name, "handle", Placement(each.centre(scene.mesh.vertices))))
    for name, point in scene.probes.items():
        found.append(NamedPose(name, "probe", Placement(point.at(scene.mesh.vertices)[0])))
    return found


def _has_tags(tags: tuple[str, ...], asked: Any) -> bool:
    """Return whether tags contain any tag of a ``TagsFilter``, or all of them; without tags, the filter passes all."""
    wanted = set(asked.tags)
    return not wanted or (wanted <= set(tags) if asked.filter_mode == _ALL else bool(wanted & set(tags)))


def _name_filter(pattern: str) -> Callable[[str], object]:
    """Return a function that tells whether a name matches an expression.

    Raises:
        Refused: it is no expression, or its search could take too long.
    """
    if why := _too_slow(pattern):
        raise Refused(ResultCode.UNSUPPORTED, f"filters.filter {pattern[:_LONGEST_FILTER]!r} {why}")
    try:
        return re.compile(pattern).search
    except re.error as error:
        raise Refused(ResultCode.FAILED, f"filters.filter {pattern!r} is no regular expression: {error}") from error


def _require_bounds(bounds: Any) -> None:
    """Raise `Refused` if the bounds of a filter are not two points of a box or a sphere, or none."""
    if bounds.type == EMPTY:
        return
    if bounds.type not in (BOX, SPHERE):
        text = f"filters.bounds.type is {bounds.type}; allowed: {EMPTY} (none), {BOX} (box), {SPHERE} (sphere)"
        raise Refused(ResultCode.UNSUPPORTED, text)
    numbers = [value for each in bounds.points for value in (each.x, each.y, each.z)]
    if len(bounds.points) != 2 or not np.isfinite(numbers).all():
        text = f"filters.bounds has {len(bounds.points)} points; allowed: two, of finite numbers"
        raise Refused(ResultCode.FAILED, text)


def _too_slow(pattern: str) -> str:
    """Return why the search for an expression could take too long; empty if it cannot."""
    if len(pattern) > _LONGEST_FILTER:
        return f"has {len(pattern)} characters; allowed: up to {_LONGEST_FILTER}"
    if _REPEATED_GROUP.search(pattern):
        return "repeats a group, which is not supported"
    if (count := len(_REPETITION.findall(pattern))) > _MOST_REPETITIONS:
        return f"has {count} repetitions; allowed: up to {_MOST_REPETITIONS}"
    return ""


def _from_rest(thing: Thing, place: Placement) -> Pose:
    """Return the pose relative to rest of a body whose own frame has the placement ``place``."""
    rest = thing.rest
    return Pose(tuple(place.origin - rest.origin), tuple((place.turn * rest.turn.inv()).as_rotvec()))


def _state_class() -> type:
    import simulation_interfaces.msg

    return simulation_interfaces.msg.EntityState


def _written(state: Any, session: SimulationSession, motion: EntityMotion) -> Any:
    """Write a motion into an ``EntityState``, and return the message."""
    state.header = messages.header(session.run.now(), session.run.frames.frame_id)
    _write(state.pose.position, motion.place.origin)
    _write(state.pose.orientation, motion.place.turn.as_quat())
    _write(state.twist.linear, motion.linear)
    _write(state.twist.angular, motion.angular)
    return state


def _write(message: Any, values: NDArray[np.float64]) -> None:
    for name, value in zip("xyzw", values, strict=False):
        setattr(message, name, float(value))
