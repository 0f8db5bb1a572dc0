# SPDX-License-Identifier: Apache-2.0
"""Large deformations of the benchmark's bars on coarse meshes: `torsion: section` compared with `torsion: cell`."""

from __future__ import annotations

import numpy as np

from benchmarks.cases import CASES, CaseName
from benchmarks.references import load_reference, measure_error
from gdfe_ros.scene import load_scene
from gdfe_ros.simulation import Simulation
from gdfe_ros.solver.settings import Torsion

CELLS = {
    CaseName.BEND5: ((20, 2, 2), (40, 4, 4)),
    CaseName.TWIST90: ((8, 2, 2), (16, 4, 4)),
    CaseName.TENSILE: ((8, 2, 2), (16, 4, 4)),
    CaseName.TWIST90_UNIFORM: ((8, 2, 2), (16, 4, 4)),
}
"""Meshes with two and four cells across."""


TWISTED = (CaseName.TWIST90, CaseName.TWIST90_UNIFORM)
"""Scenes in which the handle's moment is compared; in all other scenes, the handle's force is compared."""


def all_bars() -> list[dict[str, str | float]]:
    """Return the `bar_errors` of every scene, mesh and kind of torsion, in the order of the table."""
    return [
        {"scene": name.value, "cells": "x".join(map(str, cells)), "torsion": torsion.value}
        | bar_errors(name, cells, torsion)
        for name, meshes in CELLS.items()
        for cells in meshes
        for torsion in Torsion
    ]


def bar_errors(name: CaseName, cells: tuple[int, int, int], torsion: Torsion) -> dict[str, float]:
    """Solve a scene in one step and return its errors against its fine reference.

    Returns:
        ``displacement``: mean error divided by the mean displacement; ``reaction``: relative error of the largest
        component of the handle's force or moment; ``iterations``.

    Raises:
        RuntimeError: the step has not converged.
    """
    overrides = {"mesh.bar.cells": list(cells), "solver.tolerance": 1e-6, "solver.torsion": torsion.value}
    simulation = Simulation(load_scene(name.value, overrides=overrides))
    result = list(simulation.play(1))[-1]
    if not result.converged:
        raise RuntimeError(f"{name.value} {cells} {torsion.value}: {result.message}")
    case, reference = CASES[name], load_reference(name)
    moved = case.grid(cells).evaluate(simulation.positions - simulation.mesh.vertices, reference.vertices)
    found, true = result.reactions["tip"], reference.reaction
    part = slice(3, 6) if name in TWISTED else slice(0, 3)
    largest = part.start + int(np.abs(true[part]).argmax())
    return {
        "displacement": measure_error(moved, reference.displacement).mean,
        "reaction": float(found[largest] / true[largest] - 1.0),
        "iterations": result.iterations,
    }
