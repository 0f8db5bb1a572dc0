# SPDX-License-Identifier: Apache-2.0
"""Services of ``simulation_interfaces`` that answer what there is: bodies, their states and bounds, and named poses."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from typing import Any

import numpy as np
from geometry_msgs.msg import Vector3

from gdfe_ros.constraints import Pose
from gdfe_ros.constraints.obstacle import Obstacle
from gdfe_ros.constraints.rigid_body import RigidBody
from gdfe_ros.node.entities import Entities
from gdfe_ros.node.frames import Placement
from gdfe_ros.node.interface import services
from gdfe_ros.node.messages import by_axis, header, pose_message
from gdfe_ros.node.orders import require_near
from gdfe_ros.node.refusals import Refused, ResultCode
from gdfe_ros.node.ros_types import interface_class
from gdfe_ros.node.services import SessionNode
from gdfe_ros.node.session import SimulationSession
from gdfe_ros.node.things import BOX, EMPTY, OBJECT, SPHERE, Thing, placement_of, rest_place, within
from gdfe_ros.scene.scene import Scene

_REPEATED_GROUP = re.compile(r"(?<!\\)\)[*+{]")
_REPETITION = re.compile(r"[*+?{]")
_MOST_REPETITIONS, _LONGEST_FILTER = 3, 100
"""Largest number of repetitions in, and of characters of, an expression that filters names: more could take hours."""


_ALL = 1
"""Mode of a filter that needs all tags."""


class EntityQueries:
    """Answers requests about the bodies of a node's scene, and puts them elsewhere.

    Args:
        node: node that offers the services.
        entities: the bodies.
    """

    def __init__(self, node: SessionNode, entities: Entities) -> None:
        self._node, self._entities = node, entities
        offered = {
            services.GET_ENTITIES: self._list,
            services.GET_ENTITY_STATE: self._get_state,
            services.GET_ENTITIES_STATES: self._get_states,
            services.SET_ENTITY_STATE: self._set_state,
            services.GET_ENTITY_INFO: self._get_info,
            services.GET_ENTITY_BOUNDS: self._get_bounds,
            services.GET_NAMED_POSES: self._get_poses,
        }
        node.offer(offered)

    def _list(self, request: Any, response: Any) -> Future[None] | None:
        chosen = self._choose(request.filters)

        def write(near: list[Thing]) -> None:
            response.entities = [each.name for each in near]

        if request.filters.bounds.type == EMPTY:  # no reason to wait for the step in progress
            return write(chosen)
        return self._after_step(write, chosen, request.filters)

    def _get_states(self, request: Any, response: Any) -> Future[None]:
        session, kind = self._node.configured(), interface_class("simulation_interfaces/msg/EntityState")

        def write(near: list[Thing]) -> None:
            response.entities, response.states = [each.name for each in near], [kind() for _ in near]
            for each, state in zip(near, response.states, strict=True):
                _write_state(state, session, each)

        return self._after_step(write, self._choose(request.filters), request.filters)

    def _choose(self, filters: Any) -> list[Thing]:
        """Return the bodies that pass the filters for names, categories and tags."""
        passes, wanted = _name_filter(filters.filter), {each.category for each in filters.categories}
        _require_bounds(filters.bounds)
        chosen = [each for each in self._entities.all() if passes(each.name) and (not wanted or OBJECT in wanted)]
        return [each for each in chosen if _has_tags(each.tags, filters.tags)]

    def _after_step(self, write: Callable[[list[Thing]], None], chosen: list[Thing], filters: Any) -> Future[None]:
        """Let ``write`` answer after the present step, with those bodies of ``chosen`` that are within the bounds."""
        session = self._node.configured()

        def look() -> None:
            near = chosen
            if filters.bounds.type != EMPTY:
                world = Placement()
                near = [each for each in chosen if within(each.bounds(session.simulation, world), filters.bounds)]
            write(near)

        return session.stepper.post(look)

    def _get_state(self, request: Any, response: Any) -> Future[None]:
        session, thing = self._node.configured(), self._entities.find(request.entity)
        return session.stepper.post(lambda: _write_state(response.state, session, thing))

    def _set_state(self, request: Any, response: Any) -> Future[None] | None:
        session, thing = self._node.configured(), self._entities.find(request.entity)
        twist = request.state.twist
        values = [getattr(part, axis) for part in (twist.linear, twist.angular) for axis in "xyz"]
        if getattr(request, "set_twist", any(values)) and any(values):
            text = "a velocity cannot be set, because the record of a step has none, so that a replay would differ"
            raise Refused(ResultCode.UNSUPPORTED, f"{text}; remedy: a pose only, after which the body is not moving")
        if not getattr(request, "set_pose", True):
            return None
        outer = placement_of(request.state, session.run.frames)
        pose = _from_rest(thing, outer @ thing.inner)
        require_near(pose.translation, session.scene.mesh.size)

        def put() -> None:
            session.simulation.put({thing.name: pose})  # raises an error if the place is not free
            session.stepper.drive.place({thing.name: pose})

        return session.stepper.post(put)

    def _get_info(self, request: Any, response: Any) -> None:
        thing = self._entities.find(request.entity)
        response.info.category.category = OBJECT
        response.info.description, response.info.tags = thing.description, list(thing.tags)

    def _get_bounds(self, request: Any, response: Any) -> Future[None]:
        session, thing = self._node.configured(), self._entities.find(request.entity)
        response.bounds.type = BOX

        def look() -> None:
            corners = thing.bounds(session.simulation, thing.place(session.simulation))
            response.bounds.points = [Vector3(**by_axis(corner)) for corner in corners[::-1]]

        return session.stepper.post(look)

    def _get_poses(self, request: Any, response: Any) -> None:
        import simulation_interfaces.msg

        for name, kind, place in _named_poses(self._node.configured().scene):
            if not _has_tags((kind,), request.tags):
                continue
            message = simulation_interfaces.msg.NamedPose(name=name, tags=[kind])
            message.description = f"rest pose of the {kind}" if kind != "probe" else "undeformed place"
            message.pose = pose_message(place.origin, place.turn.as_quat())
            response.poses.append(message)


def _named_poses(scene: Scene) -> Iterator[tuple[str, str, Placement]]:
    """Yield name, kind (``handle``, ``obstacle`` or ``probe``) and initial placement in the node's frame."""
    for each in scene.handles:
        if isinstance(each, Obstacle) and not isinstance(each, RigidBody):
            yield each.name, "obstacle", rest_place(each)
        elif not isinstance(each, RigidBody):
            yield each.name, "handle", Placement(each.centre(scene.mesh.vertices))
    for name, point in scene.probes.items():
        yield name, "probe", Placement(point.at(scene.mesh.vertices)[0])


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


def _write_state(state: Any, session: SimulationSession, thing: Thing) -> None:
    """Write the present motion of a body into an ``EntityState``; called between steps."""
    motion = thing.motion(session.simulation)
    state.header = header(session.run.now(), session.run.frames.frame_id)
    state.pose = pose_message(motion.place.origin, motion.place.turn.as_quat())
    state.twist.linear, state.twist.angular = (Vector3(**by_axis(each)) for each in (motion.linear, motion.angular))
