# SPDX-License-Identifier: Apache-2.0
"""The bending tube against FElupe with quadratic hexahedra on the same mesh."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.chamber import PRESSURES, SCENE, chamber_table, deviation, follow
from benchmarks.chamber_reference import solve_chamber
from benchmarks.report import read_report
from gdfe_ros import load_scene

DATA = Path(__file__).parents[1] / "data"


def test_tube_agrees_with_quadratic_elements_over_its_whole_program() -> None:
    """The tip is within 2 % of its displacement at every pressure, for bends up to more than 90 degrees."""
    reference, scene = np.load(DATA / "reference" / f"{SCENE}_felupe.npz"), load_scene(SCENE)
    np.testing.assert_array_equal(reference["pressure"], PRESSURES)
    assert max(point.value for point in scene.program.actuators["air"]) == PRESSURES[-1]
    found = follow(scene, PRESSURES, pace=4)
    assert deviation(scene, found.tip, reference["tip"]).max() < 0.02
    assert found.angle[-1] > 90.0
    assert np.diff(found.angle).min() > 0.0


def test_kept_report_is_of_the_kept_reference() -> None:
    """The kept report has the kept reference's figures up to rounding, and the errors that follow from them."""
    report = read_report(DATA / "chamber.json").data
    reference = np.load(DATA / "reference" / f"{SCENE}_felupe.npz")
    np.testing.assert_allclose(report["felupe"], reference["tip"], rtol=0.0, atol=1e-8)
    errors = deviation(load_scene(SCENE), np.array(report["tip"]), np.array(report["felupe"]))
    np.testing.assert_allclose(report["error"], errors, rtol=1e-12)
    assert f"{100 * errors[-1]:.2f} |" in chamber_table(report)


@pytest.mark.slow
def test_felupe_finds_the_kept_reference() -> None:
    """FElupe, run to the first two pressures, gives the kept tips."""
    from pypardiso import spsolve

    reference, scene = np.load(DATA / "reference" / f"{SCENE}_felupe.npz"), load_scene(SCENE)
    tip = solve_chamber(scene, scene.actuators[0], "tip", PRESSURES[:2], solver=spsolve)
    np.testing.assert_allclose(tip, reference["tip"][:2], atol=1e-7)
