# SPDX-License-Identifier: Apache-2.0
"""Parameter sweeps of a scene."""

from __future__ import annotations

import os
import signal
import threading
import weakref
from contextlib import suppress
from pathlib import Path
from types import ModuleType
from typing import Any

import pyarrow.parquet
import pytest

from gdfe_ros.analysis.sweep.cases import Case, grid_cases, read_axes, read_list
from gdfe_ros.cli import main
from gdfe_ros.errors import GdfeError
from gdfe_ros.scene import load_scene

NOBODY = 2**31 - 1
"""A process id that no process has."""


@pytest.fixture
def runner() -> ModuleType:
    """Import and return the module that runs cases on workers, so that collecting the tests does not import dask."""
    from gdfe_ros.analysis.sweep import runner

    return runner


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
    from gdfe_ros.analysis.sweep import case_run

    text, factors = load_scene("bend5", overrides={"mesh.bar.cells": [10, 1, 1]}).source, []
    for steps in (2, 3):
        assert case_run.run_case(text, {"solver.steps": steps})["status"] == "converged"
        (kept,) = case_run._KEPT
        factors.append(weakref.ref(kept.stepper.equilibrium.matrix._factor))
        del kept
    assert factors[0]() is factors[1]() is not None


def test_cases_that_did_not_converge_are_drawn_as_failed() -> None:
    """In a figure, failed and unconverged cases are crosses, and the line leaves them out."""
    from gdfe_ros.analysis.sweep.results import results_figure

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


def test_a_killed_worker_costs_no_case(runner: ModuleType) -> None:
    """After the only worker is killed, every case is run exactly once in the results."""
    scene = load_scene("bend5", overrides={"mesh.bar.cells": [10, 1, 1]}).source
    cases = grid_cases({"materials.e20.young": [1e4 + 100.0 * k for k in range(40)]})
    with runner.connect(None, 1) as client:
        (victim,) = client.run(os.getpid).values()
        results = runner.run_cases(client, scene, cases)
        done = [next(results) for _ in range(8)]  # by now short cases are put together
        os.kill(victim, signal.SIGKILL)
        done += results
    assert sorted(case.name for case, _ in done) == sorted(case.name for case in cases)
    assert {result["status"] for _, result in done} == {"converged"}


def test_results_survive_workers_that_end_late(runner: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    """Results are returned even if dask reports a timeout when it closes its workers, as on a busy machine."""
    scene = load_scene("bend5", overrides={"mesh.bar.cells": [10, 1, 1]}).source
    close = runner.LocalCluster.close

    def late(cluster: object, timeout: float | None = None) -> None:
        close(cluster, timeout)
        raise TimeoutError

    monkeypatch.setattr(runner.LocalCluster, "close", late)
    with runner.connect(None, 1) as client:
        results = list(runner.run_cases(client, scene, grid_cases({"solver.steps": [1, 2]})))
    assert [result["status"] for _, result in results] == ["converged"] * 2


def test_a_sweep_without_workers_ends(runner: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    """A sweep without any worker ends with an error after a limited wait."""
    monkeypatch.setattr(runner, "PATIENCE", 2.0)
    scene = load_scene("bend5", overrides={"mesh.bar.cells": [10, 1, 1]}).source
    with runner.connect(None, 0) as client, pytest.raises(GdfeError, match="there has been no worker for 2 s"):
        list(runner.run_cases(client, scene, grid_cases({"solver.steps": [1, 2]})))


@pytest.mark.slow
def test_workers_that_take_long_to_come_back_are_waited_for(runner: ModuleType) -> None:
    """After all workers were killed for 20 s, longer than dask waits for a lost one, every case is run."""
    scene = load_scene("bend5", overrides={"mesh.bar.cells": [20, 2, 2]}).source
    cases, over = grid_cases({"materials.e20.young": [1e4 + 100.0 * k for k in range(20)]}), threading.Event()

    def kill() -> None:
        while not over.wait(0.05):
            for nanny in list(client.cluster.workers.values()):
                with suppress(ProcessLookupError):
                    os.kill(nanny.pid or NOBODY, signal.SIGKILL)

    with runner.connect(None, 2) as client:
        thread = threading.Thread(target=kill)
        thread.start()
        threading.Timer(20.0, over.set).start()
        done = list(runner.run_cases(client, scene, cases))
        thread.join()
    assert {result["status"] for _, result in done} == {"converged"}
    assert len(done) == len(cases)
