# SPDX-License-Identifier: Apache-2.0
"""Scenes fitted to recordings of themselves: known parameters are found, undetermined ones reported."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from selenium.webdriver.support.ui import WebDriverWait

from docs.scripts.chromium import PATIENCE, start
from gdfe_ros.cli import main
from gdfe_ros.fitting.match import CompareModel, match_observable
from gdfe_ros.fitting.statistics import percent
from gdfe_ros.scene import load_scene
from gdfe_ros.scene.report import unit_of
from test.fitting.conftest import PULLED, SWINGING

YOUNG, VISCOSITY = "materials.rubber.young", "dynamics.damping.viscosity"
VARY = ("--vary", f"{YOUNG}=5e4..8e5")


@pytest.fixture
def fit(write_scene: Callable, write_table: Callable, tmp_path: Path, capsys: Any) -> Callable[..., SimpleNamespace]:
    """Give a function that fits a scene to recordings, and returns the folder, the found values and what was printed.

    By default it fits the modulus of the bar to one table.
    """

    def run(*given: object, data: Sequence[Path] = (), match: str = "", text: str = PULLED) -> SimpleNamespace:
        out, words = tmp_path / "out", list(given) if "--vary" in given else [*VARY, *given]
        if match:
            (tmp_path / "match.yaml").write_text(match)
            words += ["--match", tmp_path / "match.yaml"]
        words = [write_scene(text), *(data or [write_table()]), *words, "--workers", "1", "--out", out]
        status = main(["fit", *map(str, words)])
        parameters = json.loads((out / "fit.json").read_text())["parameters"]
        values = {name: found["value"] for name, found in parameters.items()}
        return SimpleNamespace(out=out, status=status, values=values, printed=" ".join(capsys.readouterr().out.split()))

    return run


def test_a_modulus_comes_back_from_a_table(fit: Callable) -> None:
    """From equilibria with 1 % noise: modulus within 1 %, true value in its interval, and all files are written."""
    run = fit("--vary", f"{YOUNG}=3e4..4e4..2e6")
    out, found = run.out, json.loads((run.out / "fit.json").read_text())["parameters"][YOUNG]
    assert run.status == 0
    assert found["value"] == pytest.approx(2e5, rel=0.01)
    assert found["low"] < 2e5 < found["high"]
    assert load_scene(out / "scene.yaml").materials["rubber"].young == pytest.approx(found["value"])
    assert (out / "fit.png").stat().st_size > 20_000
    page = (out / "fit.html").read_text(encoding="utf-8")
    assert "Plotly.newPlot" in page
    assert "do not include the error of the mesh" in page
    assert '"text":"time [s]"' in page
    assert '"text":"tip.z [m]"' in page
    assert '"text":"residual [m]"' in page
    assert re.search(r"<td>[\d.]+ Pa</td>", page)
    assert len((out / "residuals.csv").read_text().splitlines()) == 1 + 3 * 30
    assert "warning" not in run.printed
    assert re.search(r"\d Pa .*\d m ", run.printed)
    _require_whole_charts(out / "fit.html")


def _require_whole_charts(page: Path) -> None:
    """Open a page in Chromium: no chart is wider than its section, and the title of the time axis is below its rows."""
    chrome = start((1300, 1400))
    try:
        chrome.get(page.as_uri())
        WebDriverWait(chrome, PATIENCE).until(lambda found: found.execute_script("return document.body.dataset.ready"))
        boxes = chrome.execute_script(
            "const right = (found) => found.getBoundingClientRect().right,"
            "      bottom = (found) => found.getBoundingClientRect().bottom;"
            "return [...document.querySelectorAll('.chart')].map((chart) => ["
            "  right(chart), Math.max(...[...chart.querySelectorAll('svg')].map(right)),"
            "  chart.querySelector('.xtitle').getBoundingClientRect().top,"
            "  Math.max(...[...chart.querySelectorAll('.xtick, .ytick, .y2tick')].map(bottom))])"
        )
        assert len(boxes) >= 2
        for edge, drawn, title, ticks in boxes:
            assert drawn <= edge + 1.0
            assert title >= ticks - 1.0
    finally:
        chrome.quit()


def test_a_modulus_comes_back_from_our_own_bag(fit: Callable, record_bag: Callable) -> None:
    """The modulus of a node's bag with 1 % noise is found within 1 %, with its commands replayed."""
    found = fit(data=[record_bag()])
    assert (found.status, found.values[YOUNG]) == (0, pytest.approx(2e5, rel=0.01))


def test_modulus_and_damping_come_back_from_a_swing(fit: Callable, write_table: Callable) -> None:
    """In a swing with 1 % noise, the modulus is found within 1 % and the viscosity within 5 %.

    The fit starts from a modulus that swings 1.6 times too fast.
    """
    given = ("--vary", f"{YOUNG}=5e4..5e5..1e6", "--vary", f"{VISCOSITY}=20..100..5e3")
    found = fit(*given, data=[write_table(SWINGING, count=100)], text=SWINGING)
    assert (found.status, found.values[YOUNG]) == (0, pytest.approx(2e5, rel=0.01))
    assert found.values[VISCOSITY] == pytest.approx(300.0, rel=0.05)


