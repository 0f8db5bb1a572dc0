# SPDX-License-Identifier: Apache-2.0
"""A node with a session, and its services: each service is executed between two steps and answers with the outcome.

No service blocks the node's other callbacks. If the answer depends on a later step, it is sent after that step. Worlds
of ``simulation_interfaces`` are scenes: they are loaded, unloaded and listed here.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from concurrent.futures import Future
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlparse

from std_srvs.srv import SetBool, Trigger

from gdfe_ros.checkpoint import load_state, save_state, write_state
from gdfe_ros.errors import GdfeError, SceneError
from gdfe_ros.installation import share_dir
from gdfe_ros.node import interface
from gdfe_ros.node.driving.remodelling import build_simulation
from gdfe_ros.node.interface import ServiceSpec
from gdfe_ros.node.middleware.managed import ManagedNode
from gdfe_ros.node.middleware.ros_types import interface_class
from gdfe_ros.node.parameters import NodeParameters
from gdfe_ros.node.refusals import Refused, ResultCode
from gdfe_ros.node.simulation_session import SimulationSession
from gdfe_ros.recording.step import Begin
from gdfe_ros.scene.entity import LARGEST
from gdfe_ros.scene.loader import load_scene, scene_from_text, scene_names
from gdfe_ros.scene.scene import Scene
from gdfe_ros.simulation import Simulation
from gdfe_ros.untrusted.regular_file import read_bytes, read_text


class SessionNode(ManagedNode):
    """A node with the session of a simulation.

    Attributes:
        session: the parts of the configured node; None before it is configured.
    """

    session: SimulationSession | None = None

    def require_session(self) -> SimulationSession:
        """Return the session.

        Raises:
            Refused: the node is not configured.
        """
        if self.session is None:
            text = "the node is unconfigured; call the transition `configure` first"
            raise Refused(ResultCode.INCORRECT_STATE, text)
        return self.session

    def active(self) -> SimulationSession:
        """Return the session, after a check that its stepping runs.

        Raises:
            Refused: the node is not active.
        """
        session = self.require_session()
        if not session.stepper.running:
            raise Refused(ResultCode.INCORRECT_STATE, "the node is not active; call the transition `activate` first")
        return session


class Services:
    """Offers the node's services; after a failure they answer ``success: false`` and the reason.

    Args:
        node: node of the services.
        parameters: parameters of the node.
    """

    def __init__(self, node: SessionNode, parameters: NodeParameters) -> None:
        self._node, self._parameters = node, parameters
        actions: dict[ServiceSpec, Callable[[Any], str | Future[str]]] = {
            interface.RESET: self._reset,
            interface.RESET_COMMANDS: lambda _: self._post(SimulationSession.reset_commands),
            interface.RESET_BODIES: lambda _: self._post(SimulationSession.reset_bodies),
            interface.RESET_SHAPE: lambda _: self._reset_part(
                interface.RESET_SHAPE, Simulation.reset_shape, "the shape was reset", "at the rest shape"
            ),
            interface.RESET_ARMS: lambda _: self._reset_part(
                interface.RESET_ARMS,
                Simulation.reset_arms,
                "the arms were reset",
                "the arms are at their initial positions",
            ),
            interface.PAUSE: self._pause,
            interface.STEP: self._step,
            interface.RECORD: self._record,
            interface.SAVE_STATE: self._save_state,
            interface.LOAD_STATE: self._load_state,
            interface.COMPUTE_JACOBIAN: self._compute_jacobian,
        }
        node.offer({spec: lambda request, _, action=action: action(request) for spec, action in actions.items()})

    def _reset(self, request: Trigger.Request) -> Future[str]:
        session = self._node.require_session()
        session.interrupt("~/reset ended it")
        return session.stepper.post(session.reset, urgent=True)

    def _post(self, reset: Callable[[SimulationSession], str]) -> Future[str]:
        session = self._node.require_session()
        return session.stepper.post(partial(reset, session))

    def _reset_part(self, spec: ServiceSpec, reset: Callable[[Simulation], None], why: str, done: str) -> Future[str]:
        """Reset a part between two steps, as soon as possible; the answer is the text ``done`` and the time."""
        session = self._node.require_session()
        session.interrupt(f"{spec.name} ended it")

        def reset_now() -> str:
            session.continue_from(lambda: reset(session.simulation), why)
            return f"{done}, time {session.simulation.time:.9g} s"

        return session.stepper.post(reset_now, urgent=True)

    def _pause(self, request: SetBool.Request) -> str:
        session = self._node.active()
        if not request.data:
            session.play()
            return "running"
        session.interrupt("~/pause ended it")
        session.stepper.pause(True)
        return "paused"

    def _step(self, request: Trigger.Request) -> Future[str]:
        session = self._node.active()
        return session.take_steps(self._parameters["step_count"])

    def _record(self, request: SetBool.Request) -> Future[str]:
        session = self._node.active()
        return session.stepper.post(lambda: session.record(request.data), "beginning or finishing a bag")

    def _save_state(self, request: Trigger.Request) -> Future[str]:
        session, path = self._node.require_session(), self._state_path()

        def save() -> str:
            data = save_state(session.simulation)
            try:
                write_state(path, data)
            except (OSError, ValueError) as error:
                raise GdfeError(f"state_path {path} cannot be written: {error}") from error
            return f"state at time {session.simulation.time:.9g} s in {path}"

        return session.stepper.post(save, "saving the state")

    def _load_state(self, request: Trigger.Request) -> Future[str]:
        session, path = self._node.require_session(), self._state_path()
        session.interrupt("~/load_state ended it")

        def load() -> str:
            session.bags.require_none()
            try:
                data = read_bytes(path)
            except (OSError, ValueError) as error:
                text = f"state_path {path} cannot be read: {error}; remedy: the file that ~/save_state wrote"
                raise GdfeError(text) from error
            load_state(session.simulation, data)
            session.stepper.restart(Begin.LOADED)
            session.inputs.give_up("another state was loaded")
            session.flush()
            return f"state of {path}, time {session.simulation.time:.9g} s"

        return session.stepper.post(load, "loading a state", urgent=True)

    def _state_path(self) -> Path:
        if not self._parameters["state_path"]:
            raise GdfeError("parameter state_path is empty; set it to the file of the state")
        return Path(self._parameters["state_path"])

    def _compute_jacobian(self, request: Trigger.Request) -> Future[str]:
        session = self._node.active()
        scene = session.scene
        if not scene.actuators or not scene.probes:
            missing = "actuators" if not scene.actuators else "probes"
            raise GdfeError(f"scene {scene.name!r} has no {missing}; ~/jacobian is d probe / d actuator")

        def compute() -> str:
            found = session.simulation.jacobian(interrupted=session.stepper.must_end)
            session.outputs.publish_jacobian(found, session.run.log_time)
            return f"{len(scene.probes)} probes, {len(scene.actuators)} actuators"

        return session.stepper.post(compute, "computing the Jacobian")


SPAWNED = (".urdf", ".yaml", ".yml")
"""Suffixes of files that describe a body."""
WORLDS = (".yaml", ".yml")
"""Suffixes of files that describe a scene."""
_MOST_FILES, _MOST_SOURCES = 1000, 20
"""Largest number of files that are listed of one folder, and of folders in a request."""


def path_of(uri: str, suffixes: Collection[str], *, code: int) -> Path:
    """Return the path of a URI ``file:///path``, or of a path.

    Raises:
        Refused: the text is neither, or the suffix is not among ``suffixes``; the refusal has the result code ``code``.
    """
    scheme, path = _parts(uri)
    if scheme not in ("", "file") or path.suffix.lower() not in suffixes:
        raise Refused(code, f"uri is {uri[:200]!r}; allowed: file:///path or a path, to a file {', '.join(suffixes)}")
    return path


def files_in(sources: Sequence[str], suffixes: Collection[str]) -> tuple[list[Path], str]:
    """Return the files in folders, without subfolders, and a text about sources that cannot be listed."""
    found: list[Path] = []
    wrong = [f"{len(sources) - _MOST_SOURCES} more than {_MOST_SOURCES}"] if len(sources) > _MOST_SOURCES else []
    for source in sources[:_MOST_SOURCES]:
        folder = _parts(source)[1]
        try:
            each = (path for path in folder.iterdir() if path.suffix.lower() in suffixes and path.is_file())
            found += sorted(islice(each, _MOST_FILES))
        except (OSError, ValueError) as error:  # no folder, not readable, or no path
            wrong.append(f"{source[:200]!r} ({getattr(error, 'strerror', None) or error})")
    return found, f"sources that cannot be listed: {', '.join(wrong)}" if wrong else ""


def _parts(uri: str) -> tuple[str, Path]:
    """Return scheme and path of a URI; the scheme is not "file" if the text is no URI."""
    try:
        parts = urlparse(uri)
    except ValueError:  # e.g. a bracket that is not closed
        return "no URI", Path(uri)
    return parts.scheme, Path(unquote(parts.path))


def _list_spawnables(request: Any, response: Any) -> None:
    """List the bodies that can be spawned by URI."""
    own = sorted((share_dir() / "config" / "bodies").glob("*.yaml"))
    others, wrong = files_in(request.sources, SPAWNED)
    for path in (*own, *others):
        text = read_text(path, most=LARGEST).partition("\n")[0].lstrip("# ") if path in own else ""
        uri = path.absolute().as_uri()
        response.spawnables.append(interface_class("simulation_interfaces/msg/Spawnable")(uri=uri, description=text))
    response.result.error_message = wrong


_LONGEST = 1_000_000
"""Largest number of characters of a scene's text in an answer; longer texts contain meshes."""


