# SPDX-License-Identifier: Apache-2.0
"""The benchmark of contact: its kept report, MuJoCo's model, and missing peers."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from typing import Any

import numpy as np
import pytest

from benchmarks import contact
from benchmarks.cases import LogNeoHooke
from benchmarks.contact import all_tables
from benchmarks.peers import ccx_contact, grip_case, mujoco_grip
from benchmarks.report import KEPT, read_report
from gdfe_ros.scene.loader import scene_from_text


@pytest.fixture(scope="module")
def report() -> dict[str, Any]:
    """Return the kept report."""
    return read_report(KEPT / "contact.json").data


def test_the_kept_report_is_what_was_asked_for(report: dict[str, Any]) -> None:
    """A grip drifts by less than 1 um in 60 s and falls below the least friction."""
    held, lost = (row for row in report["grip"] if row["solver"] == "gdfe_ros")
    assert (held["demand"], held["held"], lost["demand"]) == (1.02, 60.0, 0.98)
    assert abs(held["drift"]) < 1e-6
    assert lost["drift"] > 0.1
    assert set(all_tables(report)) == {"grip", "pressing"}


def test_the_kept_forces_are_those_of_calculix(report: dict[str, Any]) -> None:
    """In a report measured with CalculiX, forces on cubes agree with CalculiX."""
    peer = report["calculix"]
    if "missing" in peer:
        pytest.skip(f"measured without CalculiX: {peer['missing']}")
    faces = [row["force"] for row in report["cube"]["16 faces"] if row["move"] > 0.005]
    assert faces == pytest.approx(peer["cube"][2:], rel=0.015)


def test_mujoco_is_given_our_grip() -> None:
    """MuJoCo's model has the lattice, law, masses and friction of our scene."""
    scene = scene_from_text(contact.GRIP)
    soft, box = scene.materials["soft"], scene.handles[-1]
    assert (soft.young, soft.poisson, soft.density) == (grip_case.YOUNG, grip_case.POISSON, grip_case.DENSITY)
    assert scene.mesh.n_cells == 2 * np.prod(grip_case.CELLS)
    assert box.mass * grip_case.GRAVITY == pytest.approx(grip_case.WEIGHT)
    assert (box.form.size, scene.dynamics.step) == (grip_case.BOX, grip_case.STEP)
    model = ElementTree.fromstring(mujoco_grip.model_text(0.25))
    places = scene.mesh.vertices
    for pad in model.iter("flexcomp"):
        assert float(pad.get("mass")) == pytest.approx(soft.density * np.prod(grip_case.PAD))
        spacing = np.array(pad.get("spacing").split(), dtype=float)
        np.testing.assert_allclose(spacing, [np.diff(np.unique(axis.round(9))).min() for axis in places.T])
    assert all(each.get("friction").startswith("0.25 ") for each in [*model.iter("contact"), *model.iter("geom")])


@pytest.mark.skipif(mujoco_grip.available() is not None, reason="MuJoCo is not installed")
def test_mujoco_holds_with_ample_friction() -> None:
    """MuJoCo's box, at ten times the least friction, hangs between the pads within a millimetre."""
    found = mujoco_grip.simulate(10.0, seconds=0.1)
    assert 5.0 < found["press"] < 10.0
    assert abs(found["sunk"]) < 1e-3
    assert abs(found["drift"]) < 1e-3


@pytest.mark.skipif(ccx_contact.available() is not None, reason="CalculiX is not installed")
def test_calculix_presses_as_we_do() -> None:
    """With few quadratic elements in CalculiX and many of ours, the cube's force agrees in 3 %."""
    ours = {row["move"]: row["force"] for row in contact.press_cube(8, "faces")}
    law = LogNeoHooke(young=2.0e5, poisson=0.45)
    assert ccx_contact.press_cube(law, 4, [0.01]) == pytest.approx([ours[0.01]], rel=0.03)


def test_without_calculix_its_columns_are_empty(report: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    """Without CalculiX the other columns stay, and the remedy is printed below the tables."""
    monkeypatch.setattr(ccx_contact, "available", lambda: "no program ccx; install it")
    table = all_tables({**report, "calculix": contact.press_by_calculix()})["pressing"]
    assert table.endswith("CalculiX: no program ccx; install it")
    assert all(" - |" in line for line in table.splitlines()[2:-2])


def test_what_is_missing_is_told(report: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    """Without MuJoCo our rows are printed alone, with the remedy below the table."""
    monkeypatch.setattr(mujoco_grip, "available", lambda: "not installed: mujoco; pip install mujoco")
    monkeypatch.setattr(contact, "HELD", {1.02: 0.0})
    found = contact.measure_grips()
    assert [row["solver"] for row in found["grip"]] == ["gdfe_ros"]
    assert all_tables({**report, **found})["grip"].endswith("MuJoCo: not installed: mujoco; pip install mujoco")
