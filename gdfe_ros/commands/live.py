# SPDX-License-Identifier: Apache-2.0
"""``gdfe live``: show a running scene or node in the browser, and command it with the mouse."""

from __future__ import annotations

import argparse
import math
import os
import threading
import webbrowser
from typing import TYPE_CHECKING

from gdfe_ros.commands.options import add_overrides, say
from gdfe_ros.commands.waiting import waiting
from gdfe_ros.entry import catch_endings, collect, without_collection
from gdfe_ros.errors import GdfeError
from gdfe_ros.node.driving.pace import ClockMode
from gdfe_ros.node.interface import NODE_NAME
from gdfe_ros.scene.override import read_overrides

if TYPE_CHECKING:
    from gdfe_ros.live.page import Page
    from gdfe_ros.live.session import LiveSession
    from gdfe_ros.scene import Scene

ENDED = 1
LOCAL = "127.0.0.1"
PORT = 8080
DT = 0.01


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("scene", nargs="?", help="a name in config/scenes or the path of a YAML file")
    parser.add_argument(
        "--ros",
        nargs="?",
        const=NODE_NAME,
        metavar="NODE",
        help=f"show the running node of this name instead of a scene (default: {NODE_NAME})",
    )
    parser.add_argument(
        "--host",
        default=LOCAL,
        help="address to listen on; with 0.0.0.0 every machine of the network that knows the token can see and "
        f"command it (default: {LOCAL})",
    )
    parser.add_argument(
        "--port",
        type=int,
        default=PORT,
        help=f"port, 1 to 65535; if it is taken, the next free one is used (default: {PORT})",
    )
    parser.add_argument(
        "--fps", type=float, default=30.0, help="largest number of frames per second, 1 to 60 (default: 30)"
    )
    parser.add_argument("--dt", type=float, help=f"simulation time of a step [s] (default: {DT})")
    parser.add_argument(
        "--fast", action="store_true", help="step as fast as possible (default: not faster than real time)"
    )
    parser.add_argument("--play", action="store_true", help="play the scene's program at once")
    parser.add_argument("--open", action="store_true", help="open the page in this machine's browser")
    add_overrides(parser, "override a key, e.g. mesh.bar.cells=[25,2,2]")


def run(arguments: argparse.Namespace) -> int:
    """Show the scene or the node until interrupted; return 0, or 1 if the reception from the node failed."""
    _require(arguments)
    ending = threading.Event()
    try:
        return _show_scene(arguments, ending) if arguments.ros is None else _show_node(arguments, ending)
    finally:
        collect()


def _show_scene(arguments: argparse.Namespace, ending: threading.Event) -> int:
    with without_collection():
        from gdfe_ros.scene import load_scene

        with waiting(f"loading {arguments.scene}"):
            scene = load_scene(arguments.scene, overrides=read_overrides(arguments.set))
        if arguments.play and scene.program is None:
            raise GdfeError(f"scene {scene.name!r} has no program to play; add the key 'program', or leave out --play")
        from gdfe_ros.live.page import Page

        page = Page(host=arguments.host, port=arguments.port, frames=arguments.fps)
    session = None
    try:
        with without_collection():
            # The browser can open the page while this process builds the body, which takes about as long.
            page.lay_out(scene, scene.name)
            _say_where(arguments, page)
            session = _session_of(scene, arguments, page)
        page.show(session)
        session.start()
        if arguments.play:
            session.play()
        _end_on_signals(ending)
        ending.wait()
    finally:
        if session is not None:
            session.stop()
        page.close()
    return 0


def _session_of(scene: Scene, arguments: argparse.Namespace, page: Page) -> LiveSession:
    """Return a session that steps a scene in this process."""
    from gdfe_ros.live.session import LiveSession
    from gdfe_ros.simulation import Simulation

    with waiting(f"preparing {scene.name}"):
        simulation = Simulation(scene)
    for remark in simulation.remarks():
        say(f"warning: {remark}")
    clock = ClockMode.FAST if arguments.fast else ClockMode.WALL
    dt = DT if arguments.dt is None else arguments.dt
    return LiveSession(simulation, dt=dt, clock=clock, on_view=page.show_view, warn=page.say)


def _show_node(arguments: argparse.Namespace, ending: threading.Event) -> int:
    """Show a node. Whenever the node starts another scene, replace the page at the same address."""
    say(f"looking for the node {arguments.ros} in the ROS domain {os.environ.get('ROS_DOMAIN_ID', '0')}")
    with without_collection():
        from gdfe_ros.live.gate import Gate
        from gdfe_ros.live.page import Page
        from gdfe_ros.live.remote.node_session import NodeSession

    port, said, gate = arguments.port, 0, Gate()
    while True:
        session = NodeSession(arguments.ros, say=say)
        page = None
        try:
            page = Page(host=arguments.host, port=port, frames=arguments.fps, gate=gate)
            page.show(session)
            session.start(on_view=page.show_view, warn=page.say)
            if page.port != said:
                _say_where(arguments, page)
            port = said = page.port
            _end_on_signals(ending)
            while not (ending.wait(0.5) or session.outdated or session.failure):
                pass
        finally:
            session.stop()
            if page is not None:
                page.close()
        if ending.is_set() or session.failure:
            return 0 if session.failure is None else ENDED


def _end_on_signals(ending: threading.Event) -> None:
    catch_endings(lambda *_: ending.set())


def _require(arguments: argparse.Namespace) -> None:
    """Raise a `GdfeError` if arguments are invalid, before slow modules are imported."""
    _require_source(arguments)
    if not 1 <= arguments.port <= 65535:
        raise GdfeError(f"--port is {arguments.port}; allowed: 1 to 65535")
    if not 1.0 <= arguments.fps <= 60.0:
        raise GdfeError(f"--fps is {arguments.fps!r}; allowed: 1 to 60 frames a second")
    if arguments.dt is not None and not (math.isfinite(arguments.dt) and 1e-6 <= arguments.dt <= 1e3):
        raise GdfeError(f"--dt is {arguments.dt!r}; allowed: 1e-6 to 1000 s")


def _require_source(arguments: argparse.Namespace) -> None:
    """Raise a `GdfeError` unless the arguments name either a scene or a node.

    Also raise it if a node is named and an option of a scene is given.
    """
    if (arguments.scene is None) == (arguments.ros is None):
        given = "neither" if arguments.ros is None else f"scene {arguments.scene!r} and --ros {arguments.ros}"
        raise GdfeError(f"{given} given; allowed: a scene, or --ros with the name of a running node")
    if arguments.ros is None:
        return
    own = {"--dt": arguments.dt, "--fast": arguments.fast, "--play": arguments.play, "--set": arguments.set}
    if refused := [name for name, value in own.items() if value]:
        raise GdfeError(
            f"{', '.join(refused)} cannot stand beside --ros; remedy: leave it out, and set the node's "
            "parameters instead"
        )


def _say_where(arguments: argparse.Namespace, page: Page) -> None:
    if page.port != arguments.port:
        print(f"port {arguments.port} is taken; port {page.port} is used instead")
    address = page.address("localhost" if arguments.host in (LOCAL, "0.0.0.0") else arguments.host)
    print(f"look at {address} (Ctrl-C ends it)", flush=True)
    if arguments.host == "0.0.0.0":
        print("every machine of the network that has this token can see and command this simulation", flush=True)
    if arguments.open:
        webbrowser.open(address)
