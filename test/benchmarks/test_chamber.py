# SPDX-License-Identifier: Apache-2.0
"""Robots with pressure chambers against FElupe with quadratic hexahedra on the same meshes (test/data/reference)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from benchmarks.report import KEPT
from gdfe_ros import Simulation, load_scene
from gdfe_ros.simulation import Command

FREE = {"actuators.air.chamber.rate": 1e9}


def reference(name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return FElupe's pressures (k,) [Pa] and tips (k, 3) [m] of a robot."""
    with np.load(KEPT / "reference" / f"{name}_felupe.npz") as data:
        return data["pressure"], data["tip"]


def errors(cells: list[int], pressures: tuple[float, ...]) -> Iterator[float]:
    """Yield the error of the pneunet's tip at each pressure, divided by FElupe's displacement."""
    known, tips = reference("pneunet")
    solver = {"solver.tolerance": 1e-6, "solver.max_iterations": 20000}
    simulation = Simulation(load_scene("pneunet", overrides={"mesh.bar.cells": cells, **solver, **FREE}))
    rest = simulation.probe_positions()["tip"]
    for pressure in pressures:
        assert simulation.step(Command(actuators={"air": pressure}), dt=1.0).converged
        exact = tips[np.isclose(known, pressure)][0]
        yield float(np.linalg.norm(simulation.probe_positions()["tip"] - exact) / np.linalg.norm(exact - rest))


@pytest.mark.parametrize(
    ("cells", "bounds"), [([41, 8, 8], (0.02, 0.07)), pytest.param([82, 16, 16], (0.03, 0.02), marks=pytest.mark.slow)]
)
def test_meshes_agree_with_quadratic_elements(cells: list[int], bounds: tuple[float, float]) -> None:
    """With walls one and two cells thick, the tip is within 2 and 3 % at 10 kPa, within 7 and 2 % at 44 kPa."""
    for error, bound in zip(errors(cells, (10e3, 44e3)), bounds, strict=True):
        assert error < bound


def test_tube_agrees_with_quadratic_elements_over_its_whole_program() -> None:
    """The tip is within 2 % of its displacement at every pressure, for bends up to more than 90 degrees."""
    pressures, tips = reference("bending_tube")
    simulation = Simulation(load_scene("bending_tube"))
    assert max(point.value for point in simulation.scene.program.actuators["air"]) == pressures[-1]
    rest, angles, last = simulation.probe_positions()["tip"], [], 0.0
    for pressure, exact in zip(pressures, tips, strict=True):
        for value in np.linspace(last, pressure, 5)[1:]:
            result = simulation.step(Command(actuators={"air": float(value)}), dt=1.0)
            assert result.converged, result.message
        last, probes = pressure, simulation.probe_positions()
        assert np.linalg.norm(probes["tip"] - exact) < 0.02 * np.linalg.norm(exact - rest)
        across = probes["tip_top"] - probes["tip"]
        angles.append(np.degrees(np.arctan2(across[0], across[2])))
    assert angles[-1] > 90.0
    assert np.diff(angles).min() > 0.0
