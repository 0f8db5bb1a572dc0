# SPDX-License-Identifier: Apache-2.0
"""Each table in the pages agrees with the present solver."""

from __future__ import annotations

from unittest.mock import patch

import pytest

from benchmarks.measure.tables import NAMES, TABLES, Table
from benchmarks.provenance import stamp
from benchmarks.replay import first_steps, summed
from benchmarks.report import KEPT, Report, read_report
from docs.scripts import generate
from gdfe_ros.scene import load_scene
from gdfe_ros.simulation import Simulation
from gdfe_ros.solver.minimise.minimiser import Minimiser


@pytest.mark.parametrize("table", TABLES, ids=NAMES)
def test_a_table_is_of_a_solver_like_this_one(table: Table) -> None:
    """A replay of a small part of a table differs from it by at most a tenth (remedy: make measure, make docs)."""
    if absent := table.missing():
        pytest.skip(f"not installed: {', '.join(absent)}")
    stale = read_report(table.file).stale(table.probe())
    assert not stale, f"{table.name} is stale: make measure ONLY={table.name}\n" + "\n".join(stale)


def test_every_printed_table_is_measured_by_the_one_command() -> None:
    """The files in test/data are those of all printed tables, and of all measured ones."""
    kept = sorted(path.stem for path in KEPT.glob("*.json"))
    assert sorted(NAMES) == kept
    assert sorted(generate.TABLES) == kept


def test_a_solver_that_does_otherwise_is_seen() -> None:
    """With minimisations that end a thousand times nearer to the minimum, a probe's total of iterations is stale."""

    def probe() -> dict[str, float]:
        simulation = Simulation(load_scene("bend5", overrides={"mesh.bar.cells": [10, 1, 1]}))
        return summed(first_steps("bend5", simulation, 20))

    kept = Report([], stamp(), probe())
    assert kept.stale(probe()) == []
    with patch.object(Minimiser, "SHARE", 1e-3 * Minimiser.SHARE):
        stale = kept.stale(probe())
    assert "iterations of all" in {text.partition(":")[0] for text in stale}
