# SPDX-License-Identifier: Apache-2.0
"""The generated reference of the scene file: every key has a description, and the examples use it and are valid."""

from __future__ import annotations

from pathlib import Path

import pytest
from pydantic import TypeAdapter

from docs.scripts.scene_examples import EXAMPLES, SCENE
from docs.scripts.scene_reference import markdown, meaning_of, models
from gdfe_ros.scene import scene_from_text
from gdfe_ros.scene.base_entry import Entry
from gdfe_ros.scene.document import parse_value
from gdfe_ros.scene.report import fields_of


@pytest.mark.parametrize("model", models(), ids=lambda model: model.__name__)
def test_every_key_has_a_meaning_and_an_example(model: type, tmp_path: Path) -> None:
    """The examples of an entry are valid and use each of its keys."""
    (tmp_path / "measured.csv").write_text("strain,stress\n0.1,1.0e4\n0.5,4.0e4\n")
    assert [name for name, field in fields_of(model).items() if not meaning_of(field)] == []
    used = set()
    for text in EXAMPLES[model]:
        data = parse_value(text)
        TypeAdapter(model).validate_python(data, context={"folder": tmp_path})
        used |= set(data)
    assert used == set(fields_of(model))


def test_the_whole_example_can_be_simulated() -> None:
    """The scene that uses every top-level key can be loaded."""
    assert scene_from_text(SCENE).mesh.n_cells == 40


def test_a_table_row_says_unit_range_and_default() -> None:
    """A table row of each kind has the unit, range and default."""
    text = markdown()
    assert "| `young` | Young's modulus | number | Pa | > 0, < 1e+13 | required |" in text
    meaning = "tolerance: allowed distance to the equilibrium, as a fraction of the body's size"
    assert f"| `tolerance` | {meaning} | number |  | ≥ 1e-12, ≤ 0.1 | `0.0001` |" in text
    assert "[Handle](#handle)" in text


def test_no_entry_of_the_schema_is_left_out() -> None:
    """Every entry of the schema is printed."""

    def descendants(kind: type) -> set[type]:
        return {kind}.union(*(descendants(child) for child in kind.__subclasses__()))

    abstract = {"Entry", "Choice", "Generated", "DriveModel", "SurfaceModel", "_Common", "_Law", "_Rigid", "Draft"}
    declared = {kind for kind in descendants(Entry) if kind.__module__.startswith("gdfe_ros.scene")}
    printed = {kind for kind in models() if issubclass(kind, Entry)}
    assert {kind for kind in declared if kind.__name__ not in abstract} == printed
