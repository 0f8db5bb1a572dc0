# SPDX-License-Identifier: Apache-2.0
"""Impossible fits: one clear message each, exit status 2, and nothing is written."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from gdfe_ros.cli import main

YOUNG = "materials.rubber.young"
VARY = ("--vary", f"{YOUNG}=5e4..8e5")


@pytest.fixture
def refused(tmp_path: Path, capsys: Any) -> Callable[..., str]:
    """Give a function that runs a fit that must be refused, and returns its message."""

    def run(*given: object) -> str:
        out = tmp_path / "out"
        assert main(["fit", *(str(item) for item in given), "--workers", "1", "--out", str(out)]) == 2
        assert not out.exists()
        return capsys.readouterr().err

    return run


def _match(tmp_path: Path, text: str) -> tuple[str, Path]:
    path = tmp_path / "match.yaml"
    path.write_text(text)
    return "--match", path


def test_columns_of_one_name(write_scene: Callable, refused: Callable, tmp_path: Path) -> None:
    """A table with two columns of one name is refused."""
    table = tmp_path / "twice.csv"
    table.write_text("time,tip.z,tip.z\n0,0,1\n1,1,2\n")
    assert "two columns are named tip.z; remedy: rename or remove one" in refused(write_scene(), table, *VARY)


def test_topics_that_do_not_exist(
    write_scene: Callable, record_bag: Callable, refused: Callable, tmp_path: Path
) -> None:
    """A misspelt topic is refused with the likely name."""
    match = _match(tmp_path, "compare: {tip: {probe: tip, topic: /gdfe_sim/probe/top}}\n")
    said = refused(write_scene(), record_bag(count=3), *VARY, *match)
    assert "no message on topic '/gdfe_sim/probe/top'; did you mean '/gdfe_sim/probe/tip'?" in said


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("compare: {tip: {probe: tip, columns: {z: tip.zz}}}", "no column 'tip.zz'; did you mean 'tip.z'?"),
        ("compare: {tip: {probe: top, columns: {z: tip.z}}}", "no probe 'top' in scene 'pulled'; it has tip"),
        ("compare: {tip: {probe: tip, column: tip.z}}", "along what is column 'tip.z' measured?"),
        (
            "commands: {tip: {column: load, unit: g}}",
            "1 defect\n  - commands.tip.unit: 'g' is not allowed; allowed: 'm', 'cm'",
        ),
        ("compare: {tip: {probe: tip, columns: {z: tip.z}}}\ncommands: {pul: 1.0}", "takes no command 'pul'"),
        ("compare: {tip: {prob: tip}}", "compare.tip.prob: unknown key"),
        ("recordings: {walk: {}}", "no recording takes run.csv; recordings: walk"),
        ("time: clock", "no column 'clock'"),
        ("where: {pull: [50, 60]}", "no row lies in"),
    ],
)
def test_match_files_that_do_not_fit(
    text: str, message: str, write_scene: Callable, write_table: Callable, refused: Callable, tmp_path: Path
) -> None:
    """A match file with a defect is refused with its key."""
    assert message in refused(write_scene(), write_table(), *VARY, *_match(tmp_path, text))


@pytest.mark.parametrize(
    ("vary", "message"),
    [
        ("materials.rubber.young", "is no parameter; --vary takes KEY=LOW..HIGH"),
        ("materials.rubber.young=8e5..5e4", "allowed: LOW < HIGH"),
        ("materials.rubber.law=1..2", "'neo_hookean' there; a number is needed"),
        ("materials.rubber.jung=1..2", "jung (override): unknown key"),
        ("materials.ruber.young=1e5..2e5", "no 'ruber' in materials; did you mean 'rubber'? allowed: rubber"),
        ("materials.rubber.density=900..1200", "no influence on the measured values"),
        (f"{YOUNG}=3e3..2e4", "ends at its bound 20000, but the data are fitted best by about 2e+05"),
    ],
)
def test_parameters_that_cannot_be(
    vary: str, message: str, write_scene: Callable, write_table: Callable, refused: Callable
) -> None:
    """A parameter that is no interval, number or key, that has no effect, or in the wrong unit (kPa), is refused."""
    assert message in refused(write_scene(), write_table(), "--vary", vary)


def test_positions_with_the_wrong_unit(write_scene: Callable, write_table: Callable, refused: Callable) -> None:
    """Positions in millimetres given as metres are refused with the remedy."""
    assert "remedy: `unit: mm`" in refused(write_scene(), write_table(unit="m"), *VARY)


def test_data_that_do_not_move(write_scene: Callable, write_table: Callable, refused: Callable, tmp_path: Path) -> None:
    """A column that never changes is refused."""
    data = write_table(count=5)
    data.write_text("\n".join(["tip.z [mm]", *["-3.0"] * 5]) + "\n")
    assert "the data do not move: every value is -0.003" in refused(write_scene(), data, *VARY)


def test_recordings_that_are_not_there(write_scene: Callable, write_table: Callable, refused: Callable) -> None:
    """No recording, a missing file, an unknown holdout, and holding out all recordings are refused."""
    assert "give a scene and recordings" in refused(write_scene(), *VARY)
    assert "does not exist" in refused(write_scene(), "none.csv", *VARY)
    assert "no such recording; recordings: run" in refused(write_scene(), write_table(), *VARY, "--holdout", "walk")
    assert "nothing is left to fit" in refused(write_scene(), write_table(), *VARY, "--holdout", "run")


def test_commands_out_of_range(write_scene: Callable, refused: Callable, tmp_path: Path) -> None:
    """A command in the wrong unit is refused with its values, the allowed range, and the match file as the place."""
    actuators = "actuators: {air: {cable: {points: [[0, 0, 0.008], [0.08, 0, 0.008]], range: [0, 5]}}}\n"
    scene = write_scene(Path(write_scene()).read_text() + actuators)
    (tmp_path / "run.csv").write_text("time,pull_N,z\n0,0,0\n1,2,1\n")
    match = _match(
        tmp_path,
        "compare: {tip: {probe: tip, columns: {z: z}, unit: mm}}\ncommands: {air: {column: pull_N, unit: kgf}}\n",
    )
    said = refused(scene, tmp_path / "run.csv", *VARY, *match)
    assert "recording run: the commands of 'air' are from 0 to 19.6133; allowed: 0 <= tension [N] <= 5" in said
    assert "the `unit` of this command in the match file" in said
