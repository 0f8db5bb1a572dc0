# SPDX-License-Identifier: Apache-2.0
"""``gdfe demo``: run a node in its own process, command it with a scene's program, record a bag, draw a picture."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

import numpy as np
from rich.table import Table

from gdfe_ros.analysis.bag_run import BagRun
from gdfe_ros.commands.options import require_number
from gdfe_ros.commands.waiting import convergence, print_failures, progress_bar, waiting
from gdfe_ros.errors import GdfeError
from gdfe_ros.quantity import Quantity
from gdfe_ros.recording.bag_info import IN_RUN, make_run_folder
from gdfe_ros.scene import Scene, load_scene
from gdfe_ros.untrusted.regular_file import path_inside
from gdfe_ros.untrusted.terminal import QUANTITIES, PlainConsole, make_table

FAILED = 1


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("scene", nargs="?", default="bend5", help="a name in config/scenes or the path of a YAML file")
    parser.add_argument("--out", type=Path, help="directory for the bag and the picture (default: runs/<scene>_<time>)")
    parser.add_argument(
        "--dt", type=float, default=0.01, help="simulation time between two commands [s] (default: 0.01)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Send the commands of the scene's program to a node; return 0, or 1 if a step did not converge."""
    require_number("--dt", arguments.dt, Quantity("time between two commands", "s", least=1e-6, most=1e3))
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    with waiting(f"loading {arguments.scene}"):
        scene = load_scene(arguments.scene)
    if scene.program is None:
        raise GdfeError(f"scene {scene.name!r} has no program to play; add the key 'program'")
    out = arguments.out or make_run_folder(scene.name)
    from gdfe_ros.analysis.report.pictures import write_png  # matplotlib takes a second to import

    console = PlainConsole()
    first = _play(scene, str(arguments.scene), out / IN_RUN, arguments.dt)
    bag = BagRun(out / IN_RUN)
    console.print(_table(scene, bag, first))
    write_png(out / IN_RUN, path_inside(out, f"{scene.name}.png"))
    console.print(f"bag      {out / 'bag'}\npicture  {path_inside(out, f'{scene.name}.png')}")
    print_failures(bag.records, first=0)
    return 0 if all(record.converged for record in bag.records) else FAILED


def _play(scene: Scene, source: str, bag: Path, dt: float) -> float:
    """Send the program to a node, with a progress bar; return the time [s] from the node's start to its first step."""
    from gdfe_ros.testing.node_replay import play_program

    with progress_bar(f"{scene.name}: starting the node", scene.program.duration) as update:

        def tell(moment: float) -> None:
            update(description=f"{scene.name}: commanding it over topics", completed=moment)

        return play_program(scene, source, bag=bag, dt=dt, tell=tell)


def _table(scene: Scene, bag: BagRun, first: float) -> Table:
    records = [record for record in bag.records if record.step > 0]
    times = np.array([record.wall_time for record in records])
    last, wrenches = records[-1], bag.last_wrenches()
    title = ": ".join(filter(None, (scene.name, scene.description)))
    table = make_table(title, QUANTITIES, right=("value",), min_width=64)
    table.add_row("vertices, cells", f"{scene.mesh.n_vertices}, {scene.mesh.n_cells}", "")
    table.add_row("node start to first step", f"{first:.2f}", "s")
    table.add_row("steps commanded, taken", f"{round(scene.program.duration / records[0].dt)}, {len(records)}", "")
    table.add_row("solve time a step, median", f"{1e3 * np.median(times):.2f}", "ms")
    speed = sum(record.dt for record in records) / times.sum()
    table.add_row("speed, times real time", f"{speed:.3g}", "")
    table.add_row("iterations a step, mean", f"{np.mean([record.iterations for record in records]):.1f}", "")
    table.add_row("converged", convergence(records), "")
    table.add_row("strain energy", f"{last.energy:.6g}", "J")
    table.add_row("min det F", f"{last.min_det:.4f}", "")
    for name, (force, moment) in wrenches.items():
        table.add_row(f"{name}: force", "  ".join(f"{value:.4g}" for value in force), "N")
        table.add_row(f"{name}: moment", "  ".join(f"{value:.4g}" for value in moment), "N m")
    for what, places, unit in (
        ("total force on it", bag.last_total_forces(), "N"),
        ("moved by", bag.last_places("bodies/*/pose"), "m"),
        ("position", bag.last_places("probe/*"), "m"),
    ):
        for name, vector in places.items():
            table.add_row(f"{name}: {what}", "  ".join(f"{value:.4g}" for value in vector), unit)
    table.add_row("messages in the bag", str(len(bag.reader)), "")
    return table
