# SPDX-License-Identifier: Apache-2.0
"""``gdfe demo``: a program played to the node over topics."""

from __future__ import annotations

import argparse
import re
import time
from datetime import datetime
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from gdfe_ros import Simulation, load_scene
from gdfe_ros.analysis.bag_run import BagRun
from gdfe_ros.analysis.replay import Replay
from gdfe_ros.commands import demo
from gdfe_ros.errors import CommandError, GdfeError, RecordingError
from gdfe_ros.recording import bag_info
from gdfe_ros.testing import NodeProcess
from test.analysis.conftest import last_positions

SCENE = """\
name: bridge
mesh: {bar: {size: [0.2, 0.02, 0.02], cells: [10, 2, 2]}}
materials: {a: {law: linear, young: 1.0e6, poisson: 0.3, density: 1000}}
regions: [{material: a}]
handles:
  base: {where: {face: x-}, free: [ry]}
  tip: {where: {face: x+}, free: [x, ry]}
loads:
  weight: {gravity: [0, 0, -9.81]}
probes: {middle: [0.1, 0, 0]}
program:
  duration: 0.1
  loads:
    weight: [{time: 0, value: 0}, {time: 0.1, value: 0.5}]
"""


def test_a_program_of_loads_alone_is_played(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A program of loads alone is played through ~/actuation to a simulation's end positions, and its bag replays."""
    path = tmp_path / "bridge.yaml"
    path.write_text(SCENE)
    assert demo.run(argparse.Namespace(scene=str(path), out=tmp_path / "run", dt=0.01)) == 0
    printed = capsys.readouterr().out
    assert "converged" in printed
    assert float(re.search(r"middle: position\W+([\d.]+)", printed)[1]) == pytest.approx(0.1, rel=0.05)
    assert float(re.search(r"speed, times real time\W+([\d.e+-]+)", printed)[1]) > 0.0
    assert (tmp_path / "run" / "bridge.png").is_file()
    bag = BagRun(tmp_path / "run" / "bag")
    assert [record.loads["weight"] for record in bag.records[1:]] == pytest.approx(np.arange(1, 11) * 0.05)
    simulation = Simulation(load_scene(path))
    results = list(simulation.play(10))
    np.testing.assert_allclose(last_positions(bag), results[-1].positions, atol=1e-4 * simulation.mesh.size)
    assert simulation.handle_pose("base").rotation[1] > 0.04
    verdict = Replay(bag).run().differences.verdict()
    assert verdict.name == "IDENTICAL"


def test_a_program_that_turns_too_far_in_a_step_is_refused(tmp_path: Path) -> None:
    """A program that turns a handle by 4 rad in one step is refused with the remedy, before a node is started."""
    path = tmp_path / "bridge.yaml"
    program = "program: {duration: 1.0, handles: {tip: [{time: 0}, {time: 1, rotation_deg: [0, 0, 230]}]}}"
    path.write_text(SCENE.partition("program:")[0] + program)
    told = "with steps of 1 s: handle 'tip' is commanded to turn by 4.014 rad .*less than pi.* several smaller steps"
    with pytest.raises(CommandError, match=told):
        demo.run(argparse.Namespace(scene=str(path), out=tmp_path / "run", dt=1.0))
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("dt", [0.0, float("nan"), -1.0, 1e9])
def test_a_time_between_commands_out_of_range_is_refused(dt: float) -> None:
    """`--dt` of the demo is refused at once if it is not within 1e-6 to 1000 s."""
    with pytest.raises(GdfeError, match=r"--dt = .*1e-06 <= time between two commands \[s\] <= 1000"):
        demo.run(argparse.Namespace(scene="bend5", out=None, dt=dt))


def test_a_program_shorter_than_a_step_is_one_step(tmp_path: Path) -> None:
    """A program of 0.1 s with `--dt 5` is played in one step, to its end."""
    path = tmp_path / "bridge.yaml"
    path.write_text(SCENE)
    assert demo.run(argparse.Namespace(scene=str(path), out=tmp_path / "run", dt=5.0)) == 0
    assert [record.loads["weight"] for record in BagRun(tmp_path / "run" / "bag").records[1:]] == [0.5]


def test_a_demo_beside_a_simulation_says_at_once_who_is_there(tmp_path: Path) -> None:
    """A demo beside a running node of the same name ends at once with an error and a remedy."""
    path = tmp_path / "bridge.yaml"
    path.write_text(SCENE.replace("duration: 0.1", "duration: 60.0"))  # a busy machine finds nodes late
    with NodeProcess({"scene": str(path)}) as other:
        while "active" not in other.log:
            time.sleep(0.1)
        started = time.monotonic()
        with pytest.raises(GdfeError, match=r"another node is called /gdfe_sim in ROS domain \d+.*remedy: end it"):
            demo.run(argparse.Namespace(scene=str(path), out=tmp_path / "run", dt=0.01))
        assert time.monotonic() - started < 60.0


def test_runs_that_begin_at_the_same_time_have_folders_of_their_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Demos begun at the same microsecond record into different folders; a place without folders is an error."""
    monkeypatch.chdir(tmp_path)
    moments = iter([datetime(2026, 1, 1), datetime(2026, 1, 1), datetime(2026, 1, 2)])
    monkeypatch.setattr(bag_info, "datetime", SimpleNamespace(now=lambda: next(moments)))
    monkeypatch.setattr(demo, "_play", lambda scene, source, bag, dt: played.append(bag) or 1 / 0)
    played: list[Path] = []
    for _ in range(2):
        with pytest.raises(ZeroDivisionError):
            demo.run(argparse.Namespace(scene="bend5", out=None, dt=0.01))
    assert [bag.parent.name for bag in played] == ["bend5_20260101_000000_000000", "bend5_20260102_000000_000000"]
    monkeypatch.chdir("/proc/self")
    with pytest.raises(RecordingError, match=r"no folder for the run can be created in .*remedy: name another place"):
        bag_info.make_run_folder("bend5")
