# SPDX-License-Identifier: Apache-2.0
"""Hexahedral meshes are read from files with their sets; broken files give clear messages."""

from __future__ import annotations

import re
from pathlib import Path

import meshio
import numpy as np
import pytest

from gdfe_ros.errors import MeshError
from gdfe_ros.mesh import HexMesh, bar, select_cells, select_vertices
from gdfe_ros.mesh.files.importer import read_mesh
from gdfe_ros.mesh.selection import Where
from test.mesh.files.test_abaqus import NODES

BAR = bar([0.2, 0.05, 0.05], [4, 2, 2])
LEFT = np.flatnonzero(BAR.centroids[:, 0] < 0.1)
GRIP = np.flatnonzero(BAR.vertices[:, 0] == 0.0)

INP = f"""*Heading
one cell
{NODES}99, 5, 5, 5
*Element, type=C3D8R, elset=body
20, 1, 2, 3, 4, 5, 6, 7, 8
*Nset, nset=grip, generate
1, 4, 3
*Elastic
1.0, 0.45
"""


def write(path: Path, mesh: HexMesh = BAR, **extra: object) -> Path:
    """Write hexahedra with meshio."""
    meshio.Mesh(mesh.vertices, [("hexahedron", mesh.cells)], **extra).write(path)
    return path


def assert_bar(mesh: HexMesh) -> None:
    """Require that a mesh is the bar that was written."""
    np.testing.assert_allclose(mesh.vertices, BAR.vertices, atol=1e-9)
    np.testing.assert_array_equal(mesh.cells, BAR.cells)


@pytest.mark.parametrize("name", ["bar.vtk", "bar.vtu", "bar.inp"])
def test_vertices_and_cells_survive_a_file(tmp_path: Path, name: str) -> None:
    """Vertices and cells are read back in the order in which meshio wrote them."""
    assert_bar(read_mesh(write(tmp_path / name)))


@pytest.mark.parametrize("name", ["bar.vtk", "bar.vtu"])
def test_whole_number_data_become_sets(tmp_path: Path, name: str) -> None:
    """Whole-number cell data become sets region_1, region_2, point data grip_1; real numbers do not."""
    region = np.full(BAR.n_cells, 2)
    region[LEFT] = 1
    grip = np.zeros(BAR.n_vertices, dtype=int)
    grip[GRIP] = 1
    path = write(tmp_path / name, cell_data={"region": [region], "stress": [region * 0.5]}, point_data={"grip": grip})
    mesh = read_mesh(path)
    assert sorted(mesh.cell_sets) == ["region_1", "region_2"]
    np.testing.assert_array_equal(select_cells(mesh, Where(set="region_1")), LEFT)
    assert list(mesh.vertex_sets) == ["grip_1"]
    np.testing.assert_array_equal(select_vertices(mesh, Where(set="grip_1")), GRIP)


def test_physical_groups_of_gmsh_2_become_sets(tmp_path: Path) -> None:
    """Gmsh 2's volumes become sets by physical name, faces vertex sets, and unnamed groups have their number."""
    region = np.full(BAR.n_cells, 2)
    region[LEFT] = 1
    quads = BAR.surface()[np.isin(BAR.surface(), GRIP).all(axis=1)]
    tags = [region, np.full(len(quads), 3)]
    raw = meshio.Mesh(
        BAR.vertices,
        [("hexahedron", BAR.cells), ("quad", quads)],
        cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags},
        field_data={"left": np.array([1, 3]), "grip": np.array([3, 2])},
    )
    meshio.write(tmp_path / "bar.msh", raw, file_format="gmsh22")
    mesh = read_mesh(tmp_path / "bar.msh")
    assert_bar(mesh)
    assert sorted(mesh.cell_sets) == ["left", "physical_2"]
    np.testing.assert_array_equal(mesh.cell_sets["left"], LEFT)
    np.testing.assert_array_equal(mesh.vertex_sets["grip"], GRIP)


def test_abaqus_sets_become_sets_and_unused_nodes_go(tmp_path: Path) -> None:
    """Abaqus element sets, and node sets with generate, are read; a node without an element is dropped."""
    (tmp_path / "one.inp").write_text(INP)
    mesh = read_mesh(tmp_path / "one.inp")
    assert mesh.n_vertices == 8
    assert {name: ids.tolist() for name, ids in mesh.cell_sets.items()} == {"body": [0]}
    assert {name: ids.tolist() for name, ids in mesh.vertex_sets.items()} == {"grip": [0, 3]}


def test_millimetres_are_scaled(tmp_path: Path) -> None:
    """A bar of 200 mm is read with scale 0.001."""
    path = write(tmp_path / "bar.vtu", HexMesh(BAR.vertices * 1000, BAR.cells))
    assert_bar(read_mesh(path, scale=0.001))
    assert read_mesh(path, scale=1.0).size == pytest.approx(BAR.size * 1000)


def test_coincident_vertices_are_merged_on_request(tmp_path: Path) -> None:
    """On request, two bars are merged at their common face."""
    two = HexMesh(
        np.vstack([BAR.vertices, BAR.vertices + np.array([0.2, 0, 0])]), np.vstack([BAR.cells, BAR.cells + 45])
    )
    path = write(tmp_path / "two.vtu", two)
    with pytest.raises(MeshError, match=r"18 vertices at the same place .*merge: true"):
        read_mesh(path)
    assert read_mesh(path, merge=True).n_vertices == 2 * 45 - 9


