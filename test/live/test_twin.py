# SPDX-License-Identifier: Apache-2.0
"""A twin without ROS: its page with both bodies, its table and its bag."""

from __future__ import annotations

import csv
import json
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gdfe_ros.analysis.bag_run import BagRun
from gdfe_ros.cli import main
from gdfe_ros.errors import RecordingError
from gdfe_ros.live.page import Page
from gdfe_ros.live.stage import scale_of
from gdfe_ros.recording.foreign_bag import ForeignBag
from gdfe_ros.scene import scene_from_text
from gdfe_ros.simulation import Simulation
from gdfe_ros.twin.estimator import MeasuredBody
from gdfe_ros.twin.twin import Twin
from test.live.viewer import Viewer, vertices_in
from test.node.test_twin import ARM

AWAY = np.array([0.0, 0.004, 0.003])
"""Measured minus simulated position of the tip [m]."""


@pytest.fixture
def twin(tmp_path: Path) -> Iterator[Callable[..., Twin]]:
    """Give a function that starts a twin, after a page shows it; it records into `tmp_path`, and the test stops it."""
    made: list[Twin] = []

    def start(*, page: Page | None = None, **options: Any) -> Twin:
        files = {"table": tmp_path / "twin.csv", "bag": tmp_path / "twin.mcap"}
        shown = {} if page is None else {"on_view": page.show_view}
        made.append(Twin(Simulation(scene_from_text(ARM)), **files, **shown, **options))
        if page is not None:
            page.show(made[-1].session)
        made[-1].start()
        return made[-1]

    yield start
    for each in made:
        each.stop()


def follow(twin: Twin, tension: float, *, seconds: float = 120.0) -> None:
    """Command a tension [N], wait until the body has moved, and measure the tip `AWAY` from the simulated one."""
    before, end, rests = twin.compared, time.monotonic() + seconds, False
    twin.command({"tendon": tension})
    while twin.compared < before + 3:
        assert time.monotonic() < end, "nothing was compared"
        simulation, rested = twin.session.simulation, rests
        rests = simulation.commands.get("tendon") == tension and simulation.settled
        if rested and rests:  # a step ends before its state is stored
            twin.measure(time.time(), "tip", simulation.probe_positions()["tip"] + AWAY)
        time.sleep(0.05)
        twin.update()


def test_the_measured_body_meets_the_measured_points() -> None:
    """Probes move by their deviations, fixed vertices do not move, and the displacement grows smoothly to the tip."""
    scene = scene_from_text(ARM)
    rest, body = scene.mesh.vertices, MeasuredBody(scene)
    moved = body.at(rest, {"tip": AWAY}) - rest
    assert scene.probes["tip"].at(moved)[0] == pytest.approx(AWAY, abs=1e-9)
    assert np.abs(moved[rest[:, 0] == 0.0]).max() == 0.0
    planes = [np.linalg.norm(moved[np.isclose(rest[:, 0], x)].mean(axis=0)) for x in np.linspace(0.0, 0.12, 13)]
    assert (np.diff(planes) > 0.0).all()
    assert np.diff(planes).max() < 0.2 * planes[-1]
    both = body.at(rest, {"tip": AWAY, "middle": -AWAY}) - rest
    assert scene.probes["middle"].at(both)[0] == pytest.approx(-AWAY, abs=1e-9)
    assert scene.probes["tip"].at(both)[0] == pytest.approx(AWAY, abs=1e-9)


def test_a_body_without_a_fixed_handle_moves_as_a_whole() -> None:
    """With one measured probe and no fixed vertices, the smoothest displacement is a translation."""
    scene = scene_from_text(ARM.replace("fixed: true", "free: []"))
    rest = scene.mesh.vertices
    moved = MeasuredBody(scene).at(rest, {"tip": AWAY}) - rest
    assert moved == pytest.approx(np.broadcast_to(AWAY, rest.shape), abs=1e-6)


