# SPDX-License-Identifier: Apache-2.0
"""Abaqus input files: parts, instances at their places, sets, includes; what is left out is told."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gdfe_ros.errors import MeshError
from gdfe_ros.mesh.files.importer import examine_mesh, read_mesh
from gdfe_ros.mesh.quality import check_mesh

CASES = Path(__file__).parents[2] / "data" / "cases" / "abaqus"

NODES = """*Node
1, 0, 0, 0
2, 0.01, 0, 0
3, 0.01, 0.01, 0
4, 0, 0.01, 0
5, 0, 0, 0.02
6, 0.01, 0, 0.02
7, 0.01, 0.01, 0.02
8, 0, 0.01, 0.02
"""
CELL = "*Element, type=C3D8\n1, 1, 2, 3, 4, 5, 6, 7, 8\n"
PART = f"*Part, name=Brick\n{NODES}{CELL}*Nset, nset=low\n1, 2, 3, 4\n*End Part\n"


def assembly(*instances: str, more: str = "") -> str:
    """Return the text of a file with instances of the brick; each text is the data of an instance."""
    placed = "".join(f"*Instance, name=i{k}, part=BRICK\n{rows}*End Instance\n" for k, rows in enumerate(instances))
    return f"*Heading\n{PART}*Assembly, name=A\n{placed}{more}*End Assembly\n"


def read(tmp_path: Path, text: str) -> object:
    """Write a text as an input file and read it."""
    (tmp_path / "job.inp").write_text(text)
    return read_mesh(tmp_path / "job.inp")


def test_the_case_of_a_moved_instance() -> None:
    """The instance is moved by 0.1 m."""
    mesh = read_mesh(CASES / "moved_instance.inp")
    np.testing.assert_allclose(mesh.bounds, [[0.1, 0.0, 0.0], [0.15, 0.02, 0.02]], atol=1e-15)
    assert len(mesh.vertex_sets["BASE"]) == 9


def test_the_case_of_two_instances() -> None:
    """The second copy is moved by 0.05 m in y, and turned by 90 degrees about z there."""
    mesh = read_mesh(CASES / "two_instances.inp")
    assert mesh.n_cells == 40
    first, second = (np.unique(mesh.cells[mesh.cell_sets[f"BODY-{k}"]]) for k in (1, 2))
    np.testing.assert_allclose(np.ptp(mesh.vertices[first], axis=0), [0.05, 0.02, 0.02], atol=1e-15)
    low, high = mesh.vertices[second].min(axis=0), mesh.vertices[second].max(axis=0)
    np.testing.assert_allclose([low, high], [[-0.02, 0.05, 0.0], [0.0, 0.1, 0.02]], atol=1e-12)
    assert len(mesh.cell_sets["Set-1"]) == 40


OF_BOTH = "*Nset, nset=a, instance=i0\n1, 2\n*Nset, nset=a, instance=i1\n3\n"
MOVED = "0.1, 0.2, 0.3\n"
TURNED = "0.1, 0., 0.\n0.1, 0., 0., 0.1, 0., 1., 90.\n"
PLACED = [
    ((MOVED,), [[0.1, 0.2, 0.3], [0.11, 0.21, 0.32]]),
    (("0.1\n",), [[0.1, 0.0, 0.0], [0.11, 0.01, 0.02]]),
    ((TURNED,), [[0.09, 0.0, 0.0], [0.1, 0.01, 0.02]]),
    (("0, 0, 0\n0, 0, 0, 0, 1, 0, 180.\n",), [[-0.01, 0.0, -0.02], [0.0, 0.01, 0.0]]),
    (("0, 0, 0\n0.5, 0, 0, 0.5, 0, 2, -90\n",), [[0.5, 0.49, 0.0], [0.51, 0.5, 0.02]]),
    (("0., 0., 0.\n1., 1., 1., 2., 2., 2., 120.\n",), [[0.0, 0.0, 0.0], [0.02, 0.01, 0.01]]),
    (("", MOVED), [[0.0, 0.0, 0.0], [0.11, 0.21, 0.32]]),
    (("", MOVED, TURNED), [[0.0, 0.0, 0.0], [0.11, 0.21, 0.32]]),
    (("0, 0, 0\n0, 0, 0, 1, 0, 0, 90.\n",), [[0.0, -0.02, 0.0], [0.01, 0.0, 0.01]]),
    (("-0.5, 0, 0\n-0.5, 0, 0, -0.5, 0, -1, 90.\n",), [[-0.5, -0.01, 0.0], [-0.49, 0.0, 0.02]]),
    ((MOVED, MOVED.replace("0.1", "0.2"), "0., 0., 1.\n"), [[0.0, 0.0, 0.3], [0.21, 0.21, 1.02]]),
]


@pytest.mark.parametrize(("instances", "bounds"), PLACED)
def test_instances_are_placed(tmp_path: Path, instances: tuple[str, ...], bounds: list[list[float]]) -> None:
    """Each instance is moved, and then turned about its axis."""
    mesh = read(tmp_path, assembly(*instances))
    assert mesh.n_cells == len(instances)
    np.testing.assert_allclose(mesh.bounds, bounds, atol=1e-12)
    assert check_mesh(mesh).volume == pytest.approx(len(instances) * 2e-6)


@pytest.mark.parametrize(
    ("text", "sets"),
    [
        (assembly("", more="*Nset, nset=top, instance=i0\n5, 6,\n7, 8\n"), {"low": 4, "top": 4}),
        (assembly("", more="*Nset, nset=top, instance=I0, generate\n5, 8, 1\n"), {"low": 4, "top": 4}),
        (assembly("", more="*Nset, nset=all, instance=i0\nlow, 5, 6\n"), {"low": 4, "all": 6}),
        (assembly("", MOVED, more="*Nset, nset=ends\ni0.1, i1.low\n"), {"low": 8, "ends": 5}),
        (
            assembly("", more="*Elset, elset=e, instance=i0\n1\n*Nset, nset=n, instance=i0, elset=e\n"),
            {"low": 4, "n": 8},
        ),
        (assembly("", MOVED, more=OF_BOTH + "*Nset, nset=b\na\n"), {"low": 8, "a": 3, "b": 3}),
        (NODES + CELL + '*Nset, nset="my nodes"\n 1,2 ,\n', {"my nodes": 2}),
        (NODES.replace("*Node", "*NODE, NSET=every") + CELL, {"every": 8}),
        (NODES + CELL + "*NSET, NSET=odd, GENERATE\n1, 7, 2\n", {"odd": 4}),
        (NODES + CELL + "*Nset, nset=twice\n1, 2\n*Nset, nset=twice\n2, 3,\n", {"twice": 3}),
        (NODES + CELL + "*Nset, nset=unordered, unsorted\n8, 1, 8\n 3\n", {"unordered": 3}),
        (NODES + CELL + "*Nset, nset=both\n1\n*Nset, nset=more\nboth, 4\n", {"both": 1, "more": 2}),
    ],
)
def test_sets_of_nodes(tmp_path: Path, text: str, sets: dict[str, int]) -> None:
    """Sets of parts, of the assembly, of sets, of elements and of ranges have their nodes."""
    assert {name: len(ids) for name, ids in read(tmp_path, text).vertex_sets.items()} == sets


def test_parts_of_two_kinds_of_numbering_are_both_there(tmp_path: Path) -> None:
    """Two parts with the same numbers of nodes are two bodies, and a part without an instance is told."""
    other = PART.replace("Brick", "Other").replace("0.02", "0.05")
    text = PART + other + "*Assembly, name=A\n*Instance, name=x, part=Brick\n*End Instance\n"
    both = text + "*Instance, name=y, part=OTHER\n1., 0., 0.\n*End Instance\n*End Assembly\n"
    assert check_mesh(read(tmp_path, both)).volume == pytest.approx(2e-6 + 5e-6)
    alone = read(tmp_path, text + "*End Assembly\n")
    assert alone.n_cells == 1
    assert alone.remarks == ("part OTHER has no instance and is left out",)


@pytest.mark.parametrize(
    "kind", ["C3D8", "C3D8R", "C3D8H", "C3D8RH", "C3D8I", "C3D8IH", "C3D8T", "c3d8rt", "C3D8P", "AC3D8", "DC3D8"]
)
def test_variants_of_an_element(tmp_path: Path, kind: str) -> None:
    """Hybrid, reduced and coupled variants of an element have its shape."""
    assert read(tmp_path, NODES + CELL.replace("C3D8", kind)).n_cells == 1


def test_includes_comments_and_long_lines(tmp_path: Path) -> None:
    """Included files, comments between data, keywords in two lines and elements in two lines are read."""
    (tmp_path / "nodes.inc").write_text(NODES)
    cell = "*Element,\n elset=all, type=C3D8\n1, 1, 2, 3, 4,\n** a comment\n5, 6, 7, 8\n"
    mesh = read(tmp_path, f"*Heading\n 3 bricks\n*Include, input=nodes.inc\n{cell}")
    assert mesh.n_cells == 1
    assert len(mesh.cell_sets["all"]) == 1


def test_data_in_other_files_and_fortran_numbers_are_read(tmp_path: Path) -> None:
    """Nodes and elements whose data are in files of their own are read, with exponents D."""
    (tmp_path / "nodes.txt").write_text(NODES.partition("\n")[2].replace("0.02", "2.0D-2"))
    (tmp_path / "cells.txt").write_text("1, 1, 2, 3, 4, 5, 6, 7, 8\n")
    mesh = read(tmp_path, "*Node, input=nodes.txt\n*Element, type=C3D8, input=cells.txt\n")
    assert check_mesh(mesh).volume == pytest.approx(2e-6)


def test_nodes_in_an_instance_are_its_own(tmp_path: Path) -> None:
    """An independent instance lists its nodes and elements itself."""
    text = (
        f"*Part, name=P\n*End Part\n*Assembly, name=A\n*Instance, name=i, part=P\n{MOVED}{NODES}{CELL}*End Instance\n"
    )
    np.testing.assert_allclose(read(tmp_path, text).bounds[0], [0.1, 0.2, 0.3])


def test_elements_that_are_no_solids_are_told(tmp_path: Path) -> None:
    """Shells, springs and points of mass beside solids are left out with a remark."""
    shells = "*Element, type=S4R\n7, 1, 2, 3, 4\n*Element, type=MASS\n8, 1\n"
    assert read(tmp_path, NODES + CELL + shells).remarks == (
        "1 elements of type S4R are left out, because they are no solids",
        "1 elements of type MASS are left out, because they are no solids",
    )


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (NODES + "*Ngen\n1, 8, 1\n" + CELL, r"line 10: \*Ngen is not read; remedy: a file in which all nodes"),
        (NODES.replace("*Node", "*Node, system=C") + CELL, "nodes in cylindrical or spherical coordinates"),
        ("*Instance, name=i, part=P\n*End Instance\n", "the part 'P', which this file does not contain; remedy"),
        ("*Include, input=not.inc\n", "Include of 'not.inc': there is no such file; remedy: put it beside"),
        ("*Node, input=not.txt\n", "Node of 'not.txt': there is no such file; remedy: put it beside"),
        ("*Include, input=job.inp\n", "Include of 'job.inp': it includes itself"),
        (PART + PART.replace("Brick", "Other"), "the parts BRICK, OTHER have no instance; remedy"),
        (NODES + CELL.replace("7, 8", "7"), "element 1 of type C3D8 has 7 nodes; allowed: 8; the file seems cut off"),
        (NODES.replace("0.01", "0.x1") + CELL, r"line 1: the data of \*NODE cannot be read as numbers and names"),
        (NODES + CELL + "*Nset, nset=a\nb\n", "the set 'b' is not there; remedy: define it before this line"),
        (assembly("", more="*Nset, nset=a, instance=j\n1\n"), "a set of the instance 'j', which is not there"),
        (assembly("0, 0, 0\n1, 1, 1, 1, 1, 1, 90\n"), r"the axis of \*Instance has no length; remedy"),
        ("1, 2, 3\n*Node\n", "line 1 is '1, 2, 3', before the first keyword"),
        ("*Node\n\0\1", "this is a binary file"),
        (NODES, "there are no hexahedra and no tetrahedra, only: no cells at all"),
    ],
)  # fmt: skip
def test_what_cannot_be_read_is_refused_by_line(tmp_path: Path, text: str, told: str) -> None:
    """A file of which a part would be left out or read wrong is refused with line and remedy."""
    (tmp_path / "job.inp").write_text(text)
    with pytest.raises(MeshError, match=told):
        examine_mesh(tmp_path / "job.inp")
