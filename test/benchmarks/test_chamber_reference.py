# SPDX-License-Identifier: Apache-2.0
"""The pneunet robot against FElupe with quadratic hexahedra on the same mesh."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from gdfe_ros import Simulation, load_scene
from gdfe_ros.simulation import Command

REFERENCE = Path(__file__).parents[1] / "data" / "reference" / "pneunet_felupe.npz"


def errors(cells: list[int], pressures: tuple[float, ...]) -> Iterator[float]:
    """Yield, for each pressure, the tip's distance from FElupe's tip over FElupe's displacement."""
    reference = np.load(REFERENCE)
    scene = load_scene("pneunet", overrides={"mesh.bar.cells": cells, "actuators.air.chamber.rate": 1e9})
    settings = dataclasses.replace(scene.solver, tolerance=1e-6, max_iterations=20000)
    simulation = Simulation(scene, settings=settings)
    rest = simulation.probe_positions()["tip"]
    for pressure in pressures:
        assert simulation.step(Command(actuators={"air": pressure}), dt=1.0).converged
        exact = reference["tip"][np.isclose(reference["pressure"], pressure)][0]
        tip = simulation.probe_positions()["tip"]
        yield float(np.linalg.norm(tip - exact) / np.linalg.norm(exact - rest))


def test_shipped_mesh_agrees_with_quadratic_elements() -> None:
    """With walls one cell thick, the tip is within 2 % up to 10 kPa, and within 7 % when bent by 110 degrees."""
    low, high = errors([41, 8, 8], (10e3, 44e3))
    assert low < 0.02
    assert high < 0.07


@pytest.mark.slow
def test_refined_mesh_agrees_with_quadratic_elements() -> None:
    """With walls two cells thick, the tip is within 3 % of the coarse quadratic mesh at 10 kPa and 2 % at 44 kPa."""
    low, high = errors([82, 16, 16], (10e3, 44e3))
    assert low < 0.03
    assert high < 0.02
