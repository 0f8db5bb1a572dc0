# SPDX-License-Identifier: Apache-2.0
"""The report: its content, and its behaviour in a real browser."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from PIL import Image
from selenium import webdriver
from selenium.common.exceptions import TimeoutException
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import Select, WebDriverWait

from docs.scripts.chromium import PATIENCE, start
from gdfe_ros.analysis.bag_run import BagRun
from gdfe_ros.analysis.report import pictures
from gdfe_ros.analysis.report.history import StrainHistogram
from gdfe_ros.analysis.report.pictures import write_png
from gdfe_ros.analysis.report.report_writer import write_report
from gdfe_ros.analysis.scenery import face_values
from gdfe_ros.cli import main
from gdfe_ros.colour_map import NOISE
from gdfe_ros.constraints import Pose
from gdfe_ros.scene import Scene, load_scene
from test.analysis.conftest import last_positions

ARTEFACTS = Path(__file__).parents[2] / ".ci" / "artefacts"
CHARTS = {
    "Position of tip, from rest",
    "Reaction forces",
    "Equivalent strain over time",
    "Solver iterations",
    "Error estimate over the body's size",
    "Solve time",
}


@pytest.fixture
def browser() -> Iterator[webdriver.Chrome]:
    """Give a headless Chromium without a network that keeps its console messages."""
    chrome = start((1400, 1500))
    yield chrome
    chrome.quit()


def _open(browser: webdriver.Chrome, page: Path) -> None:
    browser.get(page.as_uri())
    ready = "return document.body && document.body.dataset.ready"
    wait = WebDriverWait(browser, PATIENCE, ignored_exceptions=[TimeoutException])
    wait.until(lambda chrome: chrome.execute_script(ready))


def _drawn(browser: webdriver.Chrome, axis: str) -> np.ndarray:
    """Return the coordinates that plotly draws now, one number per surface vertex."""
    return np.array(browser.execute_script(f"return Array.from(document.getElementById('mesh').data[0].{axis})"))


def _body(browser: webdriver.Chrome) -> dict[str, str]:
    return browser.execute_script("return Object.assign({}, document.body.dataset)")


def _intensity(browser: webdriver.Chrome) -> list[float]:
    return browser.execute_script("return Array.from(document.getElementById('mesh').data[0].intensity)")


def _picture(browser: webdriver.Chrome, name: str) -> np.ndarray:
    """Save a screenshot of the window, and return the part of it that shows the mesh."""
    ARTEFACTS.mkdir(parents=True, exist_ok=True)
    browser.save_screenshot(str(ARTEFACTS / name))
    return np.asarray(Image.open(ARTEFACTS / name).convert("RGB"), dtype=float)[150:650]


def _slide(browser: webdriver.Chrome, frame: int) -> None:
    script = "const s = document.getElementById('time'); s.value = arguments[0]; s.dispatchEvent(new Event('input'))"
    browser.execute_script(script, frame)
    WebDriverWait(browser, PATIENCE).until(
        lambda c: c.find_element(By.TAG_NAME, "body").get_attribute("data-frame") == str(frame)
    )


def test_the_report_works_in_a_browser(
    browser: webdriver.Chrome, make_bag: Callable[..., Path], tmp_path: Path
) -> None:
    """The page opens offline without console errors; the slider moves the mesh, the list changes its colours."""
    bag, page = make_bag(mesh__bar__cells=[20, 2, 2]), tmp_path / "report.html"
    write_report(bag, page)
    _open(browser, page)
    surface = np.unique(BagRun(bag).scene.mesh.surface())
    shown = _drawn(browser, "z")
    np.testing.assert_allclose(shown, last_positions(BagRun(bag))[surface, 2], atol=0.3 / 65535)
    last = _picture(browser, "report_last.png")
    _slide(browser, 0)
    np.testing.assert_allclose(_drawn(browser, "z"), BagRun(bag).scene.mesh.vertices[surface, 2], atol=0.3 / 65535)
    # The numbers are there at once, the picture when the browser has painted it.
    WebDriverWait(browser, PATIENCE).until(
        lambda chrome: np.abs(last - _picture(chrome, "report_first.png")).mean() > 1.0
    )
    _slide(browser, 5)
    before = _intensity(browser)
    Select(browser.find_element(By.ID, "field")).select_by_visible_text("energy density [J/m^3]")
    assert max(_intensity(browser)) > 100 * max(before)
    headings = [heading.text for heading in browser.find_elements(By.CSS_SELECTOR, "#charts h2")]
    assert set(headings) >= CHARTS
    script = "return [...document.querySelectorAll('.chart')].filter(c => c.querySelector('svg.main-svg')).length"
    assert browser.execute_script(script) == len(headings)
    assert [entry for entry in browser.get_log("browser") if entry["level"] == "SEVERE"] == []
    fetched = browser.execute_script("return performance.getEntriesByType('resource').map(e => e.name)")
    assert [name for name in fetched if not name.startswith("data:")] == []


def test_a_failed_step_is_marked(
    browser: webdriver.Chrome, make_bag: Callable[..., Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The page and the pictures mark a step that did not converge, and no other."""
    bag, page, titles = make_bag(solver__max_iterations=1, heights=[0.0, 0.1]), tmp_path / "report.html", []
    assert [record.converged for record in BagRun(bag).records] == [True, False]
    write_report(bag, page)
    _open(browser, page)
    for frame, failed in ((0, False), (1, True)):
        _slide(browser, frame)
        assert ("not converged" in browser.find_element(By.ID, "moment").text) is failed
    draw = pictures.draw_body
    monkeypatch.setattr(
        pictures, "draw_body", lambda *given, **named: [titles.append(named["title"]), draw(*given, **named)]
    )
    write_png(bag, tmp_path / "most.png")
    list(pictures.draw_steps(bag, frames=2))
    assert [title.endswith(", not converged") for title in titles] == [True, False, True]