class Worlds:
    """Loads other scenes into a node while it runs.

    The present scene steps on while the new one is loaded, factored and compiled in a thread. Then the new one takes
    its place, active and paused at time 0; spawned bodies, commands and a bag end with the present scene.

    Args:
        node: node that offers the services.
        load: function that starts a session of a simulation in place of the present one, in the executor's thread.
        unload: function that ends the present session.

    Attributes:
        loading: whether a scene is being loaded.
    """

    def __init__(self, node: SessionNode, *, load: Callable[[Simulation], None], unload: Callable[[], None]) -> None:
        self._node, self._start, self._end = node, load, unload
        self.loading = False
        offered = {
            interface.LOAD_WORLD: self._load,
            interface.UNLOAD_WORLD: self._unload,
            interface.GET_CURRENT_WORLD: self._get_current,
            interface.GET_AVAILABLE_WORLDS: self._get_available,
            interface.GET_SPAWNABLES: _list_spawnables,
        }
        node.offer(offered)

    def _load(self, request: Any, response: Any) -> Future[Any]:
        resource, state = getattr(request, "world_resource", request), self._node.lifecycle_state
        uri, text = resource.uri, resource.resource_string
        if self.loading or state not in ("unconfigured", "inactive", "active"):
            what = "another world is being loaded" if self.loading else f"the node is {state}"
            raise Refused(ResultCode.INCORRECT_STATE, f"{what}; ask again later")
        if not (uri or text):
            raise Refused(ResultCode.WORLD_NO_RESOURCE, "uri and resource_string are empty; one must state the scene")
        self.loading, work = True, Future()

        def finish(built: Simulation | Exception) -> None:
            self.loading = False
            try:
                self._replace(built)
                _describe(response.world, built.scene)
                work.set_result(None)
            except Exception as error:
                work.set_exception(error)

        self._node.in_background(lambda: build_simulation(_scene(uri, text)), finish, name="world")
        return work

    def _replace(self, built: Simulation | Exception) -> None:
        """Start a session of a new simulation; raise the exception that prevented it."""
        if isinstance(built, SceneError):
            raise Refused(ResultCode.WORLD_PARSE_ERROR, str(built)) from built
        if isinstance(built, Exception):
            raise built
        session, state = self._node.session, self._node.lifecycle_state
        if state not in ("unconfigured", "inactive", "active"):
            raise GdfeError(f"the node is {state} meanwhile; the world was not loaded")
        if session is not None:
            session.interrupt("load_world ended it")
        self._start(built)

    def _unload(self, request: Any, response: Any) -> None:
        self._require_world().interrupt("unload_world ended it")
        self._end()

    def _get_current(self, request: Any, response: Any) -> None:
        _describe(response.world, self._require_world().scene)

    def _require_world(self) -> SimulationSession:
        if self._node.session is None:
            text = "no world is loaded; remedy: ~/load_world, or the transition `configure`"
            raise Refused(ResultCode.NO_WORLD, text)
        return self._node.session

    def _get_available(self, request: Any, response: Any) -> None:
        sources = getattr(request, "additional_sources", None) or getattr(request, "sources", ())
        others, wrong = files_in(sources, WORLDS)
        own = [share_dir() / "config" / "scenes" / f"{name}.yaml" for name in scene_names()]
        if not request.filter.tags:  # scenes have no tags
            for path in (*own, *others):
                world = interface_class("simulation_interfaces/msg/WorldResource")(name=path.stem)
                _resource(world).uri = path.absolute().as_uri()
                response.worlds.append(world)
        if wrong and not getattr(request, "continue_on_error", True):
            raise Refused(ResultCode.SOURCES_FAILED, wrong)
        response.result.error_message = wrong


def _scene(uri: str, text: str) -> Scene:
    """Return the scene of a URI, of a name in config/scenes, or of a text.

    Raises:
        Refused: the URI is neither of a file nor a name.
        SceneError: the scene has defects.
    """
    if not uri:
        return scene_from_text(text, origin="resource_string")
    named: str | Path = uri if uri in scene_names() else path_of(uri, WORLDS, code=ResultCode.WORLD_FORMAT)
    return load_scene(named)


def _resource(world: Any) -> Any:
    """Return the part of a ``WorldResource`` that has the URI; in version 2 this is a nested message."""
    return getattr(world, "world_resource", world)


def _describe(world: Any, scene: Scene) -> None:
    """Write name, description and file of a scene into a ``WorldResource``; without a file, its text."""
    world.name, world.description, resource = scene.name, scene.description, _resource(world)
    if scene.path is not None:
        resource.uri = scene.path.absolute().as_uri()
    elif hasattr(resource, "resource_string") and len(scene.source) <= _LONGEST:
        resource.resource_string = scene.source
