# SPDX-License-Identifier: Apache-2.0
"""Services that spawn, delete, list, query and teleport bodies while the node runs.

To spawn or delete a body, the simulation is replaced between two steps.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from geometry_msgs.msg import Vector3

from gdfe_ros.errors import GdfeError
from gdfe_ros.node import interface
from gdfe_ros.node.driving.orders import require_near
from gdfe_ros.node.driving.remodelling import build_simulation
from gdfe_ros.node.frames import Placement
from gdfe_ros.node.messages import by_axis, header, pose_message
from gdfe_ros.node.middleware.ros_types import interface_class
from gdfe_ros.node.refusals import Refused, ResultCode, answer
from gdfe_ros.node.requests.services import SessionNode
from gdfe_ros.node.requests.things import (
    BOX,
    EMPTY,
    OBJECT,
    EntityRequest,
    Thing,
    has_tags,
    inner_of,
    list_poses,
    name_filter,
    names_of,
    new_message,
    placement_of,
    pose_from_rest,
    remark_on,
    require_bounds,
    things_of,
    within,
)
from gdfe_ros.node.simulation_session import SimulationSession
from gdfe_ros.scene.entity import with_body, without_bodies
from gdfe_ros.scene.scene import Scene
from gdfe_ros.simulation import Simulation

MOST_SPAWNED = 100
"""Largest number of bodies in one request."""


class Entities:
    """The free bodies of a node's scene as entities; only spawned ones can be deleted.

    Args:
        node: node that offers the services.
        exchange: carries out the changes of the scene.
    """

    def __init__(self, node: SessionNode, exchange: SceneExchange) -> None:
        self._node, self._exchange = node, exchange
        self._inner: dict[str, Placement] = {}
        self._adding = 0
        offered = {interface.SPAWN_ENTITY: self._spawn, interface.SPAWN_ENTITIES: self._spawn_all}
        node.offer({**offered, interface.DELETE_ENTITY: self._delete})

    @property
    def any_spawned(self) -> bool:
        """Whether there are spawned bodies, including those that are still being added."""
        return bool(self._inner or self._adding)

    def forget(self) -> None:
        """Forget the spawned bodies, because their scene is gone."""
        self._inner.clear()

    def all(self) -> list[Thing]:
        """Return the entities of the present scene; raise `Refused` if the node has no scene."""
        return things_of(self._node.require_session().scene, self._inner)

    def find(self, name: str) -> Thing:
        """Return the entity with a name.

        Raises:
            Refused: there is none.
        """
        known = {each.name: each for each in self.all()}
        if name not in known:
            raise Refused(
                ResultCode.NOT_FOUND, f"there is no body {name[:200]!r}; bodies: {', '.join(known) or 'none'}"
            )
        return known[name]

    def _spawn_all(self, request: Any, response: Any) -> Future[None]:
        """Add the bodies of a request in turn; each waits for the one before it, so that names can be made unique."""
        wanted, work = request.spawn_requests, Future()
        if len(wanted) > MOST_SPAWNED:
            text = f"spawn_requests has {len(wanted)} entries; allowed: up to {MOST_SPAWNED}"
            raise Refused(ResultCode.FAILED, text)
        kind = type(response).get_fields_and_field_types()["results"]
        response.results = results = [new_message(kind) for _ in wanted]

        def conclude() -> None:
            wrong = [i for i, each in enumerate(results) if each.result.result != ResultCode.OK]
            if wrong:
                text = f"{len(wanted) - len(wrong)} of {len(wanted)} joined; results[{wrong[0]}] has the first reason"
                work.set_exception(Refused(ResultCode.SPAWN_FAILED, text))
            else:
                work.set_result(None)

        def go_on(number: int) -> None:
            if number == len(wanted):
                conclude()
                return
            note = partial(self._node.faults.note, "spawning a body")
            answered = answer(self._spawn, wanted[number], results[number], note)
            if isinstance(answered, Future):
                answered.add_done_callback(lambda _: go_on(number + 1))
            else:
                go_on(number + 1)

        go_on(0)
        return work

    def _spawn(self, request: Any, response: Any) -> Future[None]:
        """Add the body of a request.

        Raises:
            Refused, Refusal: the request has a defect that shows before its resource is read.
        """
        session, wanted = self._node.require_session(), EntityRequest(request)
        if session.scene.dynamics is None:
            raise Refused(ResultCode.FAILED, f"scene {session.scene.name!r} has no `dynamics`, which free bodies need")
        outer = placement_of(wanted.pose, session.run.frames)
        require_near(tuple(outer.origin), session.scene.mesh.size)
        name = remark = ""

        def add(scene: Scene) -> Scene:
            """Read the resource; called in the thread of the exchange, because reading may take long."""
            nonlocal name, remark
            entity = wanted.entity()
            name, remark = wanted.unique_name(entity, names_of(scene)), entity.remark or remark_on(scene, entity)
            return with_body(scene, name, entity, origin=outer.origin, turn=outer.turn)

        self._adding += 1

        def conclude(work: Future[Scene]) -> None:
            self._adding -= 1
            if work.exception() is None:
                self._inner[name] = inner_of(work.result(), name, outer)
                response.entity_name, response.result.error_message = name, remark

        work = self._exchange.request(add)
        work.add_done_callback(conclude)
        return work

    def _delete(self, request: Any, response: Any) -> Future[Scene]:
        name = self.find(request.entity).name
        if name not in self._inner:
            remedy = f"spawned: {', '.join(self._inner) or 'none'}"
            raise Refused(
                ResultCode.FAILED, f"body {name!r} belongs to the scene file; only spawned ones can go; {remedy}"
            )
        return self.remove((name,))

    def remove(self, names: tuple[str, ...] | None = None, *, anew: bool = False) -> Future[Scene]:
        """Remove the named spawned bodies; None: all bodies that are spawned when the change begins.

        ``anew``: restart the simulation at rest at time 0.
        """
        command_set = self._node.require_session().run.parameters.entries("command_set")
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


class EntityQueries:
    """Answers requests about the bodies of a node's scene, and teleports them.

    Args:
        node: node that offers the services.
        entities: the bodies.
    """

    def __init__(self, node: SessionNode, entities: Entities) -> None:
        self._node, self._entities = node, entities
        offered = {
            interface.GET_ENTITIES: self._list,
            interface.GET_ENTITY_STATE: self._get_state,
            interface.GET_ENTITIES_STATES: self._get_states,
            interface.SET_ENTITY_STATE: self._set_state,
            interface.GET_ENTITY_INFO: self._get_info,
            interface.GET_ENTITY_BOUNDS: self._get_bounds,
            interface.GET_NAMED_POSES: self._get_poses,
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
        session, kind = self._node.require_session(), interface_class("simulation_interfaces/msg/EntityState")

        def write(near: list[Thing]) -> None:
            response.entities, response.states = [each.name for each in near], [kind() for _ in near]
            for each, state in zip(near, response.states, strict=True):
                _write_state(state, session, each)

        return self._after_step(write, self._choose(request.filters), request.filters)

    def _choose(self, filters: Any) -> list[Thing]:
        """Return the bodies that pass the filters for names, categories and tags."""
        passes, wanted = name_filter(filters.filter), {each.category for each in filters.categories}
        require_bounds(filters.bounds)
        chosen = [each for each in self._entities.all() if passes(each.name) and (not wanted or OBJECT in wanted)]
        return [each for each in chosen if has_tags(each.tags, filters.tags)]

    def _after_step(self, write: Callable[[list[Thing]], None], chosen: list[Thing], filters: Any) -> Future[None]:
        """Call ``write`` after the present step, with the bodies of ``chosen`` that are within the filter's bounds."""
        session = self._node.require_session()

        def look() -> None:
            near = chosen
            if filters.bounds.type != EMPTY:
                world = Placement()
                near = [each for each in chosen if within(each.bounds(session.simulation, world), filters.bounds)]
            write(near)

        return session.stepper.post(look)

    def _get_state(self, request: Any, response: Any) -> Future[None]:
        session, thing = self._node.require_session(), self._entities.find(request.entity)
        return session.stepper.post(lambda: _write_state(response.state, session, thing))

    def _set_state(self, request: Any, response: Any) -> Future[None] | None:
        session, thing = self._node.require_session(), self._entities.find(request.entity)
        twist = request.state.twist
        values = [getattr(part, axis) for part in (twist.linear, twist.angular) for axis in "xyz"]
        if getattr(request, "set_twist", any(values)) and any(values):
            text = "a velocity cannot be set, because the record of a step has none, so that a replay would differ"
            raise Refused(ResultCode.UNSUPPORTED, f"{text}; remedy: a pose only, after which the body is not moving")
        if not getattr(request, "set_pose", True):
            return None
        outer = placement_of(request.state, session.run.frames)
        pose = pose_from_rest(thing, outer @ thing.inner)
        require_near(pose.translation, session.scene.mesh.size)

        def put() -> None:
            session.simulation.put({thing.name: pose})  # raises an error if the place is not free
            source = self._node.resolve_service_name(interface.SET_ENTITY_STATE.name)
            session.stepper.drive.place({thing.name: pose}, source)

        return session.stepper.post(put)

    def _get_info(self, request: Any, response: Any) -> None:
        thing = self._entities.find(request.entity)
        response.info.category.category = OBJECT
        response.info.description, response.info.tags = thing.description, list(thing.tags)

    def _get_bounds(self, request: Any, response: Any) -> Future[None]:
        session, thing = self._node.require_session(), self._entities.find(request.entity)
        response.bounds.type = BOX

        def look() -> None:
            corners = thing.bounds(session.simulation, thing.place(session.simulation))
            response.bounds.points = [Vector3(**by_axis(corner)) for corner in corners[::-1]]

        return session.stepper.post(look)

    def _get_poses(self, request: Any, response: Any) -> None:
        for name, kind, place in list_poses(self._node.require_session().scene):
            if not has_tags((kind,), request.tags):
                continue
            message = interface_class("simulation_interfaces/msg/NamedPose")(name=name, tags=[kind])
            message.description = f"rest pose of the {kind}" if kind != "probe" else "undeformed place"
            message.pose = pose_message(place.origin, place.turn.as_quat())
            response.poses.append(message)


