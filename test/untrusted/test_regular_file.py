# SPDX-License-Identifier: Apache-2.0
"""Files that data name: pipes, devices, large files, paths out of a folder, states that would overwrite other files."""

from __future__ import annotations

import csv
import errno
import os
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from gdfe_ros.analysis.export import Columns, write_csv
from gdfe_ros.arms.meshes import find_mesh
from gdfe_ros.checkpoint import load_state, save_state, write_state
from gdfe_ros.errors import ArmError, GdfeError, MeshError, SceneError
from gdfe_ros.mesh.files.importer import read_mesh
from gdfe_ros.mesh.meshing.voxels import examine_surface
from gdfe_ros.scene import load_scene, scene_from_text
from gdfe_ros.simulation import Simulation
from gdfe_ros.untrusted.bounded_text import quote_formula
from gdfe_ros.untrusted.regular_file import path_inside, read_bytes, read_text, replacing, require_regular


@pytest.fixture(params=["pipe", "device", "folder", "large", "link to a device"])
def unfit(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """Return a path that cannot be read whole: reading it would wait for ever, never end, or fill the memory."""
    path = tmp_path / "thing.stl"
    match request.param:
        case "pipe":
            os.mkfifo(path)
        case "device":
            return Path("/dev/zero")
        case "folder":
            path.mkdir()
        case "large":
            with path.open("wb") as file:
                file.truncate(3 << 30)
        case _:
            path.symlink_to("/dev/zero")
    return path


def test_only_regular_files_of_limited_size_are_read(unfit: Path, tmp_path: Path) -> None:
    """A pipe, a device, a folder and a file of 3 GiB are refused at once, by every reader."""
    for read in (read_bytes, read_text, require_regular):
        with pytest.raises(OSError, match=r"regular file|allowed: up to|directory"):
            read(unfit)
    for suffix in (".stl", ".msh", ".vtk"):
        path = tmp_path / f"mesh{suffix}"
        path.symlink_to(unfit)
        with pytest.raises(MeshError, match=r"regular file|allowed: up to|folder"):
            read_mesh(path)
    with pytest.raises(MeshError, match=r"regular file|allowed: up to|folder|unknown kind"):
        examine_surface(unfit, scale=1.0)
    scene = tmp_path / "scene.yaml"
    scene.symlink_to(unfit)
    with pytest.raises(SceneError):
        load_scene(scene)


def test_a_mesh_that_its_library_reads_for_ever_is_refused(tmp_path: Path) -> None:
    """At the end of a damaged file of kind .msh, meshio waits for a bracket for ever; it is refused after seconds."""
    path = tmp_path / "damaged.msh"
    path.write_text('(0 "damaged")\n(10 (1 1 8 1 3)(\n0 0 0\n')
    began = time.process_time()
    with pytest.raises(MeshError, match=r"more than 5 s"):
        read_mesh(path)
    assert time.process_time() - began < 30.0


def test_a_regular_file_is_read(tmp_path: Path) -> None:
    """A regular file is read, with line ends as line feeds; its size is limited."""
    path = tmp_path / "text"
    path.write_bytes(b"a\r\nb\rc\n")
    assert read_text(path) == "a\nb\nc\n"
    with pytest.raises(OSError, match="7 bytes; allowed: up to 6"):
        read_bytes(path, most=6)


@pytest.mark.parametrize("name", ["", ".", "..", "../a", "/a", "a/b", "a\0", "a\n", "-rf", "a" * 200, "é", "a\\b"])
def test_a_path_stays_inside_of_its_folder(tmp_path: Path, name: str) -> None:
    """A name that leads out of the folder, or has other characters than allowed, makes no path."""
    with pytest.raises(ValueError, match="cannot be a part of a path"):
        path_inside(tmp_path, name)
    assert path_inside(tmp_path, "a.b-c_1") == tmp_path / "a.b-c_1"


@pytest.mark.parametrize(
    "name", ["/tmp/evil", "../evil", "a b", "a\\nb", "a\\0b", "\\e[31mred", "a" * 65, "", ".", "-x"]
)
def test_a_scene_has_a_name_that_is_no_path(name: str) -> None:
    """A scene's name has at most 64 letters, digits, _, - and dots; it becomes a part of paths and of the log."""
    source = load_scene("bend5").source.replace("name: bend5", f'name: "{name}"')
    with pytest.raises(SceneError, match=r"name = .*allowed: 1 to 64 letters") as error:
        scene_from_text(source)
    assert str(error.value).isprintable() or "\n  - " in str(error.value)
    assert "\x1b" not in str(error.value)


def test_a_state_overwrites_only_a_state(tmp_path: Path) -> None:
    """A saved state may replace a former one; any other file, link or folder at the path stays as it is."""
    simulation = Simulation(load_scene("bend5", overrides={"mesh.bar.cells": [10, 1, 1]}))
    data, path = save_state(simulation), tmp_path / "new" / "state"
    for _ in range(2):
        write_state(path, data)
        load_state(simulation, path.read_bytes())
    assert [each.name for each in path.parent.iterdir()] == ["state"]
    source = tmp_path / "source.py"
    source.write_text("import os\n")
    (tmp_path / "empty").touch()
    (tmp_path / "link").symlink_to(source)
    (tmp_path / "dangling").symlink_to(tmp_path / "nothing")
    os.mkfifo(tmp_path / "pipe")
    for name in ("source.py", "empty", "link", "dangling", "pipe", "new"):
        with pytest.raises(GdfeError, match="is no state"):
            write_state(tmp_path / name, data)
    assert source.read_text() == "import os\n"


@pytest.mark.parametrize("text", ["=1+1", "+cmd", "-cmd|x", "@SUM(A1)", "\t=1", "\r=1"])
def test_a_cell_is_no_formula(tmp_path: Path, text: str) -> None:
    """A text that a spreadsheet would execute begins with a quote in CSV; numbers stay numbers."""
    assert quote_formula(text) == f"'{text}"
    write_csv([{"message": text, text: -1.5}], tmp_path / "a.csv", Columns(SimpleNamespace(actuators=(), arms=())))
    with (tmp_path / "a.csv").open(newline="") as file:
        assert list(csv.reader(file)) == [["message", f"'{text}"], [f"'{text}", "-1.5"]]


@pytest.mark.parametrize("value", [-1.5, "-1.5", "+1e-3", "", "a=b", None, True])
def test_a_number_is_no_formula(value: object) -> None:
    """Numbers with a sign, and other texts, stay as they are."""
    assert quote_formula(value) == value


@pytest.mark.parametrize("name", ["a\\0b", 300 * "a", 5000 * "a/" + "b"], ids=["null", "long name", "long path"])
@pytest.mark.parametrize(
    "entry",
    [
        "mesh: {file: %s.msh}",
        "mesh: {file: %s.inp}",
        "mesh: {voxels: {surface: %s.stl, cell: 0.01}}",
        "mesh: {tets: {step: %s.step, size: 0.01}}",
        "skin: {file: %s.stl}",
        "obstacles: {wall: {mesh: {file: %s.stl}}}",
        "arm: {urdf: %s.urdf}",
    ],
)
def test_a_path_that_no_file_can_have_is_a_defect(name: str, entry: str) -> None:
    """A null character or a name that is too long is named, by each key with a path; it was an error of Python."""
    path, _, end = entry.partition("%s")
    suffix = end.partition("}")[0].partition(",")[0]
    text = f'{path}"/tmp/{name}{suffix}"{end.removeprefix(suffix)}'
    with pytest.raises(SceneError, match=r"no file can have this path: (File|embedded null)") as error:
        scene_from_text(text)
    assert len(str(error.value)) < 2000


def test_names_in_files_may_be_impossible(tmp_path: Path) -> None:
    """A scene's path, an include of Abaqus, and a mesh or package of a URDF that no file can have are not found."""
    with pytest.raises(SceneError, match="no file can have this path"):
        load_scene(f"{300 * 'a'}.yaml")
    with pytest.raises(MeshError, match="no file can have this path"):
        read_mesh(tmp_path / f"{300 * 'a'}.msh")
    (tmp_path / "a.inp").write_text(f"*Heading\n*Include, input={300 * 'a'}\n")
    with pytest.raises(MeshError, match="there is no such file"):
        read_mesh(tmp_path / "a.inp")
    for uri in (300 * "a", f"package://{300 * 'a'}/a.stl", "package://a/a%00.stl"):
        with pytest.raises(ArmError, match="the mesh is missing"):
            find_mesh(uri, folder=tmp_path, packages={})
    for uri in ("package://[a/a.stl", "file://[a"):
        with pytest.raises(ArmError, match="this is no URI"):
            find_mesh(uri, folder=tmp_path, packages={})


@pytest.mark.parametrize("package", ["evil; rm -rf x", "..", "", "a b", 300 * "a", "$(x)", "--index-url"])
def test_no_scene_puts_a_command_into_a_remedy(package: str) -> None:
    """The name of a package, which a remedy repeats after `pip install`, has only letters, digits, '.', '_' and '-'."""
    with pytest.raises(SceneError, match="allowed: the name of a Python package") as error:
        scene_from_text(f"arm: {{urdf: 'pip://{package}/a.urdf'}}")
    assert "pip install" not in str(error.value)


def _write_half(path: Path) -> None:
    with replacing(path) as written:
        written.write_text("half of")
        raise OSError(errno.ENOSPC, "No space left on device")


def test_a_file_that_cannot_be_written_to_its_end_stays_as_it_was(tmp_path: Path) -> None:
    """If the disk fills, the error names the file, the former file is whole, and nothing else is left."""
    path = tmp_path / "page.html"
    path.write_text("former")
    with pytest.raises(OSError, match=r"No space left on device: '.*page\.html'"):
        _write_half(path)
    assert path.read_text() == "former"
    with replacing(path) as written:
        assert written.suffix == ".html"
        written.write_text("new")
    assert path.read_text() == "new"
    assert list(tmp_path.iterdir()) == [path]
    with replacing(Path("/dev/null")) as written:
        assert written == Path("/dev/null")
