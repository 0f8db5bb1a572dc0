# SPDX-License-Identifier: Apache-2.0
"""Workspaces: all points that a probe reaches."""

from __future__ import annotations

import csv
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gdfe_ros.analysis.workers import connect
from gdfe_ros.analysis.workspace import command_samples, find_workspace
from gdfe_ros.cli import main
from gdfe_ros.scene import scene_from_text
from gdfe_ros.simulation import Command, Simulation

TENDONS = """\
name: tendons
mesh: {bar: {size: [0.1, 0.02, 0.02], cells: [5, 1, 1]}}
materials: {rubber: {law: neo_hookean, young: 2.0e5, poisson: 0.45}}
regions: [{material: rubber}]
handles: {base: {where: {face: x-}, fixed: true}}
actuators:
  upper: {cable: {points: [[0, 0, 0.01], [0.1, 0, 0.01]], command: tension, range: [0.0, 0.6]}}
  lower: {cable: {points: [[0, 0, -0.01], [0.1, 0, -0.01]], command: tension, range: [0.0, 0.6]}}
  side: {cable: {points: [[0, 0.01, 0], [0.1, 0.01, 0]], command: tension}}
probes: {tip: [0.1, 0, 0]}
"""


def test_samples_fill_their_ranges() -> None:
    """Samples for one, two and three actuators are distinct, fill the ranges and include their ends."""
    for limits in ([[0.0, 2.0]], [[0.0, 2.0], [-1.0, 1.0]], [[0.0, 2.0], [-1.0, 1.0], [5.0, 6.0]]):
        bounds = np.array(limits)
        found = command_samples(bounds, 40)
        assert 30 <= len(found) <= 49
        assert len(np.unique(found, axis=0)) == len(found)
        np.testing.assert_allclose([found.min(axis=0), found.max(axis=0)], bounds.T)


def test_many_actuators_all_move() -> None:
    """With more corners than commands, every command of nine actuators still covers its range."""
    found = command_samples(np.array([[0.0, 1.0]] * 9), 200)
    assert len(found) == 200
    assert found.min(axis=0).max() < 0.05
    assert found.max(axis=0).min() > 0.95


def test_points_are_equilibria() -> None:
    """Each point of a workspace is that of a simulation from the undeformed state, within the tolerance."""
    scene = scene_from_text(TENDONS)
    commands = np.array([[0.0, 0.0], [0.6, 0.0], [0.0, 0.6], [0.3, 0.3]])
    found = find_workspace(scene, "tip", ["upper", "lower"], commands)
    for command, point in zip(commands, found.points, strict=True):
        simulation = Simulation(scene)
        simulation.step(Command(actuators=dict(zip(("upper", "lower"), map(float, command), strict=True))))
        np.testing.assert_allclose(point, simulation.probe_positions()["tip"], atol=3e-4 * scene.mesh.size)
    np.testing.assert_allclose(found.points[1, 2], -found.points[2, 2], atol=3e-4 * scene.mesh.size)
    assert found.volume == 0.0


@pytest.mark.exact("the processes that it starts shift nothing")
def test_workers_find_what_one_process_finds(kill_one: Callable) -> None:
    """Two workers, one of which is killed at work, give the points of this process to the last bit."""
    scene = scene_from_text(TENDONS)
    commands = command_samples(np.array([[0.0, 0.6], [0.0, 0.6]]), 60)
    here = find_workspace(scene, "tip", ["upper", "lower"], commands)
    with connect(None, 2) as client:
        kill_one(client)
        there = find_workspace(scene, "tip", ["upper", "lower"], commands, client=client)
    np.testing.assert_array_equal(here.points, there.points)
    assert here.reached.all()


def test_the_command_uses_a_scheduler(tmp_path: Path) -> None:
    """With the address of a scheduler, the workers of this scheduler compute the points."""
    scene, out = tmp_path / "tendons.yaml", tmp_path / "out"
    scene.write_text(TENDONS)
    with connect(None, 1) as client:
        given = ["--actuators", "upper", "--count", "4", "--scheduler", client.scheduler.address, "--out", str(out)]
        assert main(["workspace", str(scene), *given]) == 0
        assert all(client.run(lambda: "gdfe_ros.analysis.workspace" in sys.modules).values())
    assert len((out / "workspace.csv").read_text().splitlines()) == 5


def test_the_command_writes_table_and_picture(tmp_path: Path, capsys: Any) -> None:
    """The workspace of three tendons has a row for each command, a volume and a picture."""
    scene, out = tmp_path / "tendons.yaml", tmp_path / "out"
    scene.write_text(TENDONS)
    given = ["--range", "side=0..0.5", "--count", "20", "--workers", "1", "--out", str(out)]
    assert main(["workspace", str(scene), *given]) == 0
    rows = list(csv.DictReader((out / "workspace.csv").read_text().splitlines()))
    assert len(rows) == 20
    assert set(rows[0]) == {*(f"command.{n}" for n in ("upper", "lower", "side")), "x [m]", "y [m]", "z [m]", "message"}
    assert (out / "workspace.png").stat().st_size > 20_000
    printed = capsys.readouterr().out
    assert "volume of the convex hull" in printed
    assert "none: a line" not in printed
    assert "farthest from rest [m]" in printed


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (["--probe", "top"], "no probe 'top' in scene 'tendons'; probes: tip"),
        (["--actuators", "upper", "front"], "no actuator 'front'"),
        (
            [],
            "actuator 'side' has the range 0 to inf, which must be finite; remedy: `range` in the scene, or --range "
            "side=LOW..HIGH",
        ),
        (["--range", "side=1"], "--range takes NAME=LOW..HIGH"),
        (["--range", "upper=-1..1", "--actuators", "upper"], "allowed: from 0 to 0.6"),
        (["--count", "1"], "allowed: 2 or more"),
        (["--actuators", "upper", "upper"], "--actuators names upper twice"),
        (["--range", "side=0..0.4", "--range", "side=0..0.5"], "--range names side twice"),
        (["--range", "side=0..0.5", "--actuators", "upper"], "--range side: this actuator keeps its neutral command"),
    ],
)
def test_what_cannot_be_is_refused(given: list[str], message: str, tmp_path: Path, capsys: Any) -> None:
    """An unknown probe, actuator or range gives one message and exit status 2, and nothing is written."""
    scene, out = tmp_path / "tendons.yaml", tmp_path / "out"
    scene.write_text(TENDONS)
    options = ["--range", "side=0..0.5"] if "--probe" in given else []
    assert main(["workspace", str(scene), *given, *options, "--workers", "1", "--out", str(out)]) == 2
    assert message in capsys.readouterr().err
    assert not out.exists()
