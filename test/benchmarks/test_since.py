# SPDX-License-Identifier: Apache-2.0
"""Two commits in turn: the player repeats itself, and the table says what was found."""

from __future__ import annotations

from benchmarks.player import play
from benchmarks.since import PLAYS, Comparison, since_table
from gdfe_ros.scene import load_scene
from gdfe_ros.simulation import Simulation


def test_a_play_is_the_same_each_time() -> None:
    """Play a small bar twice: as many steps and iterations, and the same place to the bit."""
    small = PLAYS["bend5 10x1x1, streamed"]
    simulation = Simulation(load_scene(small.scene, overrides=small.overrides))
    first, second = (play(simulation, 5) for _ in range(2))
    assert (first["steps"], first["iterations"], first["digest"]) == (5, second["iterations"], second["digest"])
    assert first["seconds"] > 0.0


def test_every_play_names_a_shipped_scene() -> None:
    """Load them all: overrides name keys that are there, and each scene has a program."""
    for play_ in PLAYS.values():
        assert load_scene(play_.scene, overrides=play_.overrides).program is not None


def test_the_table_has_a_row_for_each() -> None:
    """Print a play that became slower: times for a step, the ratio of the pairs, and whether the bits changed."""
    text = since_table([Comparison("bend5, cold", 2, 0.1, 0.11, 1.08, (40, 41), same=False)])
    assert text.splitlines()[-1] == "| bend5, cold | 2 | 50.000 | 55.000 | 1.080 | 40 to 41 | no |"