def test_second_order_hexahedra_give_their_corners_on_request(tmp_path: Path) -> None:
    """On request, second-order hexahedra are reduced to their eight corners."""
    middles = np.linspace(0, 0.01, 36).reshape(12, 3)
    vertices, cell = np.vstack([BAR.vertices[BAR.cells[0]], middles]), np.arange(20)[None]
    meshio.Mesh(vertices, [("hexahedron20", cell)]).write(tmp_path / "second.vtu")
    assert read_mesh(tmp_path / "second.vtu", first_order=True).n_vertices == 8


def mixed(path: Path) -> None:
    """Write hexahedra and a wedge."""
    cells = [("hexahedron", BAR.cells), ("wedge", BAR.cells[:1, [0, 1, 3, 4, 5, 7]])]
    meshio.Mesh(BAR.vertices, cells).write(path)


def second_order(path: Path) -> None:
    """Write a 20-node hexahedron."""
    meshio.Mesh(np.random.default_rng(0).random((20, 3)), [("hexahedron20", np.arange(20)[None])]).write(path)


def surface(path: Path) -> None:
    """Write triangles only."""
    meshio.Mesh(np.eye(3), [("triangle", [[0, 1, 2]])]).write(path)


def moved(change: object) -> object:
    """Write the bar with changed vertices or cells."""

    def make(path: Path) -> None:
        vertices, cells = BAR.vertices.copy(), BAR.cells.copy()
        change(vertices, cells)
        write(path, HexMesh(vertices, cells))

    return make


BROKEN = [
    ("mixed.vtu", mixed, r"1 cells of the kind wedge; allowed: 8-vertex hexahedra"),
    ("second.vtu", second_order, r"1 cells of the kind hexahedron20; .*first_order: true"),
    ("surface.vtk", surface, r"no hexahedra and no tetrahedra, only: 1 triangle; .*fill its surface"),
    (
        "line.vtu",
        lambda p: meshio.Mesh(np.eye(3), [("line", [[0, 1]])]).write(p),
        r"no hexahedra and no tetrahedra, only: 1 line",
    ),
    ("mm.vtu", moved(lambda v, c: v.__imul__(1000)), r"diagonal is 212.* in mm: give `scale: 0.001`"),
    ("nan.vtu", moved(lambda v, c: v.__setitem__((7, 1), np.nan)), r"1 vertices .*not finite: 7"),
    ("inverted.vtu", moved(lambda v, c: c.__setitem__(5, c[5, [4, 5, 6, 7, 0, 1, 2, 3]])), r"inside out: 5"),
    ("all.vtu", moved(lambda v, c: c.__setitem__(..., c[:, [3, 2, 1, 0, 7, 6, 5, 4]])), r"every cell is inside.*swap"),
    ("folded.vtu", moved(lambda v, c: v.__setitem__(0, v[0] + 0.02)), r"1 cells that are folded at a corner.*: 0"),
    ("again.vtu", moved(lambda v, c: c.__setitem__(3, c[2])), r"1 cells that repeat another cell: 3"),
    ("text.vtu", lambda p: p.write_text("this is not xml"), r"cannot be read as .vtu"),
    (
        "element.inp",
        lambda p: p.write_text(INP.replace("C3D8R", "C3D77")),
        r"elements of type C3D77; allowed: C3D4, C3D8, C3D10",
    ),
    (
        "node.inp",
        lambda p: p.write_text(INP.replace("20, 1, 2,", "20, 1, 77,")),
        r"element 20 has the node 77, which is",
    ),
    ("empty.msh", lambda p: p.write_text(""), r"the file is empty; remedy"),
    ("body.step", lambda p: p.write_text("ISO-10303"), r"unknown kind of file '.step'; allowed: .msh, .vtk"),
    ("none.msh", lambda p: None, r"there is no such file"),
]


@pytest.mark.parametrize(("name", "make", "expected"), BROKEN)
def test_broken_files_get_clear_messages(tmp_path: Path, capfd: object, name: str, make: object, expected: str) -> None:
    """A broken file gives one line with the defect and a remedy, and the reader itself prints nothing."""
    make(tmp_path / name)
    capfd.readouterr()
    with pytest.raises(MeshError) as caught:
        read_mesh(tmp_path / name)
    assert len(caught.value.defects) == 1, caught.value
    assert re.search(expected, caught.value.defects[0]), caught.value
    assert str(caught.value).startswith(f"mesh {tmp_path / name}: 1 defect")
    assert capfd.readouterr() == ("", "")


def test_a_file_cut_off_anywhere_gives_a_mesh_or_a_mesh_error(tmp_path: Path) -> None:
    """A file cut off anywhere gives a mesh or a MeshError, and no other exception."""
    outcomes = set()
    for length in range(0, len(INP), 3):
        (tmp_path / "cut.inp").write_text(INP[:length])
        try:
            outcomes.add(read_mesh(tmp_path / "cut.inp").n_cells)
        except MeshError:
            outcomes.add(MeshError)
    assert outcomes == {MeshError, 1}