def test_the_report_shows_the_skin(browser: webdriver.Chrome, maker: Any, rod: Scene, tmp_path: Path) -> None:
    """For a rod of voxels with a skin, the page draws the skin's points, coloured smoothly, without edges."""
    bag = maker(tmp_path / "bag", rod)
    for height in (0.0, 0.005, 0.01):
        bag.step({"tip": Pose(translation=(0.0, 0.0, height))})
    outside = bag.scene.mesh.outside
    assert outside.skin
    write_report(bag.close(), tmp_path / "report.html")
    _open(browser, tmp_path / "report.html")
    positions = np.stack([_drawn(browser, axis) for axis in "xyz"], axis=1)
    np.testing.assert_allclose(positions, outside.at(bag.simulation.positions), atol=0.1 / 65535)
    assert len(_intensity(browser)) == len(outside.faces)
    strain = face_values(bag.scene.mesh, bag.simulation.fields().eps_eq)
    np.testing.assert_allclose(_intensity(browser), strain, atol=2.0 * strain.max() / 65535)
    _picture(browser, "report_skin.png")
    assert not browser.find_element(By.ID, "edges").is_selected()
    browser.find_element(By.ID, "edges").click()
    lines = "return document.getElementById('mesh').data[1].x.length"
    WebDriverWait(browser, PATIENCE).until(lambda chrome: chrome.execute_script(lines) == 5 * len(outside.faces))
    assert [entry for entry in browser.get_log("browser") if entry["level"] == "SEVERE"] == []


def _animation(page: Path) -> dict[str, Any]:
    """Return the animation data in a page."""
    return _data(page, "animation")


def _data(page: Path, name: str) -> Any:
    """Return data in a page by their name."""
    text = page.read_text(encoding="utf-8")
    return json.loads(re.search(rf'<script type="application/json" id="{name}">(.*?)</script>', text)[1])


def test_every_axis_has_its_quantity_and_unit(make_bag: Callable[..., Path], tmp_path: Path) -> None:
    """Each vertical axis names a quantity, with a unit or as a number for each step, and no title ends in a colon.

    A chart of one line, which has no legend, has the line's name in its title or at its axis.
    """
    write_report(make_bag(), tmp_path / "report.html")
    charts = _data(tmp_path / "report.html", "chart-data")
    assert {"Reaction forces", "Strain energy"} <= {chart["title"] for chart in charts}
    lines = [chart for chart in charts if len(chart["data"]) == 1 and "name" in chart["data"][0]]
    assert lines
    for chart in charts:
        label = chart["layout"]["yaxis"]["title"]["text"]
        assert re.search(r"[a-z].* (\[[^\]]+\]|a step)$|^equivalent strain$", label), (chart["title"], label)
        assert not chart["title"].rstrip().endswith(":")
        assert chart not in lines or chart["data"][0]["name"] in f"{chart['title']} {label}"


