# SPDX-License-Identifier: Apache-2.0
"""The table of before and after: tasks are reproducible, errors are judged, targets are shown."""

from __future__ import annotations

import os
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.loop import bodies
from benchmarks.loop.__main__ import GROUPS, choose_rows, probe
from benchmarks.loop.compare import make_lines, time_row
from benchmarks.loop.judge import summarise
from benchmarks.loop.playing import Player, drop_results
from benchmarks.loop.process import Worker, unpack_tree
from benchmarks.loop.row import Row, Target, Task
from benchmarks.loop.table import make_loop_table
from benchmarks.loop.truth import measure_each, measure_path
from benchmarks.provenance import ROOT

SMALL = Task(
    scene="bend5", overrides={"mesh.bar.cells": [10, 1, 1]}, total=200, parts={"first": (0, 3), "later": (5, 8)}
)


def test_a_part_is_the_same_each_time() -> None:
    """Parts of a program begin at the same state each time, also behind steps that are made once."""
    player = Player(SMALL.request)
    first, second = (drop_results(player.play()) for _ in range(2))
    assert list(first) == ["first", "later"]
    for name in first:
        assert {**first[name], "seconds": 0.0} == {**second[name], "seconds": 0.0}
        assert first[name]["steps"] == 3


def test_a_path_has_the_errors_of_its_steps(tmp_path: Path) -> None:
    """The errors of a stream are those against a finer one, in tolerances."""
    found = measure_path(SMALL.request, 1e-3, str(tmp_path / "places.npz"))
    assert set(found) == {"first", "later"}
    assert all(0.0 < part["error"] < 1.0 and part["beyond"] == 0 for part in found.values())


def test_a_cold_step_is_judged(tmp_path: Path) -> None:
    """A step of a small bar is continued at a fine tolerance; both places are kept for another judge."""
    places = tmp_path / "places.npz"
    task = replace(SMALL, total=1, parts={"": (0, 1)})
    found = measure_each(task.request, 1e-4, None, str(places), True)
    (step,) = found["each"]
    assert step["converged"]
    assert step["error"] < 1.0
    assert step["verified"]
    with np.load(places) as arrays:
        away = np.linalg.norm(arrays["found 0"] - arrays["truth 0"], axis=1).max()
    assert away > 0.0


def test_a_row_is_timed_in_another_process() -> None:
    """A process with the package of a tree times a small row; a task that fails says why, and the process goes on."""
    assert unpack_tree(str(ROOT)) == ROOT
    row = Row(group="streams", name="bar", tasks=(SMALL,), turns=1)
    with closing(Worker(ROOT, min(os.sched_getaffinity(0)))) as worker:
        assert "does not exist" in worker.ask("time", replace(SMALL, scene="none"), repeats=1)["failed"]
        found = time_row(row, None, worker)
    assert set(found) == {"first", "later"}
    assert all(part["after"] > 0.0 and part["ratio"] is None for part in found.values())


def test_steps_are_counted() -> None:
    """Errors beyond one, other equilibria, saddles that are called stable, and checks are counted apart."""
    good = {
        "converged": True,
        "stable": True,
        "iterations": 5,
        "error": 0.5,
        "truth": {"newton": 0.0, "definite": True},
    }
    beyond = {**good, "error": 2.0, "truth": {"newton": 3.0, "definite": True}}
    away = {**good, "error": 900.0, "stable": None, "found": {"newton": 0.4, "definite": False}}
    claimed = {**away, "stable": True, "found": {"newton": None, "definite": False}}
    cut = {"converged": False, "stable": None, "iterations": 9}
    found = summarise([good, beyond, away, claimed, cut], size=1e4)
    assert (found["judged"], found["beyond"], found["elsewhere"], found["saddles"]) == (4, 2, 1, 1)
    assert (found["unconverged"], found["checks"], found["unverified"], found["iterations"]) == (1, 4, 1, 29)
    assert found["error"] == 900.0


def test_the_table_says_what_is_met() -> None:
    """A row has both times, their ratio, errors, and the targets that are missed."""
    targets = Target("ratio", 0.5), Target("error", 1.0), Target("after", 9.0, least=True)
    row = Row(group="cold", name="bar", tasks=(SMALL,), targets=targets)
    times = {"": {"before": 8.0, "after": 6.0, "ratio": 0.75, "iterations": [40.0, 20.0]}}
    lines = make_lines(row, times, [{"": {"error": 0.9, "beyond": 0}}, {"": {"error": 0.2, "beyond": 0}}])
    text = make_loop_table({"commit": "b6cf3c23", "lines": lines})
    assert "| bar | 8 ms | 6 ms | 0.75 | 40 to 20 | 0.9 to 0.2 | 0 |" in text
    assert "**missed**: ratio, after |" in text
    assert "Of 3 targets, 1 are met, 2 missed, 0 not judged." in text


def test_every_row_can_be_asked_for() -> None:
    """Names of rows are unique, and groups and parts of names choose rows."""
    rows = choose_rows([])
    assert len({row.name for row in rows}) == len(rows)
    assert {row.group for row in rows} == set(GROUPS)
    assert [row.name for row in choose_rows(["10x1x1, cold"])] == ["bend5 10x1x1, cold"]


@pytest.mark.parametrize("name", ["strip_lifted", "tube_vacuum", "sheet_of_fibres"])
def test_thin_bodies_are_scenes(name: str) -> None:
    """A thin body's text is a scene, and a step of its program is made."""
    task = next(task for task in bodies.make_thin_bodies() if task.label == name)
    player = Player(replace(task, parts={"": (0, 1)}, tolerance=1e-1).request)
    assert player.play()[""]["steps"] == 1


def test_the_probe_is_of_small_steps() -> None:
    """The probe has iterations and displacements."""
    assert set(probe()) == {"cold: moved [m]", "streamed: moved [m]", "iterations of all"}
