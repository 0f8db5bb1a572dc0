# SPDX-License-Identifier: Apache-2.0
"""``gdfe inspect`` prints findings on surfaces and draws them."""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np
import pytest
import trimesh

from gdfe_ros.cli import BAD_INPUT, main
from gdfe_ros.commands.inspect import DEFECTIVE


def test_thin_walls_are_noted_and_do_not_fail(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A plate that is thin for the size has a note and a picture, and can be used as it is."""
    path, picture = tmp_path / "plate.stl", tmp_path / "plate.png"
    trimesh.creation.box((0.1, 0.06, 0.001)).export(path)
    assert main(["inspect", str(path), "--size", "0.005", "--picture", str(picture)]) == 0
    said = capsys.readouterr()
    assert "can be used as it is" in said.out
    assert "thinnest wall" in said.out
    assert "5 times as long as the wall is thick" in " ".join(said.err.split())
    assert picture.stat().st_size > 5000


def test_self_intersections_are_a_defect_that_is_drawn(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Two boxes that overlap are a defect with its places and its remedy, and are drawn."""
    box = trimesh.creation.box((0.1, 0.06, 0.04))
    path, picture = tmp_path / "two.stl", tmp_path / "two.png"
    trimesh.util.concatenate([box, box.copy().apply_translation((0.05, 0.01, 0.01))]).export(path)
    assert main(["inspect", str(path), "--picture", str(picture)]) == DEFECTIVE
    said = " ".join(capsys.readouterr().err.split())
    assert "fix: the surface cuts itself:" in said
    assert "remedy: unite overlapping parts" in said
    assert picture.stat().st_size > 5000


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("option", ["--size", "--scale"])
@pytest.mark.parametrize("value", ["0", "-0.1", "nan", "inf"])
def test_a_number_out_of_range_is_refused(
    option: str, value: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A size or scale that is not positive or not finite is refused in one line with the allowed range."""
    trimesh.creation.box((0.1, 0.06, 0.04)).export(tmp_path / "box.stl")
    assert main(["inspect", str(tmp_path / "box.stl"), option, value]) == BAD_INPUT
    (line,) = capsys.readouterr().err.splitlines()
    assert f"{option} = {value}; allowed is a number: 0 < " in line


def test_a_folder_is_called_a_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A folder is refused as a folder."""
    assert main(["inspect", str(tmp_path)]) == BAD_INPUT
    assert "this is a folder; remedy: the path of a file in it" in capsys.readouterr().err


def test_a_picture_that_cannot_be_written_is_refused_first(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """An unfit picture is refused before the file is inspected."""
    trimesh.creation.box((0.1, 0.06, 0.04)).export(tmp_path / "box.stl")
    assert main(["inspect", str(tmp_path / "box.stl"), "--picture", str(tmp_path / "no" / "x.png")]) == BAD_INPUT
    said = capsys.readouterr()
    assert said.out == ""
    assert "there is no folder" in said.err


def test_a_name_in_a_file_is_printed_as_it_is(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A group's name that looks like markup or has control characters is printed, with the latter escaped."""
    corners = 0.1 * np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    mesh = meshio.Mesh(
        np.concatenate([corners, corners + np.array([0.0, 0.0, 0.1])]),
        [("hexahedron", np.arange(8)[None])],
        cell_data={"gmsh:physical": [np.array([1])], "gmsh:geometrical": [np.array([1])]},
        field_data={"a[/b]\x1b[31m": np.array([1, 3])},
    )
    mesh.write(tmp_path / "cube.msh", file_format="gmsh22", binary=False)
    assert main(["inspect", str(tmp_path / "cube.msh")]) == 0
    assert r"a[/b]\x1b[31m (1)" in capsys.readouterr().out


def test_several_files_give_one_line_each(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Several files give a line for each, with the verdict and the first defect; one with defects makes the code 1."""
    cases = Path(__file__).parents[1] / "data" / "cases"
    paths = [str(cases / name) for name in ("abaqus/moved_instance.inp", "overlap/two_same_side.vtk")]
    assert main(["inspect", *paths]) == DEFECTIVE
    sound, wrong = capsys.readouterr().out.splitlines()
    assert sound == f"{paths[0]}: hexahedra; 54, 20; can be used as it is"
    assert wrong.startswith(f"{paths[1]}: tetrahedra of first order")
    assert "1 to fix: 2 cells that lie on the same side" in wrong
    assert main(["inspect", paths[0], paths[0]]) == 0
    assert main(["inspect", *paths, "--picture", str(tmp_path / "x.png")]) == BAD_INPUT


def test_a_scene_is_no_mesh(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """For a scene file the command names the one that checks and draws scenes."""
    path = tmp_path / "mine.yaml"
    path.write_text("name: mine\n", encoding="utf-8")
    assert main(["inspect", str(path)]) == BAD_INPUT
    assert "it is a scene, not a mesh; remedy: gdfe solve" in capsys.readouterr().err
