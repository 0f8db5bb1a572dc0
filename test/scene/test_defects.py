# SPDX-License-Identifier: Apache-2.0
"""Every defect of a scene is reported at once, with key, line, value, range and remedy."""

from __future__ import annotations

import re

import numpy as np
import pytest

from gdfe_ros.constraints import Axis, Handle
from gdfe_ros.errors import SceneError
from gdfe_ros.mesh import HexMesh, bar
from gdfe_ros.scene import scene_from_text
from gdfe_ros.scene.building.builder import require_held
from gdfe_ros.scene.document import Document
from gdfe_ros.scene.report import Defects

from .conftest import SOUND


def defects(text: str) -> list[str]:
    """Return the defects of a text."""
    with pytest.raises(SceneError) as caught:
        scene_from_text(text)
    return caught.value.defects


TEN = """\
name: ten
mesh:
  bar: {size: [200, 50, 50], cells: [20, -5, 5]}
materials:
  soft: {law: linear, young: 100 kPa, poisson: 0.6}
  hard: {law: ogdn, mu: [1.0e6], alpha: [2.0], poisson: 0.49}
regions:
  - {material: sofft}
handles:
  base: {where: {fce: x-}, fixed: true}
  tip: {where: {face: x+}, free: [x]}
program:
  duration: 1.0
  handles:
    tip: [{time: 1.0, translation: [0.1, 0, 0]}, {time: 0.5}]
solver: {policy: energy, tolerance: 0}
"""


def test_ten_defects_are_named_in_one_message() -> None:
    """Ten mistakes of ten kinds are reported in the order of the file."""
    with pytest.raises(SceneError) as caught:
        scene_from_text(TEN, origin="ten.yaml")
    expected = [
        r"mesh\.bar\.size = \[200, 50, 50\] \(line 3\): .*\[m\] <= 100; .*200 mm is 0\.2",
        r"mesh\.bar\.cells = \[20, -5, 5\] \(line 3\): .*1 <= number of cells",
        r"materials\.soft\.poisson = 0\.6 \(line 5\): .*0 <= Poisson's ratio <= 0\.5; 0\.5 is incompressible",
        r"materials\.soft\.young = '100 kPa' \(line 5\): .*\[Pa\].*without a unit, in Pa",
        r"materials\.hard\.law = 'ogdn' \(line 6\): unknown law; did you mean 'ogden'\?",
        r"regions\.0\.material = 'sofft' \(line 8\): .*did you mean 'soft'\? allowed: soft, hard",
        r"handles\.base\.where\.fce \(line 10\): unknown key; did you mean 'face'\?",
        r"program\.handles\.tip\.0\.translation = \[0\.1, 0, 0\] \(line 15\): x is free",
        r"program\.handles\.tip\.1\.time = 0\.5 \(line 15\): times must ascend; the one before is 1 s",
        r"solver\.tolerance = 0 \(line 16\): .*1e-12 <= tolerance",
    ]
    found = caught.value.defects
    assert len(found) == len(expected), "\n".join(found)
    for text, pattern in zip(found, expected, strict=True):
        assert re.match(pattern, text), (text, pattern)
    lines = str(caught.value).splitlines()
    assert lines[0] == "scene ten.yaml: 10 defects"
    assert len(lines) == 11


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("face: x-", "face: xmin", r"handles.base.where.face = 'xmin' \(line 11\): not known.*allowed: x-, x\+"),
        ("{face: x-}, fixed", "{face: x-, box: {x: [0, 1]}}, fixed", "give exactly one of face, .*given: face, box"),
        ("{face: x-}, fixed: true", "{face: x-}, fixed: true, free: [y]", "exclude each other"),
        ("policy: energy", "policy: relative, torsion: section", "relative has no hourglass energy; leave it out"),
        ("box: {x: [0.1, 0.2]}", "box: {}", "give at least one axis"),
        ("box: {x: [0.1, 0.2]}", "box: {x: [0.2, 0.1]}", "in ascending order"),
        ("box: {x: [0.1, 0.2]}", "box: {x: [0.3, 0.4]}", r"no cell is there; the mesh spans x 0 to 0.2, .*centroids"),
        ("face: x-", "vertices: [0, 45]", "vertex ids \\[45\\] do not exist; allowed: 0 to 44"),
        ("face: x-", "set: grip", "set 'grip' does not exist; the mesh has no sets"),
        ("{material: soft}", "{material: soft, where: {face: x-}}", "4 cells have no material: 1, 5, 9, 13; remedy"),
        (
            "face: x+",
            "box: {x: [0, 0.2]}",
            r"handles 'base' and 'tip' both hold vertices 0, 5, 10, .*; remedy: make one",
        ),
        ("fixed: true", "free: [x]", "no handle holds the body along x; remedy: add a handle"),
        ("    tip:\n", "    top:\n", "no such handle; did you mean 'tip'\\? allowed: base, tip"),
        ("    tip:\n", "    base:\n", "program.handles.base .*this handle is fixed"),
        ("duration: 2.0", "duration: 1.5", r"tip.1.time = 2.0 .*up to the duration, 1.5 s"),
        ("{time: 2.0,", "{time: 0.0,", "times must ascend"),
        ("translation: [0, 0, 0.1]", "translation: [0, 0.1]", "a list of 3 numbers"),
        ("mu: [1.0e6]", "mu: [1.0e6, 2.0e6]", "equal length"),
        ("mu: [1.0e6]", "mu: [-1.0e6]", "sum of mu"),
        ("young: 1e5", "young: .nan", "finite"),
        ("young: 1e5, ", "", r"materials.soft.young \(line 5\): is missing; needed is a number: 0 < Young's modulus"),
        ("law: linear, ", "", "materials.soft.law .*is missing; allowed: linear, neo_hookean, curve, ogden"),
        ("law: linear, young: 1e5", "preset: ninja", "not known; did you mean 'ninjaflex'"),
        ("law: linear, young: 1e5", "law: curve", "give exactly one of: coefficients, csv, or strain"),
        ("law: linear, young: 1e5", "law: curve, strain: [0, 1]", "strain and stress belong together"),
        ("law: linear, young: 1e5", "law: curve, csv: a.csv", "a scene given as text has no folder"),
        ("cells: [4, 2, 2]", "cells: [1000, 1000, 1000]", "1000000000 cells; allowed: up to"),
        ("cells: [4, 2, 2]", "cells: [4.5, 2, 2]", "a list of 3 whole numbers"),
        ("cells: [4, 2, 2]", "cels: [4, 2, 2]", "mesh.bar.cels .*did you mean 'cells'"),
        ("  base: {where: {face: x-}, fixed: true}\n", "", "no handle holds the body along x"),
        ("  tip: {where", "  my-tip: {where", "allowed names: letters, digits and _"),
        ("solver: {", "solver: {}\nsolver: {", r"solver \(line 20\): this key is given twice"),
        ("policy: energy", "policy: enrgy", "not known; did you mean 'energy'\\? allowed: energy, relative"),
        ("name: sound", "name: 5", "must be text; put it in quotes"),
        ("fixed: true", "fixed: maybe", "allowed: true, false"),
        ("      - {time: 0.0}\n", "      - 3\n", "must be a mapping .*time, translation, rotation_deg"),
        ("soft: {law: linear, young: 1e5, poisson: 0.45}", "soft: 5", r"soft .*must be a mapping, e.g. {law: linear"),
        ("poisson: 0.45", "poisson: true", r"poisson = True .*Poisson's ratio"),
        ("    tip:\n      - {time: 0.0}\n      -", "    tip:", "tip .*must be a list; see the scene reference"),
    ],
)
def test_a_single_mistake_gives_a_single_clear_defect(old: str, new: str, expected: str) -> None:
    """One mistake in a sound scene gives exactly one defect about it."""
    assert old in SOUND
    found = defects(SOUND.replace(old, new))
    assert re.search(expected, found[0]), found
    allowed = {"no handle holds the body along x": 3, "my-tip": 2, "top": 1}
    assert len(found) <= next((n for key, n in allowed.items() if key in expected or key in new), 1), found


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "the file is empty"),
        ("# only a comment\n", "the file is empty"),
        ("- a\n- b\n", "the top level is a list"),
        ("bend5", "the top level is one piece of text"),
        ("name: [1, 2\nmesh: 3\n", "line 2, column .*not YAML"),
        ("name: x\n\tmesh: 3\n", "indent with spaces, not tabs"),
        ("name: a: b\n", "line 1.*not YAML"),
        ("a: &x [*x]\n", "an alias contains itself"),
        ("? [a, b]\n: 1\n", "a key must be a word"),
        ("name: !!python/object:os.system x\n", "could not determine a constructor"),
        ("name: x\n---\nname: y\n", "expected a single document"),
    ],
)
def test_broken_yaml_is_explained(text: str, expected: str) -> None:
    """Broken YAML is reported with the reason and the place."""
    found = defects(text)
    assert len(found) == 1
    assert re.search(expected, found[0]), found


