# SPDX-License-Identifier: Apache-2.0
"""``gdfe sweep`` runs many cases of a scene in parallel; ``gdfe workspace`` finds the positions a probe can reach."""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import TYPE_CHECKING

from gdfe_ros.actuators import Mode
from gdfe_ros.analysis.workers import connect
from gdfe_ros.commands.options import add_overrides, add_workers, open_client
from gdfe_ros.commands.waiting import progress_bar, waiting
from gdfe_ros.errors import GdfeError
from gdfe_ros.scene import load_scene
from gdfe_ros.scene.override import read_overrides
from gdfe_ros.untrusted.regular_file import path_inside
from gdfe_ros.untrusted.terminal import PlainConsole, make_table

if TYPE_CHECKING:
    from gdfe_ros.analysis.sweep import Archive, Case

FAILED = 1
_SHOWN = 10


def add_sweep(parser: argparse.ArgumentParser) -> None:
    """Declare the options of ``sweep``."""
    parser.add_argument("scene", help="a name in config/scenes or the path of a YAML file")
    parser.add_argument(
        "--grid",
        action="append",
        default=[],
        metavar="KEY=VALUES",
        help="values of a key of the scene: a YAML list, or low:high:count; several --grid are combined with each "
        "other",
    )
    parser.add_argument(
        "--list",
        type=Path,
        metavar="FILE",
        help="file of cases: CSV with keys in the first line and one case per line, or a YAML list of mappings",
    )
    parser.add_argument(
        "--out", type=Path, required=True, help="directory for the results; a second run continues in it"
    )
    add_workers(parser)
    parser.add_argument("--retry", action="store_true", help="repeat the cases that failed in an earlier run")


def sweep(arguments: argparse.Namespace) -> int:
    """Run all cases and write the results; return 0, or 1 if a case failed or did not converge."""
    from gdfe_ros.analysis.export import write_parquet
    from gdfe_ros.analysis.sweep import Archive, flat_row, results_figure

    with waiting(f"loading {arguments.scene}"):
        scene = load_scene(arguments.scene)
    if scene.program is None:
        raise GdfeError(f"scene {scene.name!r} has no program to play; add the key 'program'")
    cases = _cases(arguments)
    archive = Archive(arguments.out, scene.source)
    _complete(arguments, scene.source, cases, archive)
    rows = [flat_row(case.name, dict(case.overrides), archive.find(case)) for case in cases]
    write_parquet(rows, arguments.out / "results.parquet")
    results_figure(rows, title=f"{scene.name}: {len(rows)} cases").savefig(arguments.out / "results.png")
    bad = [row for row in rows if row["status"] != "converged"]
    console = PlainConsole(soft_wrap=True)
    alike: dict[tuple[str, str], list[dict]] = {}
    for row in bad:
        alike.setdefault((row["status"], row["error"]), []).append(row)
    for (status, error), group in list(alike.items())[:_SHOWN]:
        settings = {key.removeprefix("set."): value for key, value in group[0].items() if key.startswith("set.")}
        more = f" and {len(group) - 1} more" if len(group) > 1 else ""
        console.print(f"{status}: {settings}{more}: {error}", style="red")
    console.print(f"{len(rows) - len(bad)} of {len(rows)} cases converged; {arguments.out / 'results.parquet'}")
    return FAILED if bad else 0


def _cases(arguments: argparse.Namespace) -> list[Case]:
    from gdfe_ros.analysis.sweep import grid_cases, read_axes, read_list

    if not arguments.grid and not arguments.list:
        raise GdfeError("nothing to vary: give --grid KEY=VALUES or --list FILE")
    rows = read_list(arguments.list) if arguments.list else [{}]
    return grid_cases(read_axes(arguments.grid), rows)


def _complete(arguments: argparse.Namespace, scene: str, cases: list[Case], archive: Archive) -> None:
    """Run the cases that have no result in the archive and, with ``--retry``, the failed cases; store the results."""
    from gdfe_ros.analysis.sweep import run_cases

    done = ("converged", "not converged") if arguments.retry else ("converged", "not converged", "failed")
    left = [case for case in cases if (archive.find(case) or {}).get("status") not in done]
    if len(left) < len(cases):
        PlainConsole(stderr=True).print(f"{len(cases) - len(left)} of {len(cases)} cases are done already")
    if not left:
        return
    with (
        connect(arguments.scheduler, arguments.workers) as client,
        progress_bar("cases", len(left), counted=True) as update,
    ):
        for case, result in run_cases(client, scene, left):
            archive.keep(case, result)
            update(advance=1)


UNREACHED = 3


def add_workspace(parser: argparse.ArgumentParser) -> None:
    """Declare the options of ``workspace``."""
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


def find_reach(arguments: argparse.Namespace) -> int:
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


COMMANDS = {"sweep": (add_sweep, sweep), "workspace": (add_workspace, find_reach)}
