# SPDX-License-Identifier: Apache-2.0
"""``gdfe compile``: compile the kernels of scenes in advance, e.g. for an image or a test server."""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context

from gdfe_ros.commands.options import count_processes
from gdfe_ros.commands.waiting import progress_bar, waiting
from gdfe_ros.scene import load_scene
from gdfe_ros.scene.loader import loadable_names

FIRST = "bend5"
"""Scene that is compiled before all others, because the others use the same kernels."""
VARIANTS: tuple[tuple[str, dict[str, object]], ...] = (
    (FIRST, {"solver.threads": 2}),
    (FIRST, {"solver.policy": "relative"}),
)
"""Shipped scenes with overrides that need further kernels."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "scenes", nargs="*", metavar="SCENE", help="name in config/scenes or path of a YAML file (default: all shipped)"
    )
    parser.add_argument(
        "--jobs", type=count_processes, default=os.cpu_count() or 1, help="number of processes (default: one per core)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Compile with a progress bar; return 0."""
    if arguments.scenes:
        for name in arguments.scenes:
            with waiting(f"loading {name}"):
                _compile(name, {})
        return 0
    with progress_bar("compiling", len(work()) + 1) as update:
        for name in _compile_all(arguments.jobs):
            update(advance=1, description=f"compiling, {name} is ready")
    return 0


def work() -> list[tuple[str, dict[str, object]]]:
    """Return pairs of scene and overrides to compile; the first must be completed before the others are started.

    Scenes with a robot from a package that is not installed are left out; other scenes need the same kernels.
    """
    return [(FIRST, {}), *VARIANTS, *((name, {}) for name in loadable_names() if name != FIRST)]


def _compile_all(jobs: int) -> Iterator[str]:
    """Compile with ``jobs`` processes; yield the name of each scene when its kernels are compiled."""
    first, *others = work()
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        yield pool.submit(_compile, *first).result()
        for done in as_completed([pool.submit(_compile_surfaces), *(pool.submit(_compile, *item) for item in others)]):
            yield done.result()


def _compile_surfaces() -> str:
    """Compile the kernels for surface files, because no shipped scene has one; return a name to display."""
    from gdfe_ros.mesh import bar
    from gdfe_ros.mesh.meshing.voxels import CutCubes, fill_surface
    from gdfe_ros.mesh.outside import carry_skin
    from gdfe_ros.mesh.surfaces.solid import make_solid

    cube = bar((1.0, 1.0, 1.0), (1, 1, 1))
    triangles = cube.surface()[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3).astype("int64")
    fill_surface(cube.vertices, triangles, cell=0.6, cells=CutCubes.CUT)
    carry_skin(cube.vertices, cube.cells, cube.vertices, triangles)
    make_solid(cube.vertices, triangles, cell=0.05)
    return "surfaces"


def _compile(name: str, overrides: dict[str, object]) -> str:
    from gdfe_ros.simulation import Simulation

    simulation = Simulation(load_scene(name, overrides=overrides))
    simulation.warm_up()
    if simulation.scene.program is not None:
        next(simulation.play())
    return name
