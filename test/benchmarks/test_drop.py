# SPDX-License-Identifier: Apache-2.0
"""The benchmark of motion: the peers' input, their output, and reports without them."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks import drop, motion
from benchmarks.grids import Grid
from benchmarks.peers import ccx_drop, mujoco_drop
from benchmarks.peers.ccx_deck import CcxElement
from benchmarks.peers.ccx_output import read_blocks
from benchmarks.peers.drop_case import DENSITY, GRAVITY, LAW, SIZE, TIP
from benchmarks.peers.mujoco_model import Drive, write_model
from benchmarks.report import KEPT, read_report
from gdfe_ros.scene import load_scene

DATA = Path(__file__).resolve().parents[1] / "data"
PRINTED = """
 displacements (vx,vy,vz) for set TIP and time  0.1000000E-01

        12  1.000000E+00  0.000000E+00 -2.000000E+00

 displacements (vx,vy,vz) for set TIP and time  0.2000000E-01

        12  2.000000E+00  0.000000E+00 -4.000000E+00
"""


def test_peers_are_given_our_scene() -> None:
    """The peers' data have the size, law, density, gravity and tip of the shipped scene."""
    scene = load_scene("drop")
    low, high = scene.mesh.bounds
    assert high - low == pytest.approx(SIZE)
    rubber = scene.materials["rubber"]
    assert (rubber.young, rubber.poisson, rubber.density) == (LAW.young, LAW.poisson, DENSITY)
    assert scene.loads[0].acceleration == pytest.approx([0.0, 0.0, -GRAVITY])
    assert scene.probes["tip"].at(scene.mesh.vertices)[0] == pytest.approx(TIP)


def test_the_error_of_a_path_is_relative_to_its_reach() -> None:
    """A path shifted by a hundredth of its largest displacement has an error of 1 %, an unshifted one none."""
    kept = np.load(drop.REFERENCE)
    times, tip = kept["t"], kept["tip_centre"]
    assert drop.path_error(times, tip) == pytest.approx(0.0, abs=1e-12)
    reach = np.linalg.norm(tip - tip[0], axis=1).max()
    assert drop.path_error(times, np.add(tip, [0.0, 0.01 * reach, 0.0])) == pytest.approx(0.01)


def test_calculix_gets_a_deck_in_its_units() -> None:
    """The CalculiX deck has tonnes per cubic millimetre, gravity in millimetres, and the given steps."""
    deck = ccx_drop._deck(Grid(size=SIZE, cells=(2, 1, 1), order=1), CcxElement.C3D8I, 0.005)
    assert "*DENSITY\n1e-09\n" in deck
    assert "BODY,GRAV,9810,0.,0.,-1." in deck
    assert "*DYNAMIC\n0.005,1," in deck
    assert "NLGEOM" in deck


def test_paths_are_read_back() -> None:
    """Two blocks of a .dat file are read, and a file without any is refused."""
    times, paths = read_blocks(PRINTED, "displacements")
    assert times.tolist() == [0.01, 0.02]
    assert [path[12] for path in paths] == [(1.0, 0.0, -2.0), (2.0, 0.0, -4.0)]
    with pytest.raises(ValueError, match="no displacements"):
        read_blocks(" forces (fx,fy,fz) for set TIP\n", "displacements")


def test_mujoco_gets_the_mass_of_the_bar() -> None:
    """The masses of MuJoCo's bodies and of the clamped part of the lattice sum to the bar's mass."""
    grid = Grid(size=SIZE, cells=(4, 1, 1))
    text = write_model([LAW], grid, Drive.FREE, timestep=0.01, density=DENSITY, gravity=GRAVITY)
    masses = [float(mass) for mass in re.findall(r'mass="([^"]+)"', text)]
    whole = DENSITY * float(np.prod(SIZE))
    assert sum(masses) == pytest.approx(whole * (1.0 - 0.5 / 4.0))
    assert len(masses) == 4 * 4


@pytest.mark.skipif(mujoco_drop.available() is not None, reason="MuJoCo is not installed")
def test_mujoco_falls_and_stays_whole() -> None:
    """The tip of a coarse quadratic flex swings within a quarter of the reference's depth, and up again."""
    found = mujoco_drop.simulate("quadratic flex", (5, 1, 1), 0.005, timeout=100.0)
    height, lowest = found.path[:, 2], np.load(drop.REFERENCE)["tip_centre"][:, 2].min()
    assert height.min() == pytest.approx(lowest, rel=0.25)
    assert height[height.argmin() :].max() > 0.6 * lowest
    assert found.seconds > 0.0


def test_what_is_missing_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the two peers there is no row, and a reason with a remedy for each."""
    monkeypatch.setattr(mujoco_drop, "available", lambda: "not installed: mujoco; pip install mujoco")
    monkeypatch.setattr(ccx_drop, "available", lambda: "no program ccx; apt-get install calculix-ccx")
    rows, missing = drop.measure_peers()
    assert rows == []
    assert [text.partition(":")[0] for text in missing] == ["MuJoCo", "CalculiX"]
    assert "apt-get install" in missing[1]


def test_the_kept_report_is_what_was_asked_for() -> None:
    """The kept report has small errors, faster runs than MuJoCo's with errors below 20 %."""
    report: dict[str, Any] = read_report(KEPT / "motion.json").data
    ours = [row for row in report["drop"] if row["solver"] == "gdfe_ros"]
    best = {(tuple(row["cells"]), row["step"]): row["error"] for row in reversed(ours) if row["kind"] != "bdf2"}
    assert best[(40, 4, 4), 0.002] <= 0.005
    assert best[(20, 2, 2), 0.01] <= 0.02
    for row in (row for row in report["drop"] if row["solver"] == "MuJoCo" and row["error"] < 0.2):
        faster = 10.0 if row["error"] <= 0.07 else 1.0
        assert any(faster * own["seconds"] < row["seconds"] and own["error"] < row["error"] for own in ours), row
    assert set(motion.all_tables(report)) == {"drop", "beam"}
