# SPDX-License-Identifier: Apache-2.0
"""Mesh files as gmsh and VTK write them are read wholly, or refused by their kind; right values are the libraries'."""

from __future__ import annotations

import itertools
import re
import struct
import time
from pathlib import Path

import gmsh
import numpy as np
import pytest
import pyvista
import trimesh
import vtk

from gdfe_ros.errors import MeshError
from gdfe_ros.mesh.files import importer
from gdfe_ros.mesh.files.importer import examine_mesh, read_mesh
from gdfe_ros.mesh.inspection import inspect_file
from gdfe_ros.mesh.quality import check_mesh

CASES = Path(__file__).parents[2] / "data" / "cases"


@pytest.mark.parametrize(
    ("name", "cells", "volume", "sets"),
    [
        ("gmsh/parametric_nodes.msh", 6, 1.25e-4, {}),
        ("gmsh/parametric_41.msh", 724, 2e-5, {"soft": 724, "base": 105}),
        ("gmsh/parametric_22.msh", 724, 2e-5, {"soft": 724, "base": 105}),
        ("gmsh/save_all_groups.msh", 724, 2e-5, {"soft": 724, "base": 105}),
        ("gmsh/msh40.msh", 724, 2e-5, {"soft": 724, "base": 105}),
        ("vtk/voxel.vtu", 20, 2e-5, {"material_1": 12, "material_2": 8}),
        ("vtk/voxel51.vtk", 20, 2e-5, {"material_1": 12, "material_2": 8}),
        ("vtk/one_int_CellData_51b.vtk", 724, 2e-5, {"material_1": 724}),
        ("vtk/hex42.vtk", 20, 2e-5, {"material_1": 12, "material_2": 8}),
        ("vtk/hex_appended_lz4.vtu", 20, 2e-5, {"material_1": 12, "material_2": 8}),
        ("abaqus/tets_C3D4H.inp", 724, 2e-5, {}),
    ],
)
def test_cases_of_mesh_files(name: str, cells: int, volume: float, sets: dict[str, int]) -> None:
    """Each case has the cells, the volume and the sets that its README states."""
    mesh, defects = examine_mesh(CASES / name)
    assert defects == []
    assert mesh.n_cells == cells
    assert check_mesh(mesh).volume == pytest.approx(volume, rel=1e-9)
    assert {key: len(ids) for key, ids in {**mesh.vertex_sets, **mesh.cell_sets}.items()} == sets


@pytest.fixture(scope="module")
def box() -> dict[str, float]:
    """Mesh two joined boxes in gmsh, with groups of which two overlap; return the numbers of cells of the groups."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    parts = [(3, gmsh.model.occ.addBox(x, 0, 0, 0.02, 0.02, 0.02)) for x in (0.0, 0.02)]
    gmsh.model.occ.fragment(parts[:1], parts[1:])
    gmsh.model.occ.synchronize()
    solids = [tag for _, tag in gmsh.model.getEntities(3)]
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.01)
    for name, tags in (("one", solids[:1]), ("both", solids)):
        gmsh.model.setPhysicalName(3, gmsh.model.addPhysicalGroup(3, tags), name)
    base = [tag for _, tag in gmsh.model.getEntitiesInBoundingBox(-1e-6, -1, -1, 1e-6, 1, 1, 2)]
    gmsh.model.setPhysicalName(2, gmsh.model.addPhysicalGroup(2, base), "base")
    gmsh.model.mesh.generate(3)
    count = [len(gmsh.model.mesh.getElementsByType(4, tag)[0]) for tag in solids]
    corners = set(gmsh.model.mesh.getElementsByType(2, base[0])[1].tolist())
    yield {"one": count[0], "both": sum(count), "base": len(corners)}
    gmsh.finalize()


VERSIONS = [row for row in itertools.product((2.2, 4.0, 4.1), (0, 1), (0, 1), (0, 1)) if row[:2] != (4.0, 1)]
"""Version of the format, whether it is binary, has parametric nodes, has all elements; gmsh writes 4.0 in ASCII only.
"""


@pytest.mark.parametrize(("version", "binary", "parametric", "every"), VERSIONS)
def test_files_of_gmsh(
    tmp_path: Path, box: dict[str, float], version: float, binary: int, parametric: int, every: int
) -> None:
    """Every version of gmsh's format has all cells and all groups, also elements in two groups."""
    options = {"MshFileVersion": version, "Binary": binary, "SaveParametric": parametric, "SaveAll": every}
    for key, value in options.items():
        gmsh.option.setNumber(f"Mesh.{key}", value)
    gmsh.write(str(tmp_path / "box.msh"))
    if version == 2.2 and not every:  # this format repeats an element for each of its groups
        mesh, defects = examine_mesh(tmp_path / "box.msh")
        assert any("repeat another cell" in text for text in defects)
        return
    mesh = read_mesh(tmp_path / "box.msh")
    assert mesh.n_cells == box["both"]
    assert check_mesh(mesh).volume == pytest.approx(1.6e-5, rel=1e-9)
    if version == 2.2:  # all elements saved have no groups in this format
        return
    assert {name: len(mesh.cell_sets[name]) for name in ("one", "both")} == {key: box[key] for key in ("one", "both")}
    assert np.abs(mesh.vertices[mesh.vertex_sets["base"], 0]).max() < 1e-9