def test_joints_have_charts_with_their_units(maker: Any, tmp_path: Path) -> None:
    """A report of a run with an arm has charts of its joints' torques and angles, beside those of the actuators."""
    scene = load_scene("arm_grasp")
    bag = maker(tmp_path / "bag", scene)
    bag.step()
    write_report(bag.close(), tmp_path / "report.html")
    charts = {each["title"]: each for each in _data(tmp_path / "report.html", "chart-data")}
    for title, unit in (("Joints: effort", "N m"), ("Joints: position", "rad")):
        assert {"shoulder_lift", "elbow"} <= {line["name"] for line in charts[title]["data"]}
        assert charts[title]["layout"]["yaxis"]["title"]["text"].endswith(f"[{unit}]")


def test_a_legend_of_two_rows_is_above_the_curves(browser: Any, make_bag: Callable[..., Path], tmp_path: Path) -> None:
    """In a chart with names too long for one row, no part of the legend is below the upper edge of the plot."""
    write_report(make_bag(), tmp_path / "report.html")
    page = tmp_path / "long.html"
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    charts = _data(tmp_path / "report.html", "chart-data")
    line = next(chart for chart in charts if chart["title"] == "Reaction forces")
    line["data"] = [line["data"][0] | {"name": f"a curve with a rather long name, number {k}"} for k in range(4)]
    line["layout"]["showlegend"] = True
    start, end = '<script type="application/json" id="chart-data">', "</script>"
    head, _, rest = text.partition(start)
    page.write_text(head + start + json.dumps([line]) + end + rest.partition(end)[2], encoding="utf-8")
    browser.get(page.as_uri())
    boxes = WebDriverWait(browser, PATIENCE).until(
        lambda chrome: chrome.execute_script(
            "const chart = document.getElementById('chart-0');"
            "const legend = chart && chart.querySelector('.legend'), plot = chart && chart.querySelector('.xy');"
            "if (!legend || !plot || legend.getBoundingClientRect().height < 30) return null;"
            "const parts = [chart, legend, chart.querySelector('.gridlayer')];"
            "const found = parts.map((each) => each.getBoundingClientRect());"
            "return [found[1].bottom, found[2].top, found[0].top, found[1].top]"
        )
    )
    assert boxes[0] <= boxes[1] + 2.0
    assert boxes[3] >= boxes[2]


def test_the_page_opens_on_the_frame_of_most_strain(make_bag: Callable[..., Path], tmp_path: Path) -> None:
    """For a tip that is lifted and lowered, page and picture show the highest lift first."""
    bag, page = make_bag(heights=[0.0, 0.05, 0.1, 0.05, 0.0]), tmp_path / "report.html"
    write_report(bag, page)
    assert _animation(page)["first"] == 2
    there, back = tmp_path / "there.png", tmp_path / "back.png"
    write_png(bag, back)
    write_png(make_bag("up", heights=[0.0, 0.05, 0.1]), there)
    assert np.asarray(Image.open(back)).mean() == pytest.approx(np.asarray(Image.open(there)).mean(), rel=0.05)


def test_strains_that_are_noise_have_one_colour(make_bag: Callable[..., Path], tmp_path: Path) -> None:
    """For a tip lifted by a nanometre, the colour range is wider than rounding errors."""
    write_report(make_bag(heights=[0.0, 1e-9]), tmp_path / "report.html")
    (strain,) = (field for field in _animation(tmp_path / "report.html")["fields"] if field["name"] == "eps_eq")
    assert strain["high"] - strain["low"] == pytest.approx(NOISE)


