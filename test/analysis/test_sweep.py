# SPDX-License-Identifier: Apache-2.0
"""Parameter sweeps of a scene."""

from __future__ import annotations

import os
import signal
import weakref
from pathlib import Path
from typing import Any

import pyarrow.parquet
import pytest

from gdfe_ros.analysis import sweep
from gdfe_ros.analysis.sweep import Case, grid_cases, read_axes, read_list, run_case, run_cases
from gdfe_ros.analysis.workers import connect
from gdfe_ros.cli import main
from gdfe_ros.errors import GdfeError
from gdfe_ros.scene import load_scene


def test_a_grid_is_every_combination() -> None:
    """A grid of an axis and a list has every combination, and names that depend on the values only."""
    axes = read_axes(["materials.e20.young=1e4:4e4:4", "mesh.bar.cells=[[10, 1, 1], [20, 2, 2]]"])
    cases = grid_cases(axes)
    assert len(cases) == 8
    assert cases[2].overrides == {"materials.e20.young": 2e4, "mesh.bar.cells": [10, 1, 1]}
    assert cases[2].name == Case({"mesh.bar.cells": [10, 1, 1], "materials.e20.young": 2e4}).name
    assert len({case.name for case in cases}) == 8


def test_a_list_names_its_cases(tmp_path: Path) -> None:
    """The same two cases read from CSV and from YAML are equal."""
    (tmp_path / "a.csv").write_text("solver.steps,materials.e20.young\n2,1e4\n3,20000.0\n")
    (tmp_path / "a.yaml").write_text("- {solver.steps: 2, materials.e20.young: 1.0e+4}\n- {solver.steps: 3}\n")
    assert read_list(tmp_path / "a.csv")[1] == {"solver.steps": 3, "materials.e20.young": 20000.0}
    assert read_list(tmp_path / "a.yaml")[1] == {"solver.steps": 3}


@pytest.mark.parametrize("entry", ["young", "young=5", "young=[", "young=1:2:x"])
def test_a_bad_axis_is_refused(entry: str) -> None:
    """An invalid axis is refused with the expected format."""
    with pytest.raises(GdfeError, match=r"KEY=VALUES|list"):
        read_axes([entry])


def test_a_sweep_is_resumed_and_reports_failures(tmp_path: Path, capsys: Any) -> None:
    """A sweep repeated with one more case runs only that case, and reports the impossible one."""
    out = tmp_path / "sweep"
    base = ["sweep", "bend5", "--out", str(out), "--workers", "1", "--grid", "solver.steps=[2]"]
    assert main([*base, "--grid", "mesh.bar.cells=[[10,1,1],[12,1,1],[0,1,1]]"]) == 1
    assert "number of cells along x, y, z" in capsys.readouterr().out
    table = pyarrow.parquet.read_table(out / "results.parquet").to_pylist()
    assert [row["status"] for row in table] == ["converged", "converged", "failed"]
    assert table[0]["tip.z"] == pytest.approx(0.2)
    assert (out / "results.png").stat().st_size > 5000
    stamps = {path.name: path.stat().st_mtime_ns for path in (out / "cases").iterdir()}
    assert main([*base, "--grid", "mesh.bar.cells=[[10,1,1],[12,1,1],[0,1,1],[14,1,1]]"]) == 1
    again = {path.name: path.stat().st_mtime_ns for path in (out / "cases").iterdir()}
    assert len(again) == 4
    assert {name: again[name] for name in stamps} == stamps


def test_cases_with_an_equal_matrix_share_its_factor() -> None:
    """A second case with an equal matrix in the same worker uses the factor of the first."""
    text, factors = load_scene("bend5", overrides={"mesh.bar.cells": [10, 1, 1]}).source, []
    for steps in (2, 3):
        assert run_case(text, {"solver.steps": steps})["status"] == "converged"
        (kept,) = sweep._KEPT
        factors.append(weakref.ref(kept.stepper.equilibrium.matrix._factor))
        del kept
    assert factors[0]() is factors[1]() is not None


def test_cases_that_did_not_converge_are_drawn_as_failed() -> None:
    """In a figure, failed and unconverged cases are crosses, and the line leaves them out."""
    from gdfe_ros.analysis.sweep import results_figure

    good, bad = {"status": "converged"}, {"status": "not converged"}
    rows = [
        {"set.a": 1, **good, "energy": 3.0},
        {"set.a": 2, **bad, "energy": 9.0},
        {"set.a": 3, **good, "energy": 5.0},
        {"set.a": 4, "status": "failed"},
    ]
    (axes,) = results_figure(rows, title="four", shown=["energy"]).axes
    line, crosses = axes.lines
    assert line.get_xydata().tolist() == [[1, 3], [3, 5]]
    assert crosses.get_label() == "failed or not converged"
    assert crosses.get_xdata().tolist() == [2, 4]
    assert crosses.get_ydata()[0] == 9.0


def test_results_of_another_scene_are_not_mixed(tmp_path: Path, capsys: Any) -> None:
    """A sweep into the results of another scene gives exit status 2."""
    (tmp_path / "sweep.json").write_text('{"scene_sha256": "0"}')
    assert main(["sweep", "bend5", "--out", str(tmp_path), "--grid", "solver.steps=[1]"]) == 2
    assert "another scene" in capsys.readouterr().err


def test_a_killed_worker_costs_no_case() -> None:
    """After the only worker is killed, every case is run exactly once in the results."""
    scene = load_scene("bend5", overrides={"mesh.bar.cells": [10, 1, 1]}).source
    cases = grid_cases({"materials.e20.young": [1e4 + 100.0 * k for k in range(40)]})
    with connect(None, 1) as client:
        (victim,) = client.run(os.getpid).values()
        results = run_cases(client, scene, cases)
        done = [next(results) for _ in range(8)]  # by now short cases are put together
        os.kill(victim, signal.SIGKILL)
        done += results
    assert sorted(case.name for case, _ in done) == sorted(case.name for case in cases)
    assert {result["status"] for _, result in done} == {"converged"}
