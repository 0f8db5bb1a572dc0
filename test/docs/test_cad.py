# SPDX-License-Identifier: Apache-2.0
"""Bodies from drawings: the measured arm under pressure, a PneuNet finger on paper, and a part with blind holes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from benchmarks.measured_robots.arm_body import MBAR, recorded
from docs.scripts import cad_arm, cad_pneunet
from docs.scripts.cad_arm import NAME, Arm
from docs.scripts.cad_part import COMMANDS, Part, timed
from docs.scripts.drawing import write_step
from gdfe_ros import Command, Simulation, load_scene
from test.written import advance

CHAMBER = 1e-9 * Arm().section * (Arm().length - Arm().solid)
"""Drawn volume of a chamber [m^3]."""


def _circumference(positions: NDArray[np.float64]) -> float:
    """Return the mean stretch of the wall along the hoops, also without hoops: the circumference over the drawn one."""
    hoops = load_scene(NAME).fibres[0].families[0]
    lines = np.einsum("fpa,fai->fpi", hoops.factors, positions[hoops.faces])
    return float(np.average(np.linalg.norm(lines, axis=2), weights=hoops.areas))


def _inflated(model: str, pressures: list[float]) -> tuple[Simulation, NDArray[np.float64]]:
    """Return the simulation and the displacement of the tip (3,) [m] from its place without pressure."""
    simulation = Simulation(load_scene(NAME, overrides=cad_arm.MODELS[model]))
    simulation.step()
    rest = np.mean(list(simulation.probe_positions().values()), axis=0)
    for pressure in pressures:
        advance(simulation, Command(actuators={"air_1": pressure}))
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
    for model in cad_arm.MODELS:
        simulation, _ = _inflated(model, [25.0 * MBAR * k for k in range(1, 6)])
        grown[model] = simulation.result.actuators["air_1"].extent / CHAMBER
        around[model] = _circumference(simulation.positions)
    assert grown["no hoops"] > 2.0 > 1.7 > grown["hoops"]
    assert around["hoops"] == pytest.approx(1.0, abs=5e-3)
    assert around["no hoops"] > 1.05


@pytest.mark.slow
def test_the_finger_curls_and_the_paper_keeps_its_length() -> None:
    """The angle rises to more than 70 degrees; the base changes its length by 0.1 mm with paper, by more without."""
    with_paper, without = (cad_pneunet.curls(given) for given in cad_pneunet.MODELS.values())
    for found in (with_paper, without):
        assert np.diff(found[:, 0]).min() > 0.0
    assert with_paper[-1, 0] > 70.0
    assert abs(with_paper[-1, 1]) < 0.1 < 1.0 < abs(without[-1, 1])


@pytest.mark.slow
def test_three_commands_from_a_step_file_to_a_moving_picture(tmp_path: Path) -> None:
    """The commands of the tutorial write a scene with a chamber for each hole, and an animation of its run."""
    write_step(Part(), tmp_path / "part.step")
    assert len(timed(COMMANDS, tmp_path)) == 3
    assert [chamber.name for chamber in load_scene(tmp_path / "part.yaml").actuators] == ["air_0", "air_1", "air_2"]
    with Image.open(tmp_path / "part.gif") as film:
        assert film.n_frames == 11
