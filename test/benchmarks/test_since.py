# SPDX-License-Identifier: Apache-2.0
"""Comparison of two commits: plays are reproducible, and the table has their times."""

from __future__ import annotations

from dataclasses import asdict

from benchmarks.player import play
from benchmarks.since import PLAYS, Comparison, since_table
from gdfe_ros.scene import load_scene
from gdfe_ros.simulation import Simulation


def test_a_play_is_the_same_each_time() -> None:
    """A small bar's scene, played twice, has the same steps and iterations, and bit-identical last positions."""
    small = PLAYS["bend5 10x1x1, streamed"]
    simulation = Simulation(load_scene(small.scene, overrides=small.overrides))
    first, second = (play(simulation, 5) for _ in range(2))
    assert (first["steps"], first["iterations"], first["digest"]) == (5, second["iterations"], second["digest"])
    assert first["seconds"] > 0.0


def test_every_play_names_a_shipped_scene() -> None:
    """Every play is of a shipped scene with a program, and its overrides have valid keys."""
    for play_ in PLAYS.values():
        assert load_scene(play_.scene, overrides=play_.overrides).program is not None


def test_the_table_has_a_row_for_each() -> None:
    """A row has the times per step, how many times as fast this tree is, and the iterations."""
    found = asdict(Comparison("bend5, cold", 2, 0.1, 0.08, 0.8, (40, 41), same=False))
    text = since_table({"commit": "5eecb34", "plays": [found]})
    assert text.splitlines()[0].startswith("| program | steps | 5eecb34 [ms a step] | now [ms a step] |")
    assert text.splitlines()[-1] == "| bend5, cold | 2 | 50 | 40 | 1.25 | 40 to 41 |"
