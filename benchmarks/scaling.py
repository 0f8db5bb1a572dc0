# SPDX-License-Identifier: Apache-2.0
"""Third part of the benchmark: twist90_uniform with 500 to 100 000 elements, and with several Poisson's ratios.

``python -m benchmarks.scaling CELLS POISSON THREADS`` measures one size in this process and prints JSON.
"""

from __future__ import annotations

import hashlib
import json
import resource
import subprocess
import sys
from collections.abc import Iterable, Sequence
from time import perf_counter
from typing import Any

from benchmarks.peers.peer import PeerError, worker_environment
from benchmarks.replay import first_steps
from gdfe_ros.scene import Scene, load_scene
from gdfe_ros.simulation import Simulation

SIZES = ((20, 5, 5), (40, 10, 10), (80, 20, 20), (116, 30, 30))
"""Numbers of cells along x, y, z of meshes with 500, 4000, 32 000 and 104 400 elements."""
RATIOS = (0.3, 0.45, 0.49, 0.499, 0.4999)
TOLERANCE = 1e-4
_SCENE = "twist90_uniform"
_TIMEOUT = 900.0


def measure_scaling(sizes: Iterable[tuple[int, int, int]] = SIZES) -> list[dict[str, Any]]:
    """Return the measurements of several meshes at nu = 0.45, each in a new process with one thread."""
    return [measure_size(cells) for cells in sizes]


def measure_ratios() -> list[dict[str, Any]]:
    """Return the measurements of 4000 elements for several Poisson's ratios."""
    return [measure_size((40, 10, 10), poisson=ratio) for ratio in RATIOS]


def measure_size(cells: tuple[int, int, int], *, poisson: float = 0.45, threads: int = 1) -> dict[str, Any]:
    """Measure a size in a new process; return times [s], iterations, memory [B], and a digest of the positions.

    Raises:
        PeerError: the process failed.
    """
    options = [",".join(map(str, cells)), str(poisson), str(threads)]
    command = [sys.executable, "-m", "benchmarks.scaling", *options]
    process = subprocess.run(
        command, env=worker_environment(threads), capture_output=True, text=True, timeout=_TIMEOUT, check=False
    )
    if process.returncode != 0:
        raise PeerError(f"scaling, {cells} cells, nu {poisson}: {process.stderr.strip().splitlines()[-1:]}")
    return json.loads(process.stdout)


def scaling_probe(sizes: Iterable[Sequence[int]], *, poisson: float = 0.45, threads: int = 1) -> dict[str, float]:
    """Solve meshes in this process; return iterations and mean displacements [m]."""
    found: dict[str, float] = {}
    for cells in sizes:
        name = f"{'x'.join(map(str, cells))}, nu {poisson:g}, {threads} threads"
        found |= first_steps(name, Simulation(_scene(cells, poisson, threads)), None)
    return found


def _scene(cells: Sequence[int], poisson: float, threads: int) -> Scene:
    material = next(iter(load_scene(_SCENE).materials))
    overrides = {
        "mesh.bar.cells": list(cells),
        f"materials.{material}.poisson": poisson,
        "solver.tolerance": TOLERANCE,
        "solver.threads": threads,
    }
    return load_scene(_SCENE, overrides=overrides)


def _measure(cells: Sequence[int], poisson: float, threads: int) -> dict[str, Any]:
    list(Simulation(_scene((20, 5, 5), poisson, threads)).play())
    start = perf_counter()
    big = _scene(cells, poisson, threads)
    loaded = perf_counter()
    simulation = Simulation(big)
    built = perf_counter()
    result = list(simulation.play())[-1]
    solved = perf_counter()
    return {
        "elements": big.mesh.n_cells,
        "vertices": big.mesh.n_vertices,
        "poisson": poisson,
        "time_load": loaded - start,
        "time_setup": built - loaded,
        "time_solve": solved - built,
        "iterations": result.iterations,
        "time_iteration": (solved - built) / max(result.iterations, 1),
        "converged": result.converged,
        "factorisation": result.factorisation,
        "digest": hashlib.sha256(result.positions.tobytes()).hexdigest(),
        "peak_memory": 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss,
    }


if __name__ == "__main__":
    size, ratio, number = sys.argv[1:]
    print(json.dumps(_measure([int(count) for count in size.split(",")], float(ratio), int(number))))
