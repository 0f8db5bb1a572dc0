# SPDX-License-Identifier: Apache-2.0
"""Inspection reports a file's content and raises nothing."""

from __future__ import annotations

import re
from pathlib import Path

import meshio
import pytest
import trimesh

from gdfe_ros.mesh import bar
from gdfe_ros.mesh.files.mesh_input import guess_unit, unit_defects
from gdfe_ros.mesh.generators import cut
from gdfe_ros.mesh.inspection import inspect_file
from gdfe_ros.mesh.selection import BoxSelection, Where
from gdfe_ros.mesh.tetmesh import divide


def test_a_hollow_block_is_described(tmp_path: Path) -> None:
    """The report of a hollow block has counts, bounds, quality and the cavity."""
    body = cut(
        bar([0.05, 0.05, 0.05], [5, 5, 5]), [Where(box=BoxSelection((0.01, 0.04), (-0.015, 0.015), (-0.015, 0.015)))]
    )
    meshio.Mesh(body.vertices, [("hexahedron", body.cells)]).write(tmp_path / "block.vtu")
    found = inspect_file(tmp_path / "block.vtu")
    assert (found.defects, found.mesh.n_cells) == ([], 98)
    assert set(found.facts) >= {
        ("vertices, cells", "208, 98"),
        ("least scaled Jacobian", "1"),
        ("inverted or flat cells", "0"),
        ("disconnected parts", "1"),
        ("cavities", "2.7e-05 m^3"),
    }


def test_defects_are_findings(tmp_path: Path) -> None:
    """Defects are reported for a file in millimetres, an open surface and a missing file."""
    body = bar([200, 50, 50], [4, 1, 1])
    meshio.Mesh(body.vertices, [("hexahedron", body.cells)]).write(tmp_path / "mm.vtu")
    found = inspect_file(tmp_path / "mm.vtu")
    assert dict(found.facts)["unit, a guess from the size"] == "mm"
    assert "scale: 0.001" in found.defects[0]
    assert inspect_file(tmp_path / "mm.vtu", scale=0.001).defects == []
    (tmp_path / "open.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    assert "the surface is open" in inspect_file(tmp_path / "open.obj").defects[0]
    assert "no such file" in inspect_file(tmp_path / "none.msh").defects[0]


def test_a_surface_is_described(tmp_path: Path) -> None:
    """The report of an STL file has its bodies and cavities, and a suggested cell size."""
    box, ball = trimesh.creation.box((0.1, 0.06, 0.04)), trimesh.creation.icosphere(radius=0.012)
    trimesh.util.concatenate([box, ball]).export(tmp_path / "a.stl")
    facts = dict(inspect_file(tmp_path / "a.stl").facts)
    assert facts["bodies, cavities"] == "1, 1"
    assert facts["a first cell size"] == "0.0025 m"


def test_cheaper_hexahedra_are_named(tmp_path: Path) -> None:
    """A box, a body with axis-parallel faces and an extruded one name hexahedra; a ball, or few cells, do not."""
    angle = cut(bar([0.06, 0.04, 0.02], [6, 4, 2]), [Where(box=BoxSelection((0.03, 0.06), (0.0, 0.02)))])
    triangles = angle.boundary.quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    box = trimesh.creation.box((0.1, 0.02, 0.02))
    for name, body, told in (
        ("box", box, r"the body is a box\..*`mesh: {bar: {size: \[0.1, 0.02, 0.02\], cells: \[20, 4, 4\]}}`"),
        ("angle", trimesh.Trimesh(angle.vertices, triangles), "bounded by planes across the axes.*in `cut`"),
        ("rod", trimesh.creation.cylinder(radius=0.01, height=0.1), "extruded along z"),
        ("ball", trimesh.creation.icosphere(radius=0.02), "^$"),
    ):
        body.export(tmp_path / f"{name}.stl")
        assert re.search(told, " ".join(inspect_file(tmp_path / f"{name}.stl").remarks)), name
    assert inspect_file(tmp_path / "box.stl", size=0.02).remarks == []


@pytest.mark.parametrize(("size", "unit"), [(0.1, "m"), (1.0, "m"), (80.0, "mm"), (300.0, "mm"), (1e5, "um")])
def test_the_unit_is_guessed_from_the_size(size: float, unit: str) -> None:
    """The guessed unit makes the body as large as a hand; a defect is told if it is no metre and no scale is given."""
    assert guess_unit(size) == unit
    assert bool(unit_defects(size, None)) == (unit != "m")
    assert not unit_defects(size, 1.0)


def test_no_scale_is_suggested_that_is_implausible_too() -> None:
    """A body of 35 m in micrometres is not suggested to be in micrometres."""
    (defect,) = unit_defects(3.5e7, None)
    assert "remedy: check its unit" in defect
    assert "seems to be in" not in defect


def test_thin_walls_of_a_surface_are_compared_with_a_size(tmp_path: Path) -> None:
    """Walls of a surface in millimetres are compared with the size in metres; the default is that of ``gdfe new``."""
    trimesh.creation.box((90.0, 60.0, 1.0)).export(tmp_path / "plate.stl")
    found = inspect_file(tmp_path / "plate.stl", scale=0.001, size=0.003)
    assert dict(found.facts)["surface at walls thinner than 0.003 m"] == "97.3%"
    assert found.remarks == []
    found = inspect_file(tmp_path / "plate.stl", scale=0.001)
    assert dict(found.facts)["surface at walls thinner than 0.006 m"] == "97.3%"
    assert "least_size: 0.001" in found.remarks[0]


def test_a_step_file_is_inspected_like_a_surface(walled: Path) -> None:
    """The report of a STEP file has its solids, self-intersections and thin walls."""
    found = inspect_file(walled, size=0.005)
    facts = dict(found.facts)
    assert facts["solids, surfaces"] == "1, 8"
    assert facts["pairs of triangles that cut each other"] == "0"
    assert facts["thinnest wall"].startswith("0.001 m near (")
    assert found.defects == []
    assert "38% of the surface" in found.remarks[0]


def test_a_step_file_of_implausible_size_is_told(walled: Path) -> None:
    """A STEP file whose unit is a metre instead of a millimetre has a defect with the usual range."""
    text = walled.read_text()
    assert "SI_UNIT(.MILLI.,.METRE.)" in text
    walled.write_text(text.replace("SI_UNIT(.MILLI.,.METRE.)", "SI_UNIT($,.METRE.)"))
    (defect,) = inspect_file(walled).defects
    assert "the body's diagonal is 33.1" in defect
    assert "0.0001 to 3 m; remedy: export it again" in defect


def test_a_mesh_with_flat_cells_is_remarked(tmp_path: Path) -> None:
    """A mesh file with one layer of flat tetrahedra has a remark and no defect."""
    body = divide(bar([0.1, 0.1, 0.001], [10, 10, 1]))
    meshio.Mesh(body.vertices, [("tetra10", body.cells)]).write(tmp_path / "plate.vtu")
    found = inspect_file(tmp_path / "plate.vtu")
    assert found.defects == []
    assert "14 times as long as the wall is thick" in found.remarks[0]


@pytest.mark.parametrize("value", ["nan", "inf"])
def test_a_vertex_that_is_not_finite_is_a_defect(value: str, tmp_path: Path) -> None:
    """A surface with a NaN or infinite coordinate has a defect that names the vertex and the coordinate."""
    (tmp_path / "a.obj").write_text(f"v 0 0 0\nv 1 {value} 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 3 4\n")
    (defect,) = inspect_file(tmp_path / "a.obj").defects
    assert f"the first: y = {value} of vertex 1 (in triangle 0)" in defect
