# SPDX-License-Identifier: Apache-2.0
"""Error of the tip's path against processor time on the scene `drop`, for our solver, MuJoCo and CalculiX."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from benchmarks.peers import ccx_drop, mujoco_drop
from benchmarks.peers.drop_case import LASTS, DropPath
from benchmarks.peers.peer import attempt
from gdfe_ros.scene import load_scene
from gdfe_ros.simulation import Simulation

REFERENCE = Path(__file__).parents[1] / "test" / "data" / "reference" / "motion_drop.npz"
RUNS = Path(__file__).with_name("drop.yaml")
"""The runs of each solver: scheme, flex or element, cells and step [s]."""
PEERS = {"MuJoCo": mujoco_drop, "CalculiX": ccx_drop}
LONGEST = 600.0
"""Time limit of a peer's run [s], for a busy machine; on a quiet machine the longest run takes ten seconds."""
SHORT = 1.0
"""Processor time [s] below which a run is made three times."""


@cache
def list_runs(solver: str) -> list[tuple[str, tuple[int, int, int], float]]:
    """Return scheme, flex or element, cells and step [s] of each run of a solver."""
    runs = yaml.safe_load(RUNS.read_text(encoding="utf-8"))[solver]
    return [(kind, tuple(map(int, cells.split("x"))), h) for kind, cells, h in runs]


def path_error(times: NDArray[np.float64], path: NDArray[np.float64]) -> float:
    """Return the rms distance of a tip path (n, 3) [m] from the reference, relative to the latter's largest motion."""
    reference = np.load(REFERENCE)
    tip = reference["tip_centre"]
    away = path - CubicSpline(reference["t"], tip)(times)
    return float(np.sqrt((away**2).sum(axis=1).mean()) / np.linalg.norm(tip - tip[0], axis=1).max())


def repeated(run: Callable[[], DropPath]) -> DropPath:
    """Return the result of ``run``; a short run is repeated, and the one with the median time of three is returned."""
    found = [run()]
    if found[0].seconds < SHORT:
        found += [run(), run()]
    return sorted(found, key=lambda each: each.seconds)[len(found) // 2]


def drop_settings(scheme: str, cells: tuple[int, int, int], h: float) -> dict[str, Any]:
    """Return the overrides of the scene `drop` for cells, a scheme and a step [s]."""
    return {"mesh.bar.cells": list(cells), "dynamics.scheme": scheme, "dynamics.step": h}


def measure_ours(scheme: str, cells: tuple[int, int, int], h: float) -> dict[str, Any]:
    """Return error, processor time [s] and iterations of one of our runs."""
    simulation = Simulation(load_scene("drop", overrides=drop_settings(scheme, cells, h)))
    simulation.warm_up()
    iterations: list[int] = []

    def run() -> DropPath:
        simulation.reset()
        iterations.clear()
        started, path, times = process_time(), [], []
        while simulation.time < LASTS - 1e-9:
            result = simulation.step()
            path.append(simulation.probe_positions()["tip"])
            times.append(result.time)
            iterations.append(result.iterations)
        return DropPath(np.array(times), np.array(path), process_time() - started)

    return _row("gdfe_ros", scheme, cells, h, repeated(run)) | {"iterations": float(np.mean(iterations))}


def measure_peers() -> tuple[list[dict[str, Any]], list[str]]:
    """Return the rows of all installed peers, and messages about missing peers and failed runs."""
    rows, missing = [], []
    for name in PEERS:
        found, failed = attempt(name, PEERS[name], list_runs(name), partial(_measure_peer, name))
        rows += found
        missing += failed
    return rows, missing


def _measure_peer(name: str, run: tuple[str, tuple[int, int, int], float]) -> dict[str, Any]:
    return _row(name, *run, repeated(partial(PEERS[name].simulate, *run, timeout=LONGEST)))


def _row(solver: str, kind: str, cells: tuple[int, int, int], h: float, found: DropPath) -> dict[str, Any]:
    own = {"solver": solver, "kind": kind, "cells": list(cells), "step": h}
    return own | {"error": path_error(found.times, found.path), "seconds": found.seconds}