def test_a_large_run_fits(maker: Any, tmp_path: Path) -> None:
    """A report of 2000 steps of 2142 vertices is smaller than 30 MB and states that steps are left out."""
    bag = maker(tmp_path / "bag", load_scene("bend5", overrides={"mesh.bar.cells": [50, 5, 6]}))
    bag.step({"tip": Pose(translation=(0.0, 0.0, 0.05))})
    bag.repeat(1999)
    facts = write_report(bag.close(), tmp_path / "report.html")
    assert (facts.steps, facts.frames) == (2000, 400)
    assert facts.size < 30e6
    assert "The surface shows 400 of 2000 steps" in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_the_command_writes_page_picture_and_motion(make_bag: Callable[..., Path], tmp_path: Path, capsys: Any) -> None:
    """With all options, the command writes an HTML page, a PNG beside it, and a GIF with the given number of frames."""
    out, gif = tmp_path / "r.html", tmp_path / "r.gif"
    assert main(["report", str(make_bag()), "--out", str(out), "--gif", str(gif), "--frames", "3"]) == 0
    assert "6 steps, 6 frames" in capsys.readouterr().out
    assert Image.open(out.with_suffix(".png")).size == (1350, 750)
    assert Image.open(gif).n_frames == 3
    text = out.read_text(encoding="utf-8")
    assert not re.search(r"<(script|link|img)[^>]*(src|href)=\"http", text)


def test_the_folder_of_a_run_is_as_good_as_its_bag(make_bag: Callable[..., Path], tmp_path: Path) -> None:
    """Given the folder that holds the bag, the command writes page, picture and GIF beside the bag."""
    run = tmp_path / "run"
    run.mkdir()
    make_bag().rename(run / "bag")
    assert main(["report", str(run), "--gif", "--frames", "3"]) == 0
    assert {path.name for path in run.iterdir()} == {"bag", "bag_report.html", "bag_report.png", "bag_report.gif"}
    assert main(["replay", str(run)]) == 0


def test_a_video_has_every_frame(make_bag: Callable[..., Path], tmp_path: Path) -> None:
    """An mp4 of five frames decodes to five pictures of the PNG's size, and the last one shows the bent bar."""
    out, mp4 = tmp_path / "r.html", tmp_path / "r.mp4"
    assert main(["report", str(make_bag()), "--out", str(out), "--mp4", str(mp4), "--frames", "5"]) == 0
    with av.open(str(mp4)) as container:
        frames = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
        assert float(container.duration / av.time_base) == pytest.approx(4.0, abs=0.1)
    assert [frame.shape for frame in frames] == [(750, 1350, 3)] * 5
    assert all(np.ptp(frame) > 200 for frame in frames)
    assert np.abs(frames[0].astype(int) - frames[-1]).mean() > 1.0


def test_a_video_without_its_library_is_refused(
    make_bag: Callable[..., Path], tmp_path: Path, monkeypatch: Any, capsys: Any
) -> None:
    """Without PyAV, a video is refused with the name of the extra, and nothing is written."""
    monkeypatch.setitem(sys.modules, "av", None)
    assert main(["report", str(make_bag()), "--out", str(tmp_path / "r.html"), "--mp4", str(tmp_path / "r.mp4")]) == 2
    assert "gdfe_ros[video]" in capsys.readouterr().err
    assert not (tmp_path / "r.html").exists()


def test_names_cannot_break_the_page(make_bag: Callable[..., Path], tmp_path: Path) -> None:
    """HTML in a scene's description is shown as text."""
    page = tmp_path / "report.html"
    write_report(make_bag(description='"</script><script>alert(1)</script>"'), page)
    text = page.read_text(encoding="utf-8")
    assert "<script>alert(1)" not in text
    assert "&lt;script&gt;alert(1)" in text


def test_the_histogram_counts_every_cell() -> None:
    """The histogram of strains over six orders of magnitude sums to one, with each fraction in the right class."""
    histogram = StrainHistogram(4, columns=2)
    for number, most in enumerate((1e-7, 1e-4, 0.01, 0.5)):
        histogram.add(number, 0.1 * number, np.linspace(0.0, most, 100, dtype=np.float32))
    times, edges, shares = histogram.shares(10)
    assert times.tolist() == pytest.approx([0.1, 0.3])
    assert edges[-1] == pytest.approx(0.5)
    np.testing.assert_allclose(shares.sum(axis=0), 1.0)
    assert shares[0].tolist() == pytest.approx([1.0, 0.55], abs=0.01)


def test_a_page_without_html_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A page whose name does not end with .html, which no browser would open, is refused before the bag is read."""
    assert main(["report", str(tmp_path / "no_bag"), "--out", str(tmp_path / "page")]) == 2
    assert "a page ends with .html" in capsys.readouterr().err
    assert not (tmp_path / "page").exists()