def test_the_page_shows_both_bodies_and_the_distance(twin: Callable[..., Twin]) -> None:
    """A viewer gets a second body whose end is at the measured point, and a label with the distance."""
    page = Page(host="127.0.0.1", port=8700, frames=30.0)
    try:
        pair = twin(page=page)
        follow(pair, 1.0)
        body, latest = MeasuredBody(pair.session.scene), pair.latest["tip"]
        for _ in range(3):
            page.compare(
                {"tip": (latest.measured, latest.simulated)},
                lambda positions: body.at(positions, {"tip": latest.measured - latest.simulated}),
            )
        with Viewer(page.address()) as viewer:
            viewer.wait(lambda: "/robot/body/0" in viewer.nodes and "/robot/tip" in viewer.nodes, "the robot")
            drawn = vertices_in(viewer.nodes["/robot/body/0"]["glb_data"])
            places = drawn / scale_of(pair.session.scene.mesh)
            assert np.linalg.norm(places - latest.measured, axis=1).min() < 1e-3
            assert viewer.nodes["/robot/tip"]["text"] == "tip: 5.00 mm"
    finally:
        page.close()


def test_table_and_bag_have_every_comparison(twin: Callable[..., Twin], tmp_path: Path) -> None:
    """The table has distance and spread; the bag has the body, both positions and the moduli, on the robot's clock."""
    texts: list[str] = []
    pair = twin(moduli=["soft"], noise=1.0, warn=texts.append)  # so inexact that the modulus stays
    began = time.time()
    follow(pair, 0.5)
    follow(pair, 1.0)
    pair.stop()
    assert any("twin.mcap" in text and " 0 dropped" in text for text in texts), texts
    assert not (tmp_path / "twin.mcap.part").exists()
    rows = list(csv.DictReader((tmp_path / "twin.csv").open(encoding="utf-8")))
    assert len(rows) == pair.compared
    assert all(float(row["distance [m]"]) == pytest.approx(0.005, rel=0.3) for row in rows)
    assert all(0.0 <= float(row["spread [m]"]) < 0.125 for row in rows)  # the tip's way is 123 mm
    assert any(float(row["spread [m]"]) > 1e-4 for row in rows)
    bag = ForeignBag(tmp_path / "twin.mcap")
    decode, messages = bag.decoder(), list(bag.messages())
    assert all(began - 1.0 < 1e-9 * message.log_time < time.time() for message in messages)
    counts = Counter(message.topic.removeprefix("/gdfe_twin/") for message in messages)
    assert counts["measured/tip"] == counts["compared/tip"] == pair.compared
    assert counts["mesh"] == counts["joint_states"] >= 2
    points = {
        kind: [decode(each.type, each.data).point for each in messages if each.topic == f"/gdfe_twin/{kind}/tip"]
        for kind in ("measured", "compared")
    }
    for row, measured, compared in zip(rows, points["measured"], points["compared"], strict=True):
        assert [measured.x, compared.z] == pytest.approx([float(row["measured x [m]"]), float(row["simulated z [m]"])])
    with pytest.raises(RecordingError, match="was recorded by gdfe twin, whose moduli change"):
        BagRun(tmp_path / "twin.mcap")
    moduli = [json.loads(decode(each.type, each.data).data) for each in messages if each.topic == "/gdfe_twin/moduli"]
    assert [f"{each['soft']:.6g}" for each in (moduli[0], moduli[-1])] == [rows[0]["soft [Pa]"], rows[-1]["soft [Pa]"]]


def test_a_file_that_exists_is_not_overwritten(tmp_path: Path) -> None:
    """An existing bag or table is named, and other endings are refused."""
    (tmp_path / "twin.mcap").touch()
    with pytest.raises(RecordingError, match=r"twin\.mcap exists"):
        Twin(Simulation(scene_from_text(ARM)), bag=tmp_path / "twin.mcap")


@pytest.mark.parametrize(
    ("names", "text"),
    [
        (["twin.bag"], "allowed: names that end with .csv or .mcap"),
        (["a.csv", "b.csv"], "several .csv files"),
        (["there.csv"], "there.csv exists"),
    ],
)
def test_wrong_files_are_refused(
    names: list[str], text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """`gdfe twin --record` names a wrong ending, a second file of a kind, and a file that exists."""
    (tmp_path / "there.csv").touch()
    files = [str(tmp_path / name) for name in names]
    assert main(["twin", "arm.yaml", "--topics", "tip=/camera/tip", "--port", "0", "--record", *files]) != 0
    assert text in capsys.readouterr().err
