# SPDX-License-Identifier: Apache-2.0
"""Second part of the benchmark: twist90_uniform with 500 to 100 000 elements, each size in a process of its own."""

from __future__ import annotations

import json
import resource
import sys
from collections.abc import Iterable, Sequence
from time import perf_counter
from typing import Any

from benchmarks.markdown import markdown_table
from benchmarks.process import run_module
from benchmarks.replay import first_steps
from gdfe_ros.scene import Scene, load_scene
from gdfe_ros.simulation import Simulation

SIZES = ((20, 5, 5), (40, 10, 10), (80, 20, 20), (116, 30, 30))
"""Numbers of cells along x, y, z of meshes with 500, 4000, 32 000 and 104 400 elements."""


def measure_size(cells: Sequence[int]) -> dict[str, Any]:
    """Measure a size in a new process with one thread; return times [s], iterations and memory [B].

    Raises:
        PeerError: the process failed.
    """
    return run_module("benchmarks.scaling", cells, f"scaling, {cells} cells", timeout=900.0)


def scaling_table(sizes: Iterable[dict[str, Any]]) -> str:
    """Return the table with set-up time, iterations and memory for each number of elements."""
    rows = [
        (str(size["elements"]), f"{size['time_setup']:.2f}", f"{size['time_solve']:.2f}", str(size["iterations"]),
         f"{1e3 * size['time_iteration']:.2f}", f"{size['peak_memory'] / 1e6:.0f}")
        for size in sizes
    ]  # fmt: skip
    heads = ("elements", "set-up [s]", "solve [s]", "iterations", "one iteration [ms]", "peak memory [MB]")
    return markdown_table(heads, rows)


def scaling_probe() -> dict[str, float]:
    """Solve the smallest mesh in this process; return iterations and mean displacement [m]."""
    return first_steps(f"{'x'.join(map(str, SIZES[0]))} cells", Simulation(_scene(SIZES[0])), None)


def _scene(cells: Sequence[int]) -> Scene:
    return load_scene("twist90_uniform", overrides={"mesh.bar.cells": list(cells), "solver.tolerance": 1e-4})


def _measure(cells: Sequence[int]) -> dict[str, Any]:
    list(Simulation(_scene(SIZES[0])).play())
    scene, start = _scene(cells), perf_counter()
    simulation = Simulation(scene)
    setup = perf_counter() - start
    simulation.warm_up()  # large bodies have kernels of their own
    start = perf_counter()
    result = list(simulation.play())[-1]
    solve = perf_counter() - start
    return {
        "elements": scene.mesh.n_cells,
        "time_setup": setup,
        "time_solve": solve,
        "iterations": result.iterations,
        "time_iteration": solve / max(result.iterations, 1),
        "peak_memory": 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss,
    }


if __name__ == "__main__":
    print(json.dumps(_measure(json.loads(sys.argv[1]))))
