# SPDX-License-Identifier: Apache-2.0
"""``gdfe workspace``: compute the points that a probe reaches over the ranges of the actuators."""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from gdfe_ros.actuators import Mode
from gdfe_ros.commands.options import add_overrides, add_workers, open_client, read_overrides
from gdfe_ros.commands.waiting import waiting
from gdfe_ros.errors import GdfeError
from gdfe_ros.regular_file import path_inside
from gdfe_ros.scene import load_scene
from gdfe_ros.terminal import PlainConsole, make_table

UNREACHED = 3


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("scene", help="a name in config/scenes or the path of a YAML file")
    parser.add_argument("--probe", help="name of the probe (default: the scene's first)")
    parser.add_argument(
        "--actuators",
        nargs="+",
        metavar="NAME",
        help="names of the actuators that are moved (default: all except grips)",
    )
    parser.add_argument(
        "--range",
        action="append",
        default=[],
        metavar="NAME=LOW..HIGH",
        help="range of an actuator's command, instead of the scene's",
    )
    parser.add_argument("--count", type=int, default=200, help="approximate number of commands (default: 200)")
    add_workers(parser)
    add_overrides(parser, "override a key, e.g. mesh.bar.cells=[25,2,2]")
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help="directory for the results (default: <scene>_workspace)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Compute the workspace; return 0, or 3 if no equilibrium was found for some commands."""
    from gdfe_ros.analysis.workspace import (
        command_samples,
        draw_workspace,
        find_workspace,
        ranges,
        workspace_rows,
        write_workspace,
    )

    started = time.perf_counter()
    with waiting(f"loading {arguments.scene}"):
        scene = load_scene(arguments.scene, overrides=read_overrides(arguments.set))
    moved = [actuator.name for actuator in scene.actuators if actuator.mode is not Mode.GRIP]
    names = arguments.actuators or moved
    if not names or not scene.probes:
        raise GdfeError(
            f"scene {scene.name!r} needs the keys `actuators`, which move it, and `probes`, whose reach is computed"
        )
    if arguments.count < 2:
        raise GdfeError(f"--count {arguments.count}; allowed: 2 or more")
    probe = arguments.probe or next(iter(scene.probes))
    limits = ranges(scene, names, _read_ranges(arguments.range, names))
    commands = command_samples(limits, arguments.count)
    with open_client(arguments) as client:
        found = find_workspace(scene, probe, names, commands, client=client)
    out = arguments.out or path_inside(Path(), f"{scene.name}_workspace")
    out.mkdir(parents=True, exist_ok=True)
    write_workspace(out / "workspace.csv", found)
    console = PlainConsole(soft_wrap=True)
    console.print(make_table(f"{scene.name}: where {probe} can be", rows=workspace_rows(found)))
    if found.reached.any():
        draw_workspace(out / "workspace.png", found, title=f"{scene.name}: where {probe} can be")
    missing = [message for message in found.messages if message]
    if missing:
        console.print(f"{len(missing)} commands have no equilibrium, first: {missing[0]}", style="yellow")
    console.print(f"written  {out}, {time.perf_counter() - started:.3g} s", highlight=False)
    return UNREACHED if missing else 0


def _read_ranges(entries: list[str], names: list[str]) -> dict[str, tuple[float, float]]:
    given = [_read_range(entry) for entry in entries]
    for option, words in (("--actuators", names), ("--range", [name for name, _ in given])):
        if twice := {word for word in words if words.count(word) > 1}:
            raise GdfeError(f"{option} names {', '.join(sorted(twice))} twice; give each name once")
    return dict(given)


def _read_range(entry: str) -> tuple[str, tuple[float, float]]:
    name, separator, interval = entry.partition("=")
    try:
        low, high = (float(part) for part in interval.split(".."))
    except ValueError:
        separator = ""
    if not separator:
        raise GdfeError(f"--range takes NAME=LOW..HIGH, got {entry!r}")
    return name.strip(), (low, high)
