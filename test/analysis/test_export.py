# SPDX-License-Identifier: Apache-2.0
"""Exports, read back by widely used libraries."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import meshio
import numpy as np
import pyarrow.parquet
import pytest

from gdfe_ros.analysis.bag_run import BagRun
from gdfe_ros.cli import main
from gdfe_ros.scene import load_scene
from test.analysis.conftest import BagMaker, last_positions


def test_vtk_series_holds_the_run(make_bag: Callable[..., Path], tmp_path: Path) -> None:
    """A ParaView export has the times in the collection, and positions and fields in the files."""
    bag, out = make_bag(), tmp_path / "series"
    assert main(["export", str(bag), "--out", str(out), "--format", "vtk"]) == 0
    entries = ElementTree.parse(out / "run.pvd").getroot().findall(".//DataSet")
    assert [float(entry.get("timestep")) for entry in entries] == pytest.approx(np.arange(1, 7) * 0.01)
    grid = meshio.read(out / entries[-1].get("file"))
    np.testing.assert_array_equal(grid.points, last_positions(BagRun(bag)))
    assert grid.cells_dict["hexahedron"].shape == (10, 8)
    assert grid.point_data["displacement"][:, 2].max() == pytest.approx(0.1)
    assert set(grid.cell_data) == {"eps_eq", "J", "omega", "tangent", "energy_density"}


@pytest.mark.exact("an exact zero without a shift")
def test_npz_holds_every_array(make_bag: Callable[..., Path], tmp_path: Path) -> None:
    """A numpy export has every array, steps along the first axis, as float32 like the messages."""
    out = tmp_path / "run.npz"
    assert main(["export", str(make_bag()), "--out", str(out)]) == 0
    with np.load(out) as data:
        assert data["positions"].shape == (6, 44, 3)
        assert data["positions"].dtype == np.float32
        assert data["eps_eq"].shape == (6, 10)
        np.testing.assert_allclose(data["handles/tip/pose/pose.position.z"][:, 0], np.linspace(0, 0.1, 6), atol=1e-15)


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_tables_hold_a_row_for_each_step(make_bag: Callable[..., Path], tmp_path: Path, kind: str) -> None:
    """A table of every second step has the commands, responses and costs."""
    bag, out = make_bag(), tmp_path / f"run.{kind}"
    assert main(["export", str(bag), "--out", str(out), "--every", "2"]) == 0
    if kind == "csv":
        with out.open(newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
    else:
        rows = pyarrow.parquet.read_table(out).to_pylist()
    length = " [m]" if kind == "csv" else ""
    assert [float(row[f"target.tip.z{length}"]) for row in rows] == pytest.approx([0.0, 0.04, 0.08])
    force = next(name for name in rows[-1] if name.startswith("handles/tip/wrench.wrench.force.z"))
    assert float(rows[-1][force]) > 0.0
    assert int(float(rows[-1]["iterations"])) > 0


def test_columns_have_names_and_units(kept_bags: dict[Path, float], tmp_path: Path) -> None:
    """A robot's export names joint states by actuator and gives each quantity its unit, in every format."""
    bag = next(path for path in kept_bags if path.name == "pneunet")
    scene = BagRun(bag).scene
    names = [actuator.name for actuator in scene.actuators]
    for kind in ("csv", "parquet", "npz"):
        assert main(["export", str(bag), "--out", str(tmp_path / f"run.{kind}")]) == 0
    with (tmp_path / "run.csv").open(newline="", encoding="utf-8") as file:
        head = next(csv.reader(file))
    for name in names:
        assert {f"joint_states.{name}.position [m^3]", f"joint_states.{name}.velocity [m^3/s]"} <= set(head)
        assert {f"joint_states.{name}.effort [Pa]", f"command.{name} [Pa]"} <= set(head)
    assert {"time [s]", "dt [s]", "stamp [ns]", "solve_time [s]", "energy [J]", "iterations", "error_estimate"} <= set(
        head
    )
    assert "handles/base/wrench.wrench.torque.z [N m in base_centre]" in head
    assert any(column.startswith("probe/") and column.endswith("pose.position.x [m in base_link]") for column in head)
    assert not any(".orientation.x [m" in column for column in head)
    fields = [
        (each.name, each.metadata[b"unit"].decode(), each.metadata[b"frame"].decode())
        for each in pyarrow.parquet.read_schema(tmp_path / "run.parquet")
    ]
    texts = [(name, " ".join([unit] * bool(unit) + ["in", frame] * bool(frame))) for name, unit, frame in fields]
    assert [f"{name} [{text}]" if text else name for name, text in texts] == head
    with np.load(tmp_path / "run.npz") as data:
        assert list(data["joint_names"]) == names
        units = json.loads(str(data["units"]))
        assert (units["positions"], units["time"], units["tangent"]) == ("m", "s", "Pa")
        assert units["handles/base/wrench/wrench.force.x"] == "N"
        assert data["joint_states/effort"].shape[1] == len(names)


@pytest.mark.parametrize("kind", ["csv", "parquet", "npz"])
def test_joints_of_an_arm_have_names_and_units(tmp_path: Path, maker: type[BagMaker], kind: str) -> None:
    """An export of a run with an arm names the joints after the actuators, in every format."""
    bag, scene = maker(tmp_path / "bag", load_scene("arm_grasp")), load_scene("arm_grasp")
    bag.step()
    out = tmp_path / f"run.{kind}"
    assert main(["export", str(bag.close()), "--out", str(out)]) == 0
    if kind == "npz":
        names = [*(each.name for each in scene.actuators), *(joint.name for joint in scene.arms[0].joints)]
        with np.load(out) as data:
            assert list(data["joint_names"]) == names
    elif kind == "csv":
        head = out.read_text(encoding="utf-8").partition("\n")[0].split(",")
        assert "joint_states.elbow.velocity [rad/s]" in head
        assert "joint_states.left.effort [N]" in head
    else:
        field = pyarrow.parquet.read_schema(out).field("joint_states.elbow.effort")
        assert field.metadata[b"unit"] == b"N m"


def test_an_unknown_ending_is_refused(make_bag: Callable[..., Path], tmp_path: Path, capsys: Any) -> None:
    """An export to an unknown file ending gives exit status 2 and the known endings."""
    assert main(["export", str(make_bag()), "--out", str(tmp_path / "run.xlsx")]) == 2
    assert "vtk, npz, csv, parquet" in capsys.readouterr().err
