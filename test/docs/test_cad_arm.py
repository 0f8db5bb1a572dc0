# SPDX-License-Identifier: Apache-2.0
"""The measured arm under pressure: its circumference with and without hoops, and its bending."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.measured_robots.arm_body import MBAR, recorded
from docs.scripts.cad_arm import MODELS, NAME, Arm
from gdfe_ros import Command, Simulation, load_scene

CHAMBER = 1e-9 * Arm().section * (Arm().length - Arm().solid)
"""Drawn volume of a chamber [m^3]."""


def _circumference(positions: NDArray[np.float64]) -> float:
    """Return the mean stretch of the wall along the hoops, also without hoops: the circumference over the drawn one."""
    hoops = load_scene(NAME).fibres[0].families[0]
    lines = np.einsum("fpa,fai->fpi", hoops.factors, positions[hoops.faces])
    return float(np.average(np.linalg.norm(lines, axis=2), weights=hoops.areas))


def _inflated(model: str, pressures: list[float]) -> tuple[Simulation, NDArray[np.float64]]:
    """Return the simulation and the displacement of the tip (3,) [m] from its place without pressure."""
    simulation = Simulation(load_scene(NAME, overrides=MODELS[model]))
    simulation.step()
    rest = np.mean(list(simulation.probe_positions().values()), axis=0)
    for pressure in pressures:
        result = simulation.step(Command(actuators={"air_1": pressure}))
        assert result.converged, result.message
    return simulation, np.mean(list(simulation.probe_positions().values()), axis=0) - rest


@pytest.mark.slow
def test_hoops_keep_the_circumference_and_the_arm_bends() -> None:
    """At 50 mbar, hoops keep the circumference to 0.5 %, and the tip moves aside, away from the chamber under pressure.

    The axial displacement is not compared: the frame of the recording is turned (docs/fitting.md).
    """
    simulation, moved = _inflated("hoops", [25.0 * MBAR, 50.0 * MBAR])
    assert _circumference(simulation.positions) == pytest.approx(1.0, abs=5e-3)
    assert simulation.result.terms["hoops"]["stretch"] < 1.005
    aside = -(moved[0] + moved[1]) / np.sqrt(2.0)
    assert aside * recorded()["lateral"][0] > 0.0
    assert aside > 20.0 * abs(moved[0] - moved[1])


@pytest.mark.slow
def test_without_hoops_the_arm_balloons() -> None:
    """At 125 mbar, the chamber under pressure has more than twice its volume; with hoops, less than 1.7 times."""
    grown, around = {}, {}
    for model in MODELS:
        simulation, _ = _inflated(model, [25.0 * MBAR * k for k in range(1, 6)])
        grown[model] = simulation.result.actuators["air_1"].extent / CHAMBER
        around[model] = _circumference(simulation.positions)
    assert grown["no hoops"] > 2.0 > 1.7 > grown["hoops"]
    assert around["hoops"] == pytest.approx(1.0, abs=5e-3)
    assert around["no hoops"] > 1.05
