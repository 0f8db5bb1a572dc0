# SPDX-License-Identifier: Apache-2.0
"""``gdfe compile``: compile what the shipped scenes need, once, so that nobody waits for it later."""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from gdfe_ros.scene import load_scene, scene_names

FIRST = "bend5"
"""What all scenes share is compiled with this one, before others are."""
VARIANTS: tuple[tuple[str, dict[str, object]], ...] = (
    (FIRST, {"solver.threads": 2}),
    (FIRST, {"solver.policy": "relative"}),
)
"""Of shipped scenes, by what is compiled for them in addition."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "--jobs", type=int, default=os.cpu_count() or 1, help="number of processes (default: one per core)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Compile with a progress bar; return 0."""
    columns = TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn()
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("compiling", total=len(work()))
        for name in _compiled(max(1, arguments.jobs)):
            progress.update(task, advance=1, description=f"compiling, {name} is ready")
    return 0


def work() -> list[tuple[str, dict[str, object]]]:
    """Return scenes and what is overridden in them; the first one comes before the others begin."""
    return [(FIRST, {}), *VARIANTS, *((name, {}) for name in scene_names() if name != FIRST)]


def _compiled(jobs: int) -> Iterator[str]:
    """Yield the name of each scene once what it needs is compiled."""
    first, *others = work()
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        yield pool.submit(_compile, *first).result()
        for done in as_completed([pool.submit(_compile, *item) for item in others]):
            yield done.result()


def _compile(name: str, overrides: dict[str, object]) -> str:
    from gdfe_ros.simulation import Simulation

    simulation = Simulation(load_scene(name, overrides=overrides))
    simulation.warm_up()
    if simulation.scene.program is not None:
        next(simulation.play())
    return name
