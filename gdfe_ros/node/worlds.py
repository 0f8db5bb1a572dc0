# SPDX-License-Identifier: Apache-2.0
"""Worlds of ``simulation_interfaces``: scenes that are loaded, unloaded and listed, and bodies to spawn."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from concurrent.futures import Future
from itertools import islice
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlparse

from gdfe_ros.errors import GdfeError, SceneError
from gdfe_ros.node.interface import services
from gdfe_ros.node.refusals import Refused, ResultCode
from gdfe_ros.node.remodelling import build_simulation
from gdfe_ros.node.services import SessionNode
from gdfe_ros.node.session import SimulationSession
from gdfe_ros.regular_file import read_text
from gdfe_ros.scene.entity import LARGEST
from gdfe_ros.scene.loader import load_scene, scene_from_text, scene_names
from gdfe_ros.scene.scene import Scene
from gdfe_ros.share import share_dir
from gdfe_ros.simulation import Simulation

SPAWNED = (".urdf", ".yaml", ".yml")
"""Suffixes of files that describe a body."""
WORLDS = (".yaml", ".yml")
"""Suffixes of files that describe a scene."""
_MOST_FILES, _MOST_SOURCES = 1000, 20
"""Largest number of files that are listed of one folder, and of folders in a request."""


def path_of(uri: str, suffixes: Collection[str], *, code: int) -> Path:
    """Return the path of a URI ``file:///path``, or of a path.

    Raises:
        Refused: it is neither, or has another suffix; its code is ``code``.
    """
    scheme, path = _parts(uri)
    if scheme not in ("", "file") or path.suffix.lower() not in suffixes:
        raise Refused(code, f"uri is {uri[:200]!r}; allowed: file:///path or a path, to a file {', '.join(suffixes)}")
    return path


def files_in(sources: Sequence[str], suffixes: Collection[str]) -> tuple[list[Path], str]:
    """Return the files of some folders, without their subfolders, and a text on the sources that cannot be listed."""
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
    import simulation_interfaces.msg

    own = sorted((share_dir() / "config" / "bodies").glob("*.yaml"))
    others, wrong = files_in(request.sources, SPAWNED)
    for path in (*own, *others):
        text = read_text(path, most=LARGEST).partition("\n")[0].lstrip("# ") if path in own else ""
        uri = path.absolute().as_uri()
        response.spawnables.append(simulation_interfaces.msg.Spawnable(uri=uri, description=text))
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
            services.LOAD_WORLD: self._load,
            services.UNLOAD_WORLD: self._unload,
            services.GET_CURRENT_WORLD: self._get_current,
            services.GET_AVAILABLE_WORLDS: self._get_available,
            services.GET_SPAWNABLES: _list_spawnables,
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
        import simulation_interfaces.msg

        sources = getattr(request, "additional_sources", None) or getattr(request, "sources", ())
        others, wrong = files_in(sources, WORLDS)
        own = [share_dir() / "config" / "scenes" / f"{name}.yaml" for name in scene_names()]
        if not request.filter.tags:  # scenes have no tags
            for path in (*own, *others):
                world = simulation_interfaces.msg.WorldResource(name=path.stem)
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
    """Return the part of a ``WorldResource`` with its URI; version 2 has a message of its own for it."""
    return getattr(world, "world_resource", world)


def _describe(world: Any, scene: Scene) -> None:
    """Write name, description and file of a scene into a ``WorldResource``; without a file, its text."""
    world.name, world.description, resource = scene.name, scene.description, _resource(world)
    if scene.path is not None:
        resource.uri = scene.path.absolute().as_uri()
    elif hasattr(resource, "resource_string") and len(scene.source) <= _LONGEST:
        resource.resource_string = scene.source