def _write_state(state: Any, session: SimulationSession, thing: Thing) -> None:
    """Write the present motion of a body into an ``EntityState``; called between steps."""
    motion = thing.motion(session.simulation)
    state.header = header(session.run.now(), session.run.frames.frame_id)
    state.pose = pose_message(motion.place.origin, motion.place.turn.as_quat())
    state.twist.linear, state.twist.angular = (Vector3(**by_axis(each)) for each in (motion.linear, motion.angular))


MOST_WAITING = 20
"""Largest number of changes that wait for those before them; further ones are refused."""


@dataclass(eq=False)
class _Change:
    """A requested change of the scene.

    Attributes:
        make: function that returns the new scene from the present one.
        anew: whether the new simulation starts at rest at time 0; otherwise it continues the motion.
        outcome: ``Future`` of the new scene.
        before: scene from which the new one was built; None until it is built.
    """

    make: Callable[[Scene], Scene]
    anew: bool
    outcome: Future[Scene] = field(default_factory=Future)
    before: Scene | None = None


class SceneExchange:
    """Carries out changes of the scene one after another; the steps go on while a simulation is built.

    Args:
        node: node whose executor exchanges the simulations.
        replace: function that replaces the session's simulation. Its arguments are the new simulation, the scene
            before the change, and whether to start anew. It returns False, and replaces nothing, if the session no
            longer has the scene before the change.
    """

    def __init__(self, node: SessionNode, replace: Callable[[Simulation, Scene, bool], bool]) -> None:
        self._node, self._replace = node, replace
        self._waiting: deque[_Change] = deque()
        self._busy: _Change | None = None

    def request(self, make: Callable[[Scene], Scene], *, anew: bool = False) -> Future[Scene]:
        """Change the scene by ``make``, and return a ``Future`` of the new scene. Called in the executor's thread."""
        change = _Change(make, anew)
        if len(self._waiting) < MOST_WAITING:
            self._waiting.append(change)
            self._begin()
        else:
            change.outcome.set_exception(
                GdfeError(f"{MOST_WAITING} changes of the scene wait already; ask again later")
            )
        return change.outcome

    def _begin(self) -> None:
        if self._busy is not None or not self._waiting:
            return
        change, session = self._waiting.popleft(), self._node.session
        if session is None:
            change.outcome.set_exception(GdfeError("the node was cleaned up before the scene was changed"))
            self._begin()
            return
        self._busy, change.before = change, session.scene

        def build() -> Simulation:
            return build_simulation(change.make(change.before))

        self._node.in_background(build, partial(self._finish, change), name="exchange")

    def _finish(self, change: _Change, built: Simulation | Exception) -> None:
        self._busy = None
        try:
            found = self._exchange(change, built)
        except Exception as error:
            change.outcome.set_exception(error)
        else:
            if found is None:
                self._waiting.appendleft(change)  # moduli, or the whole scene, have changed: build it again
            else:
                change.outcome.set_result(found)
        self._begin()

    def _exchange(self, change: _Change, built: Simulation | Exception) -> Scene | None:
        """Carry out a change and return the new scene; None if the session has another scene meanwhile."""
        if isinstance(built, Exception):
            raise built
        session = self._node.session
        if session is None:
            raise GdfeError("the node was cleaned up before the scene was changed")
        session.bags.require_none()
        session.require_no_step_request("wait for its end, or end it with ~/pause true")
        return built.scene if self._replace(built, change.before, change.anew) else None