def test_time_shift_and_frame_come_back(fit: Callable, write_table: Callable, tmp_path: Path) -> None:
    """A clock 23 ms ahead, a frame rotated by 90 degrees and shifted, and the modulus are found."""
    table = np.genfromtxt(write_table(SWINGING, count=100, noise=0.001), delimiter=",", skip_header=1)
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    rows = np.column_stack([table[:, 0] + 0.023, 1e-3 * table[:, 2:] @ turn.T + [0.3, -0.2, 0.1]])
    np.savetxt(tmp_path / "lab.csv", rows, delimiter=",", header="clock,a,b,c", comments="")
    match = "time: clock\nshift_between: [-0.1, 0.1]\nframe: {fit: pose}\n"
    match += "compare: {tip: {probe: tip, columns: {x: a, y: b, z: c}}}\n"
    found = fit("--vary", f"{YOUNG}=1e5..4e5", data=[tmp_path / "lab.csv"], match=match, text=SWINGING)
    assert (found.status, found.values[YOUNG]) == (0, pytest.approx(2e5, rel=0.01))
    shift = re.search(r"lab: time shift ([\d.]+) ms", found.printed)
    assert float(shift[1]) == pytest.approx(23.0, abs=0.5)


def test_a_held_out_recording_is_predicted(fit: Callable, write_table: Callable) -> None:
    """A held-out recording of a softer body is predicted and reported, and does not affect the fit."""
    data = [write_table(name="good"), write_table(PULLED.replace("2.0e5", "1.2e5"), name="soft", seed=3)]
    found = fit("--holdout", "soft", data=data)
    assert (found.status, found.values[YOUNG]) == (0, pytest.approx(2e5, rel=0.01))
    assert "soft, tip: held out and predicted to" in found.printed
    assert "predicted" in (found.out / "fit.html").read_text(encoding="utf-8")


def test_a_model_that_explains_nothing_is_told(fit: Callable) -> None:
    """A column with the wrong sign is fitted as well as it can be, and a warning names units, signs and columns."""
    found = fit(match="compare: {tip: {probe: tip, column: tip.z, along: [0, 0, -1], unit: mm, displacement: true}}\n")
    assert found.status == 0
    assert re.search(r"the misfit is [1-9]\d\d? % of the motion", found.printed)
    assert "check units, signs and columns" in found.printed


@pytest.mark.parametrize(
    ("fraction", "text"), [(0.0123, "1.2 %"), (0.14, "14 %"), (0.996, "99.6 %"), (1.0, "100 %"), (12.3456, "1235 %")]
)
def test_percentages_have_no_exponent(fraction: float, text: str) -> None:
    """Fractions from small to large are percentages in plain digits."""
    assert percent(fraction) == text


def test_parameters_have_the_unit_of_their_key() -> None:
    """Keys of materials, lists, dynamics and names without a unit have the unit of the scene's schema."""
    keys = (YOUNG, "mesh.bar.size.0", "dynamics.damping.viscosity", "materials.rubber.poisson", "nothing.there")
    assert [unit_of(key) for key in keys] == ["Pa", "m", "Pa s", "", ""]


def test_structure_is_told(fit: Callable, write_table: Callable) -> None:
    """A linear law fitted to a neo-Hookean body under large loads gives structured residuals and a warning."""
    text = PULLED.replace("[0, 0, -0.05]", "[0.3, 0, -0.05]")
    found = fit(data=[write_table(text, noise=1e-4, most=20.0)], text=text.replace("neo_hookean", "linear"))
    assert found.status == 0
    assert "residuals are structured" in found.printed


def test_what_the_data_do_not_tell_apart_is_told(fit: Callable) -> None:
    """Modulus and load, of which displacements determine only the ratio, are reported by name."""
    printed = fit(*VARY, "--vary", "loads.pull.point.force.2=-0.2..-0.01").printed
    assert "determine" in printed
    assert YOUNG in printed.partition("the data")[2]


def test_a_robust_loss_forgives_outliers(fit: Callable, write_table: Callable) -> None:
    """With every seventh row wrong, a robust loss finds the modulus, and least squares does not."""
    data = write_table(noise=0.002)
    lines = data.read_text().splitlines()
    for row in range(3, len(lines), 7):
        cells = lines[row].split(",")
        lines[row] = ",".join([*cells[:4], str(float(cells[4]) - 15.0)])
    data.write_text("\n".join(lines) + "\n")
    linear, cauchy = (fit("--loss", loss, data=[data]) for loss in ("linear", "cauchy"))
    assert linear.status == cauchy.status == 0
    assert abs(cauchy.values[YOUNG] / 2e5 - 1.0) < 0.01 < abs(linear.values[YOUNG] / 2e5 - 1.0)


def test_pressures_and_volumes_have_units_of_their_own() -> None:
    """Efforts and extents of cables and chambers are weighted apart: N, m, Pa and m^3."""
    scene = load_scene("pneunet")
    chamber = next(iter(scene.actuators)).name
    units = [match_observable(CompareModel(**{key: chamber}), scene, "here").unit for key in ("effort", "extent")]
    assert units == ["Pa", "m^3"]
    finger = load_scene("tendon_finger")
    units = [match_observable(CompareModel(**{key: "flexor"}), finger, "here").unit for key in ("effort", "extent")]
    assert units == ["N", "m"]
