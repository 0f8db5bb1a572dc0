# SPDX-License-Identifier: Apache-2.0
"""Services of ``simulation_interfaces`` that add bodies to a running scene and remove them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import Future
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from gdfe_ros.constraints.rigid_body import RigidBody
from gdfe_ros.errors import GdfeError
from gdfe_ros.node.entity_request import EntityRequest, placement_of
from gdfe_ros.node.exchange import SceneExchange
from gdfe_ros.node.interface import services
from gdfe_ros.node.managed import ManagedNode
from gdfe_ros.node.orders import require_near
from gdfe_ros.node.placement import Placement
from gdfe_ros.node.refusals import Refusal
from gdfe_ros.node.session import SimulationSession
from gdfe_ros.node.standard_answers import Refused, ResultCode, done, failed, later
from gdfe_ros.node.standard_offer import offer
from gdfe_ros.node.things import Thing, things_of
from gdfe_ros.scene.entity import with_body, without_bodies
from gdfe_ros.scene.scene import Scene
from gdfe_ros.scene.soft_bodies import parts_of

MOST_SPAWNED = 100
"""Largest number of bodies in one request."""


class Spawned(NamedTuple):
    """A body that was added: its name in the scene, and a remark on it, which may be empty."""

    name: str
    remark: str


class Entities:
    """The free bodies of a node's scene as entities; only spawned ones can be deleted.

    Args:
        node: node that offers the services.
        session: function that returns the running session, or None.
        exchange: carries out the changes of the scene.
    """

    def __init__(
        self, node: ManagedNode, session: Callable[[], SimulationSession | None], exchange: SceneExchange
    ) -> None:
        self._find, self._exchange = session, exchange
        self._inner: dict[str, Placement] = {}
        self._adding = 0
        offered = {
            services.SPAWN_ENTITY: self._spawn,
            services.SPAWN_ENTITIES: self._spawn_all,
            services.DELETE_ENTITY: self._delete,
        }
        offer(node, offered)

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

    def session(self) -> SimulationSession:
        """Return the running session.

        Raises:
            Refused: the node is not configured.
        """
        session = self._find()
        if session is None:
            raise Refused(ResultCode.INCORRECT_STATE, "the node is unconfigured; call the transition `configure` first")
        return session

    def all(self) -> list[Thing]:
        """Return the entities of the present scene; raise `Refused` if there is none."""
        return things_of(self.session().scene, self._inner)

    def named(self, name: str) -> Thing:
        """Return the entity of a name.

        Raises:
            Refused: there is none.
        """
        known = {each.name: each for each in self.all()}
        if name not in known:
            raise Refused(
                ResultCode.NOT_FOUND, f"there is no body {name[:200]!r}; bodies: {', '.join(known) or 'none'}"
            )
        return known[name]

    def _spawn(self, request: Any, response: Any) -> Future[Any]:
        def fill(response: Any, found: Spawned) -> None:
            response.entity_name, response.result.error_message = found

        return later(self._added(request), response, fill)

    def _spawn_all(self, request: Any, response: Any) -> Any:
        """Add the bodies of a request in turn; each waits for the one before it, so that names can be made unique."""
        wanted = request.spawn_requests
        if len(wanted) > MOST_SPAWNED:
            text = f"spawn_requests has {len(wanted)} entries; allowed: up to {MOST_SPAWNED}"
            return failed(response, ResultCode.FAILED, text)
        kind, answer = type(response).get_fields_and_field_types()["results"], Future()
        results = [_message(kind) for _ in wanted]
        response.results = results

        def conclude() -> None:
            wrong = [i for i, each in enumerate(results) if each.result.result != ResultCode.OK]
            if wrong:
                text = f"{len(wanted) - len(wrong)} of {len(wanted)} joined; results[{wrong[0]}] has the first reason"
                failed(response, ResultCode.SPAWN_FAILED, text)
            answer.set_result(done(response) if not wrong else response)

        def go_on(number: int) -> None:
            if number == len(wanted):
                conclude()
                return
            try:
                work = self._added(wanted[number])
            except Refused as error:
                failed(results[number], error.code, str(error))
                go_on(number + 1)
                return

            def fill(result: Any, found: Spawned) -> None:
                result.entity_name, result.result.error_message = found

            later(work, results[number], fill).add_done_callback(lambda _: go_on(number + 1))

        go_on(0)
        return answer

    def _added(self, request: Any) -> Future[Spawned]:
        """Add the body of a request; return a ``Future`` of its name.

        Raises:
            Refused: the request has a defect that shows at once.
        """
        session, wanted = self.session(), EntityRequest.of(request)
        if session.scene.dynamics is None:
            raise Refused(ResultCode.FAILED, f"scene {session.scene.name!r} has no `dynamics`, which free bodies need")
        outer = placement_of(wanted.pose, session.run.frames)
        require_place_near(outer.origin, session)
        found: list[Spawned] = []

        def add(scene: Scene) -> Scene:
            """Read the resource; called in the thread of the exchange, because reading may take long."""
            entity = wanted.entity()
            found[:] = [Spawned(wanted.unique_name(entity, _names(scene)), entity.remark or _remark(scene, entity))]
            return with_body(scene, found[0].name, entity, origin=outer.origin, turn=outer.turn)

        answer: Future[Spawned] = Future()
        self._adding += 1

        def conclude(work: Future[Scene]) -> None:
            self._adding -= 1
            if (error := work.exception()) is not None:
                answer.set_exception(error)
                return
            self._inner[found[0].name] = _inner(work.result(), found[0].name, outer)
            answer.set_result(found[0])

        self._exchange.request(add).add_done_callback(conclude)
        return answer

    def _delete(self, request: Any, response: Any) -> Future[Any]:
        name = self.named(request.entity).name
        if name not in self._inner:
            remedy = f"spawned: {', '.join(self._inner) or 'none'}"
            raise Refused(
                ResultCode.FAILED, f"body {name!r} belongs to the scene file; only spawned ones can go; {remedy}"
            )
        return later(self._remove((name,), anew=False), response)

    def _remove(self, names: tuple[str, ...] | None, *, anew: bool) -> Future[Scene]:
        """Remove spawned bodies; None: all that are spawned when the change begins."""
        command_set = self.session().run.parameters.entries("command_set")
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


def require_place_near(place: Iterable[float], session: SimulationSession) -> None:
    """Check that a place [m] is near the body.

    Raises:
        Refused: it is too far.
    """
    try:
        require_near(tuple(place), session.scene.mesh.size)
    except Refusal as refusal:
        raise Refused(ResultCode.INVALID_POSE, str(refusal)) from refusal


def rest_place(body: RigidBody) -> Placement:
    """Return the initial placement of a rigid body's frame."""
    return Placement(np.array(body.origin), Rotation.from_rotvec(body.turn))


def _inner(scene: Scene, name: str, outer: Placement) -> Placement:
    """Return the placement of a new body's own frame in the frame ``outer`` in which it was spawned."""
    body = next((each for each in scene.rigid_bodies if each.name == name), None)
    return Placement() if body is None else outer.inverse() @ rest_place(body)


def _remark(scene: Scene, entity: Any) -> str:
    """Return a remark on a soft body that would pass through the others; else an empty text."""
    if entity.materials is None or scene.self_contact is not None:
        return ""
    return "soft bodies pass through each other, because the scene has no `self_contact`"


def _message(sequence: str) -> Any:
    """Return a new message of the type of a field like ``sequence<simulation_interfaces/SpawnResult>``."""
    import simulation_interfaces.msg

    return getattr(simulation_interfaces.msg, sequence.rpartition("/")[2].rstrip(">"))()


def _names(scene: Scene) -> set[str]:
    """Return the names of a scene that a body cannot have."""
    items = (*scene.handles, *scene.actuators, *scene.loads, *scene.fibres)
    return {item.name for item in items} | set(parts_of(scene.mesh))