def test_gmsh_version_1(tmp_path: Path, box: dict[str, float]) -> None:
    """The format of gmsh 1 is read, too; it has numbers of groups instead of names."""
    gmsh.option.setNumber("Mesh.MshFileVersion", 1.0)
    gmsh.option.setNumber("Mesh.SaveParametric", 0)
    gmsh.option.setNumber("Mesh.Binary", 0)
    gmsh.option.setNumber("Mesh.SaveAll", 1)
    gmsh.write(str(tmp_path / "box.msh"))
    assert read_mesh(tmp_path / "box.msh").n_cells == box["both"]


def grid(kind: str) -> vtk.vtkDataSet:
    """Return a grid of 5 x 2 x 2 cells of 1 cm of a kind, with a whole number for each cell."""
    image = pyvista.ImageData(dimensions=(6, 3, 3), spacing=(0.01, 0.01, 0.01))
    image.cell_data["material"] = np.where(np.arange(20) % 5 < 3, 1, 2)
    image.cell_data["temperature"] = np.linspace(0.0, 1.0, 20)
    if kind == "image":
        return image
    if kind == "structured":
        return image.cast_to_structured_grid()
    if kind == "rectilinear":
        return image.cast_to_rectilinear_grid()
    if kind == "voxel":
        return image.cast_to_unstructured_grid()
    cells = image.cast_to_structured_grid().cast_to_unstructured_grid()
    if kind == "lagrange":
        lattice = pyvista.UnstructuredGrid(cells.cells, np.full(20, 72, np.uint8), cells.points)
        lattice.cell_data["material"] = cells.cell_data["material"]
        return lattice
    return cells


def _assert_grid(path: Path) -> None:
    mesh = read_mesh(path)
    assert mesh.n_cells == 20
    assert check_mesh(mesh).volume == pytest.approx(2e-5, rel=1e-6)
    assert {key: len(ids) for key, ids in mesh.cell_sets.items()} == {"material_1": 12, "material_2": 8}


def write_legacy(path: Path, kind: str, *, binary: bool, version: int, wide: bool = True) -> None:
    """Write a legacy file by VTK."""
    data = grid(kind)
    if not wide:
        data.cell_data["material"] = data.cell_data["material"].astype(np.int8)
    writer = vtk.vtkDataSetWriter()
    writer.SetInputData(data)
    writer.SetFileName(str(path))
    writer.SetFileType(2 if binary else 1)
    writer.SetFileVersion(version)
    writer.Write()


@pytest.mark.parametrize(
    ("kind", "binary", "version", "wide"),
    [(kind, binary, version, True) for kind in ("voxel", "hexahedron", "lagrange", "image", "structured", "rectilinear")
     for binary in (False, True) for version in (42, 51)] + [("hexahedron", True, 51, False)],
)  # fmt: skip
def test_legacy_files_of_vtk(tmp_path: Path, kind: str, binary: bool, version: int, wide: bool) -> None:
    """Legacy files of each kind of grid have 20 hexahedra, and the whole numbers as sets."""
    write_legacy(tmp_path / "bar.vtk", kind, binary=binary, version=version, wide=wide)
    _assert_grid(tmp_path / "bar.vtk")


COMPRESSORS = {"none": None, "zlib": vtk.vtkZLibDataCompressor, "lz4": vtk.vtkLZ4DataCompressor,
               "lzma": vtk.vtkLZMADataCompressor}  # fmt: skip


@pytest.mark.parametrize("suffix", [".vtu", ".vtk"])
@pytest.mark.parametrize("compressor", list(COMPRESSORS))
@pytest.mark.parametrize("mode", [0, 1, 2])
def test_xml_files_of_vtk(tmp_path: Path, mode: int, compressor: str, suffix: str) -> None:
    """XML files in ASCII, binary and appended form with each compression are read, also under the suffix .vtk."""
    writer = vtk.vtkXMLUnstructuredGridWriter()
    writer.SetInputData(grid("voxel" if mode == 1 else "hexahedron"))
    writer.SetFileName(str(tmp_path / f"bar{suffix}"))
    writer.SetDataMode(mode)
    kind = COMPRESSORS[compressor]
    writer.SetCompressor(kind() if kind else None)
    writer.Write()
    _assert_grid(tmp_path / f"bar{suffix}")


