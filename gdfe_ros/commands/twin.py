# SPDX-License-Identifier: Apache-2.0
"""``gdfe twin``: let a scene follow a real robot, compare both, and fit Young's moduli while they move."""

from __future__ import annotations

import argparse
import math
import threading
import time
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from gdfe_ros.commands.options import add_overrides, say
from gdfe_ros.commands.waiting import waiting
from gdfe_ros.entry import catch_endings
from gdfe_ros.errors import GdfeError
from gdfe_ros.node.interface import NODE_NAME
from gdfe_ros.scene.override import read_overrides

if TYPE_CHECKING:
    from gdfe_ros.live.page import Page
    from gdfe_ros.twin.estimator import MeasuredBody
    from gdfe_ros.twin.twin import Twin

_PERIOD = 0.05
"""Time between two comparisons [s]."""
_REPORT = 5.0
"""Time between two lines on the terminal [s]."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("scene", help="a name in config/scenes or the path of a YAML file; it needs probes")
    parser.add_argument(
        "--topics",
        nargs="+",
        required=True,
        metavar="PROBE=TOPIC",
        help="topic of the measured pose or point of each probe (PoseStamped or PointStamped, in the scene's frame)",
    )
    parser.add_argument(
        "--commands",
        default=f"/{NODE_NAME}/actuation",
        metavar="TOPIC",
        help=f"topic of the robot's commands, a JointState (default: /{NODE_NAME}/actuation)",
    )
    parser.add_argument("--fit", nargs="*", default=[], metavar="MATERIAL", help="materials whose moduli are fitted")
    parser.add_argument("--noise", type=float, default=1.0, help="noise of the measured positions [mm] (default: 1)")
    parser.add_argument("--delay", type=float, default=0.0, help="time by which their stamps are late [s] (default: 0)")
    parser.add_argument(
        "--record",
        nargs="+",
        type=Path,
        default=[],
        metavar="FILE",
        help="a .csv file for every comparison, a .mcap file for these and the simulation's messages, or both",
    )
    parser.add_argument("--seconds", type=float, default=math.inf, help="end after this time (default: at Ctrl-C)")
    parser.add_argument("--patience", type=float, default=30.0, help="wait for the topics [s] (default: 30)")
    parser.add_argument("--port", type=int, default=8080, help="port of the page; 0: no page (default: 8080)")
    parser.add_argument("--dt", type=float, default=0.02, help="time of a step [s] (default: 0.02)")
    add_overrides(parser, "override a key of the scene")


def run(arguments: argparse.Namespace) -> int:
    """Follow the robot until interrupted, and print the comparison; return 0, or 1 if nothing was measured."""
    measured = _require(arguments)
    from gdfe_ros.scene import load_scene
    from gdfe_ros.simulation import Simulation
    from gdfe_ros.twin.estimator import MeasuredBody
    from gdfe_ros.twin.remote.robot import Robot
    from gdfe_ros.twin.twin import Twin

    with waiting(f"preparing {arguments.scene}"):
        simulation = Simulation(load_scene(arguments.scene, overrides=read_overrides(arguments.set)))
        simulation.warm_up()
    unknown = [probe for probe in measured if probe not in simulation.scene.probes]
    if unknown:
        known = ", ".join(simulation.scene.probes) or "none"
        raise GdfeError(f"--topics names the probe {unknown[0]!r}; probes of the scene: {known}")
    given = {"moduli": arguments.fit, "dt": arguments.dt, "noise": 1e-3 * arguments.noise, "delay": arguments.delay}
    page = _page(arguments)
    shown = {"warn": say, "on_view": page.show_view} if page is not None else {"warn": say}
    files = {path.suffix: path for path in arguments.record}
    twin = Twin(simulation, table=files.get(".csv"), bag=files.get(".mcap"), **given, **shown)
    measured_body = MeasuredBody(simulation.scene)
    ending = threading.Event()
    catch_endings(lambda *_: ending.set())
    robot = None
    try:
        if page is not None:
            page.show(twin.session)
            print(f"look at {page.address()} (Ctrl-C ends it)", flush=True)
        robot = Robot(twin, commands=arguments.commands, measured=measured, patience=arguments.patience, warn=say)
        twin.start()
        print("following", flush=True)
        _follow(twin, page, measured_body, ending, arguments.seconds)
    finally:
        if robot is not None:
            robot.close()
        twin.stop()
        if page is not None:
            page.close()
    return 0 if twin.compared else 1


def _follow(twin: Twin, page: Page | None, robot: MeasuredBody, ending: threading.Event, seconds: float) -> None:
    start, reported = time.monotonic(), 0.0
    while not ending.wait(_PERIOD) and (passed := time.monotonic() - start) < seconds:
        if twin.update() and page is not None:
            places = {name: (each.measured, each.simulated) for name, each in twin.latest.items()}
            away = {name: measured - simulated for name, (measured, simulated) in places.items()}
            page.compare(places, lambda positions, away=away: robot.at(positions, away))
        if passed - reported >= _REPORT:
            reported = passed
            print(f"{passed:6.1f} s: {_summary(twin)}", flush=True)
    print(f"end: {_summary(twin)}", flush=True)


def _summary(twin: Twin) -> str:
    """Return a line with the last distance of each probe, and the moduli with their standard deviations."""
    distances = [f"{name} {1e3 * each.distance:.2f} mm apart" for name, each in sorted(twin.latest.items())]
    spread = twin.deviations
    moduli = [f"{name} {young:.4g} Pa +- {100 * spread[name]:.1g} %" for name, young in twin.moduli.items()]
    return ", ".join([*(distances or ["nothing measured yet"]), *moduli, f"{twin.compared} measurements"])


def _page(arguments: argparse.Namespace) -> Page | None:
    if not arguments.port:
        return None
    from gdfe_ros.live.page import Page

    return Page(host="127.0.0.1", port=arguments.port, frames=30.0)


def _require(arguments: argparse.Namespace) -> dict[str, str]:
    """Return the dict from probe to topic; raise a `GdfeError` if an argument is invalid, before slow imports."""
    if arguments.port and find_spec("viser") is None:
        raise GdfeError("the page needs viser; install it: pip install 'gdfe_ros[live]', or use --port 0")
    allowed = {"noise": (1e-6, 1e6), "delay": (0.0, 5.0), "seconds": (0.0, math.inf), "dt": (1e-3, 1.0)}
    for name, (low, high) in allowed.items():
        value = getattr(arguments, name)
        if not low <= value <= high:
            raise GdfeError(f"--{name} is {value!r}; allowed: {low:g} to {high:g}")
    if not 0 <= arguments.port <= 65535:
        raise GdfeError(f"--port is {arguments.port}; allowed: 1 to 65535, or 0 for no page")
    _require_files(arguments.record)
    pairs = [entry.partition("=") for entry in arguments.topics]
    wrong = [entry for entry, (probe, _, topic) in zip(arguments.topics, pairs, strict=True) if not (probe and topic)]
    if wrong:
        raise GdfeError(f"--topics has {wrong[0]!r}; allowed: PROBE=TOPIC, e.g. tip=/robot/tip_pose")
    return {probe: topic for probe, _, topic in pairs}


def _require_files(paths: Sequence[Path]) -> None:
    """Raise a `GdfeError` if the paths are not at most one new .csv file and one new .mcap file."""
    kinds = [path.suffix for path in paths]
    if wrong := [path for path in paths if path.suffix not in (".csv", ".mcap")]:
        raise GdfeError(f"--record has {str(wrong[0])!r}; allowed: names that end with .csv or .mcap")
    if len(set(kinds)) < len(kinds):
        raise GdfeError(f"--record has several {kinds[0]} files; allowed: one .csv and one .mcap file")
    if taken := [path for path in paths if path.exists()]:
        raise GdfeError(f"--record: {taken[0]} exists; name another file or remove it")
