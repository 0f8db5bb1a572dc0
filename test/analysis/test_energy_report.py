# SPDX-License-Identifier: Apache-2.0
"""Energies in a report: the energy of a moving body against work and dissipated energy."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gdfe_ros.analysis.bag_run import BagRun, BagSteps
from gdfe_ros.analysis.report.charts import all_charts
from gdfe_ros.analysis.report.history import DIFFERENCE, EXPECTED, HAS, RunHistory, StrainHistogram, energy_balance
from gdfe_ros.analysis.report.report_writer import write_report
from gdfe_ros.constraints import Pose
from gdfe_ros.scene import load_scene

TITLES = {"Energies of the motion", "Balance of energy"}
SHAKEN = {"mesh.bar.cells": [10, 1, 1], "dynamics.scheme": "newmark"}
SHAKES, RESET = 40, 20
"""Number of steps, and the step before which the bar is reset."""


@pytest.fixture
def shaken(maker: Any, tmp_path: Path) -> Path:
    """Return the bag of a bar that is shaken by its base, with a reset in between."""
    bag = maker(tmp_path / "bag", load_scene("whip", overrides=SHAKEN))
    bag.step(dt=0.0)
    for number in range(SHAKES):
        if number == RESET:
            bag.reset()
            bag.step(dt=0.0)
        height = 0.005 * (1.0 - np.cos(0.15 * (number % RESET + 1)))
        bag.step({"base": Pose((0.0, 0.0, float(height)))}, dt=0.005)
    return bag.close()


def history_of(path: Path) -> tuple[BagRun, RunHistory]:
    """Return the run of a bag and its history."""
    run = BagRun(path)
    history = RunHistory(StrainHistogram(len(run.records), columns=10))
    for step in BagSteps(run):
        history.add(step)
    return run, history


def test_the_balance_closes_and_begins_anew_after_a_reset(shaken: Path) -> None:
    """A damped shaken bar's energy balance closes to 1 % of its kinetic energy, and restarts after a reset."""
    _, history = history_of(shaken)
    assert history.starts == [0, RESET + 1]
    balance, energy = energy_balance(history), {name: np.array(each) for name, each in history.energies.items()}
    assert balance[HAS] == pytest.approx(energy["kinetic"] + energy["elastic"] + energy["potential"])
    assert balance[DIFFERENCE] == pytest.approx(balance[HAS] - balance[EXPECTED], abs=1e-15)
    assert balance[DIFFERENCE][history.starts] == pytest.approx([0.0, 0.0], abs=0.0)
    assert 0.0 < np.abs(balance[DIFFERENCE]).max() < 0.01 * energy["kinetic"].max()
    assert energy["work"][RESET] > 0.1 * energy["kinetic"].max() > 0.0 == energy["work"][RESET + 1]
    assert energy["dissipated"][-1] > 0.0


def test_a_run_from_a_state_in_motion_counts_from_there(shaken: Path) -> None:
    """In a run without its first steps, the energy balance still closes from the first step that is left."""
    _, history = history_of(shaken)
    cut = RunHistory(
        history.strain, starts=[0], energies={name: each[4:RESET] for name, each in history.energies.items()}
    )
    assert energy_balance(cut)[DIFFERENCE][0] == 0.0
    whole = energy_balance(history)[DIFFERENCE][4:RESET]
    assert energy_balance(cut)[DIFFERENCE] == pytest.approx(whole - whole[0], abs=1e-15)


def test_the_page_tells_energies_of_bodies_in_motion_only(shaken: Path, make_bag: Any, tmp_path: Path) -> None:
    """The report of a moving bar has two more charts and one more row than that of a bar without dynamics."""
    for bag, expected in ((shaken, True), (make_bag("still"), False)):
        run, history = history_of(bag)
        titles = {chart["title"]: chart for chart in all_charts(history, run.scene, dt=0.01)}
        assert TITLES & set(titles) == (TITLES if expected else set())
        write_report(bag, tmp_path / "report.html")
        text = (tmp_path / "report.html").read_text(encoding="utf-8")
        assert bool(re.search(r"% of the largest (kinetic energy|elastic energy|work)\b", text)) is expected
        if expected:
            drawn = {trace["name"]: trace["y"] for trace in titles["Balance of energy"]["data"]}
            assert drawn[HAS] == pytest.approx(energy_balance(history)[HAS], rel=1e-6, abs=1e-12)
            assert len(titles["Energies of the motion"]["data"]) == 5