def test_missing_sections_are_all_named() -> None:
    """All four required sections are named if they are missing."""
    found = defects("name: x\n")
    assert [text.split()[0] for text in found] == ["mesh", "materials", "regions", "handles"]
    assert all("is missing; needed" in text for text in found)


def test_a_piece_that_nothing_holds_is_named() -> None:
    """Of two separate bars, one that no handle holds or joins to the other is reported along each axis."""
    one = bar([1, 1, 1], [1, 1, 1])
    mesh = HexMesh(np.vstack([one.vertices, one.vertices + 5]), np.vstack([one.cells, one.cells + 8]))
    base = Handle("base", np.array([0, 2], dtype=np.int32), fixed=True)
    joint = Handle("joint", np.array([1, 9], dtype=np.int32), free=(Axis.Y,))
    report = Defects("scene", Document({}))
    require_held(mesh, (base, joint), report)
    report.raise_if_any()
    require_held(mesh, (base,), report)
    with pytest.raises(SceneError) as caught:
        report.raise_if_any()
    assert len(caught.value.defects) == 3
    assert "holds the piece with the vertices 8, 9, 10, 11, 12, 13, 14, 15 along x" in str(caught.value)


def test_a_csv_with_mistakes_is_explained(tmp_path: object) -> None:
    """A csv file that is missing, or has a wrong header or wrong rows, is reported."""
    for content, expected in [
        ("0,0\n1,1\n", r"line 1: the header is \['0', '0'\]; allowed"),
        ("strain,stress\n0,0\n1,x\n2\n", "not two finite numbers in line 3, 4"),
        ("strain,stress\n0,0\n", "has 1 rows of data"),
        ("", "is empty"),
    ]:
        path = tmp_path / "curve.csv"
        path.write_text(content)
        text = SOUND.replace("law: linear, young: 1e5", f"law: curve, csv: {path}")
        assert re.search(expected, defects(text)[0])
    text = SOUND.replace("law: linear, young: 1e5", f"law: curve, csv: {tmp_path}/none.csv")
    assert "cannot read" in defects(text)[0]


def test_a_key_that_looks_like_a_tag_is_a_key() -> None:
    """A key that begins like the tags that pydantic adds to locations is refused by its name."""
    with pytest.raises(SceneError, match="kind=name"):
        scene_from_text("kind=" + SOUND.lstrip())