def test_cells_of_two_kinds_are_not_left_out(tmp_path: Path) -> None:
    """A file of which meshio skips the voxels has all of its cells."""
    voxels, others = grid("voxel"), grid("hexahedron")
    others.points[:, 0] += 0.05
    joined = pyvista.merge([voxels, others], merge_points=True)
    joined.save(tmp_path / "both.vtu")
    assert read_mesh(tmp_path / "both.vtu").n_cells == 40


@pytest.mark.parametrize("keep", [0.2, 0.5, 0.8, 0.95])
@pytest.mark.parametrize("name", ["gmsh/msh40.msh", "gmsh/parametric_41.msh", "vtk/voxel.vtu", "vtk/voxel51.vtk",
                                  "vtk/one_int_CellData_51b.vtk", "vtk/hex_appended_lz4.vtu"])  # fmt: skip
def test_a_file_that_is_cut_off_is_refused_soon(tmp_path: Path, name: str, keep: float) -> None:
    """A file that is cut off is refused with a remedy, without the text of a Python error, in less than 10 s."""
    whole = (CASES / name).read_bytes()
    path = tmp_path / Path(name).name
    path.write_bytes(whole[: int(keep * len(whole))])
    began = time.monotonic()
    try:
        mesh, defects = examine_mesh(path)
    except MeshError as error:
        defects = error.defects
    else:
        assert mesh.n_cells in (20, 724)  # all cells are there; what is cut off are data that make no sets
    assert time.monotonic() - began < 10.0
    for text in defects:
        assert "remedy" in text
        assert not re.search(r"[a-z]Error\b|Traceback|NoneType|0x[0-9a-f]", text)


def test_files_with_a_wrong_suffix_are_read_by_their_first_bytes(tmp_path: Path) -> None:
    """A file of gmsh under the suffix of Abaqus, and one of VTK under that of gmsh, are read."""
    for name, other in (("gmsh/msh40.msh", "a.inp"), ("vtk/voxel51.vtk", "b.msh")):
        (tmp_path / other).write_bytes((CASES / name).read_bytes())
        assert read_mesh(tmp_path / other).n_cells in (20, 724)


def test_groups_without_names_are_told_where_gmsh_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without gmsh, meshio's content of a file of version 4.0 has a remark on elements in several groups."""
    doubtful = importer.RawMesh(points=np.zeros((0, 3)), cells=[])
    monkeypatch.setattr(importer, "find_spec", lambda _: None)
    monkeypatch.setattr(importer, "_by_meshio", lambda *_: doubtful)
    raw = importer.read_file(CASES / "gmsh" / "msh40.msh", "mesh")
    assert raw.remarks == [
        "elements with several physical groups are in the first one only; remedy: pip install 'gdfe_ros[cad]', or give "
        "each group a name"
    ]


def _damaged() -> dict[str, tuple[bytes, str]]:
    """Return a dict from the name of a damaged file of a box's surface to its bytes and a part of the defect."""
    box = trimesh.creation.box([0.02] * 3)
    stl, ply = box.export(file_type="stl"), box.export(file_type="ply")
    text, obj, off = (box.export(file_type=kind).encode() for kind in ("stl_ascii", "obj", "off"))
    counts = (0, 5, 13, 2**32 - 1)
    found = {f"count{n}.stl": (stl[:80] + struct.pack("<I", n) + stl[84:], f"states {n} tri") for n in counts}
    found |= {f"cut{n}.stl": (stl[:n], "states 12 triangles") for n in (84, 100, 400)}
    found |= {f"short{n}.stl": (stl[:n], "no triangles") for n in (0, 50)}
    found["nan.stl"] = stl[:96] + struct.pack("<f", float("nan")) + stl[100:], "not finite"
    found["text.stl"] = b"hello world\n", "no triangles"
    found["words.stl"] = text.replace(b"vertex", b"vortex"), "no triangles"
    found["zeros.stl"] = bytes(1000), "states 0 triangles"
    found["cut.ply"], found["cut.off"] = ((data[: len(data) // 2], "does not fit its kind") for data in (ply, off))
    found["corner.obj"] = obj.replace(b"f ", b"f 99 ", 1), "does not fit its kind"
    found["cut.obj"] = obj[: len(obj) // 3], "no triangles"
    return found


@pytest.mark.parametrize("name", _damaged())
def test_a_damaged_surface_is_told(tmp_path: Path, name: str) -> None:
    """A surface whose file is cut off or wrong is refused by what it is, with a remedy, and no error of Python."""
    data, said = _damaged()[name]
    (tmp_path / name).write_bytes(data)
    (defect,) = inspect_file(tmp_path / name).defects
    assert said in defect
    assert "remedy" in defect
    assert "Error" not in defect
