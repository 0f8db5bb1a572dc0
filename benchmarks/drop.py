# SPDX-License-Identifier: Apache-2.0
"""Error of the tip's path against processor time on the scene `drop`, for our solver, MuJoCo and CalculiX."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from benchmarks.peers import ccx_drop, mujoco_drop
from benchmarks.peers.ccx_deck import CcxElement
from benchmarks.peers.drop_case import LASTS, DropPath
from benchmarks.peers.peer import PeerError
from gdfe_ros.scene import load_scene
from gdfe_ros.simulation import Simulation

REFERENCE = Path(__file__).parents[1] / "test" / "data" / "reference" / "motion_drop.npz"
OURS = (
    ((5, 1, 1), "generalised_alpha", 0.05),
    ((10, 1, 1), "generalised_alpha", 0.02),
    ((20, 1, 1), "newmark", 0.01),
    ((20, 1, 1), "generalised_alpha", 0.01),
    ((20, 2, 2), "generalised_alpha", 0.01),
    ((20, 2, 2), "bdf2", 0.01),
    ((20, 2, 2), "newmark", 0.01),
    ((20, 2, 2), "generalised_alpha", 0.005),
    ((40, 4, 4), "generalised_alpha", 0.01),
    ((40, 4, 4), "generalised_alpha", 0.005),
    ((40, 4, 4), "generalised_alpha", 0.002),
)
"""Our runs: cells, scheme and step [s]."""
MUJOCO = (
    (1, (20, 1, 1), 0.01),
    (1, (20, 1, 1), 0.001),
    (1, (20, 2, 2), 0.005),
    (2, (5, 1, 1), 0.002),
    (2, (10, 1, 1), 0.01),
    (2, (10, 1, 1), 0.005),
    (2, (10, 1, 1), 0.002),
    (2, (10, 1, 1), 0.001),
    (2, (20, 1, 1), 0.001),
)
"""MuJoCo's runs: order of the flex, cells and step [s]."""
CALCULIX = (
    (CcxElement.C3D8I, (10, 1, 1), 0.01),
    (CcxElement.C3D8I, (20, 1, 1), 0.01),
    (CcxElement.C3D8I, (20, 1, 1), 0.005),
    (CcxElement.C3D8I, (20, 1, 1), 0.002),
    (CcxElement.C3D8I, (20, 2, 2), 0.01),
)
"""CalculiX' runs: element, cells and step [s]. C3D20R diverged in fixed steps of 2, 5 and 10 ms and is left out."""
LONGEST = 600.0
"""Time limit of a peer's run [s], for a busy machine; on a quiet machine the longest run takes ten seconds."""
SHORT = 1.0
"""Processor time [s] below which a run is made three times."""
_FLEX = {1: "trilinear", 2: "quadratic"}


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


def drop_settings(cells: tuple[int, int, int], scheme: str, h: float) -> dict[str, Any]:
    """Return the overrides of the scene `drop` for cells, a scheme and a step [s]."""
    return {"mesh.bar.cells": list(cells), "dynamics.scheme": scheme, "dynamics.step": h}


def measure_ours(cells: tuple[int, int, int], scheme: str, h: float) -> dict[str, Any]:
    """Return error, processor time [s] and iterations of one of our runs."""
    simulation = Simulation(load_scene("drop", overrides=drop_settings(cells, scheme, h)))
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
    for name, module, runs in (("MuJoCo", mujoco_drop, _mujoco), ("CalculiX", ccx_drop, _calculix)):
        reason = module.available()
        if reason:
            missing.append(f"{name}: {reason}")
            continue
        for kind, cells, h, run in runs():
            try:
                found = repeated(partial(run, cells, h, timeout=LONGEST))
                rows.append(_row(name, kind, cells, h, found))
            except PeerError as error:
                missing.append(str(error))
    return rows, missing


def _mujoco() -> Iterator[tuple[str, tuple[int, int, int], float, Callable[..., DropPath]]]:
    for order, cells, h in MUJOCO:
        yield f"{_FLEX[order]} flex", cells, h, partial(mujoco_drop.simulate, order)


def _calculix() -> Iterator[tuple[str, tuple[int, int, int], float, Callable[..., DropPath]]]:
    for element, cells, h in CALCULIX:
        yield element.value, cells, h, partial(ccx_drop.simulate, element)


def _row(solver: str, kind: str, cells: tuple[int, int, int], h: float, found: DropPath) -> dict[str, Any]:
    own = {"solver": solver, "kind": kind, "cells": list(cells), "step": h}
    return own | {"error": path_error(found.times, found.path), "seconds": found.seconds}
