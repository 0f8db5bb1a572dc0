# SPDX-License-Identifier: Apache-2.0
"""``gdfe sweep``: run a scene with a grid or a list of overrides, in parallel and resumable."""

from __future__ import annotations

import argparse
from pathlib import Path

from gdfe_ros.analysis.sweep import Archive, Case, grid_cases, read_axes, read_list, run_cases
from gdfe_ros.commands.options import add_workers
from gdfe_ros.commands.waiting import progress_bar, waiting
from gdfe_ros.errors import GdfeError
from gdfe_ros.scene import load_scene
from gdfe_ros.terminal import PlainConsole
from gdfe_ros.workers import connect

FAILED = 1
_SHOWN = 10


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
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


def run(arguments: argparse.Namespace) -> int:
    """Run all cases and write the results; return 0, or 1 if a case failed or did not converge."""
    from gdfe_ros.analysis.export import write_parquet
    from gdfe_ros.analysis.sweep import draw_results, flat_row

    with waiting(f"loading {arguments.scene}"):
        scene = load_scene(arguments.scene)
    if scene.program is None:
        raise GdfeError(f"scene {scene.name!r} has no program to play; add the key 'program'")
    cases = _cases(arguments)
    archive = Archive(arguments.out, scene.source)
    _complete(arguments, scene.source, cases, archive)
    rows = [flat_row(case.name, dict(case.overrides), archive.find(case)) for case in cases]
    write_parquet(rows, arguments.out / "results.parquet")
    draw_results(rows, arguments.out / "results.png", title=f"{scene.name}: {len(rows)} cases")
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
    if not arguments.grid and not arguments.list:
        raise GdfeError("nothing to vary: give --grid KEY=VALUES or --list FILE")
    rows = read_list(arguments.list) if arguments.list else [{}]
    return grid_cases(read_axes(arguments.grid), rows)


def _complete(arguments: argparse.Namespace, scene: str, cases: list[Case], archive: Archive) -> None:
    """Run the cases that have no result in the archive and, with ``--retry``, the failed cases; store the results."""
    left = [case for case in cases if _is_left(archive, case, retry=arguments.retry)]
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


def _is_left(archive: Archive, case: Case, *, retry: bool) -> bool:
    result = archive.find(case)
    return result is None or (retry and result["status"] == "failed")
