# SPDX-License-Identifier: Apache-2.0
"""Facts, facets and walls of STEP files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gdfe_ros.mesh.cavities import NO_CAVITY
from gdfe_ros.mesh.inspection import inspect_file
from gdfe_ros.mesh.meshing.tetrahedralise import solid_facts, step_surface
from gdfe_ros.mesh.meshing.walls import find_solid_walls


def test_facets_point_out_of_each_solid(layered: Path) -> None:
    """The facets of each of two solids that touch enclose its volume, wherever the origin is."""
    vertices, triangles, solid = step_surface(layered)
    for k, volume in enumerate((20 * 20 * 8e-9, 20 * 20 * 2e-9)):
        for shift in ((0, 0, 0), (1, 2, 3)):
            a, b, c = np.moveaxis(vertices[triangles[solid == k]] + shift, 1, 0)
            assert np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0 == pytest.approx(volume, rel=1e-6)


def test_solids_have_volumes_bounds_and_cavities(layered: Path, hollow: Path) -> None:
    """Each solid is listed with its volume, its bounds and the volumes of its cavities."""
    plate, layer = solid_facts(layered, *step_surface(layered))
    assert plate[0].startswith("solid 1")
    assert plate[1] == "3.2e-06 m^3, no cavity, x 0 to 0.02, y 0 to 0.02, z 0 to 0.008"
    assert layer[1].endswith("z 0.008 to 0.01")
    ((_, text),) = solid_facts(hollow, *step_surface(hollow))
    assert text.startswith("7e-06 m^3, cavities 1e-06 m^3, x 0 to 0.02")


def test_a_file_without_cavity_gets_a_remark(step: Path, layered: Path, hollow: Path) -> None:
    """A single solid without cavity has no chamber, two solids may enclose air together, a hollow one needs no word."""
    assert NO_CAVITY in inspect_file(step).remarks
    assert any("solids that touch may enclose air" in text for text in inspect_file(layered).remarks)
    assert not any("cavity" in text for text in inspect_file(hollow).remarks)


def test_each_solid_has_its_own_walls(layered: Path) -> None:
    """A layer of 2 mm that is bonded to a plate of 8 mm is a wall of 2 mm, on both of its sides."""
    walls = find_solid_walls(*step_surface(layered), spacing=0.002)
    up = np.abs(walls.places[:, 2] - 0.008) < 1e-9
    assert set(np.round(walls.thickness[up], 6)) == {0.002, 0.008}
    assert walls.fraction(np.isclose(walls.thickness, 0.002)) == pytest.approx(800 / 2400, rel=0.01)


def test_overlapping_solids_are_reported_and_counted_once(overlapping: Path) -> None:
    """The volume counts overlaps once, each solid is listed as drawn, and each overlap is a defect with its volume."""
    found = inspect_file(overlapping)
    facts = dict(found.facts)
    assert facts["volume"] == "2.2e-05 m^3"
    solids = [text.split(",")[0] for name, text in facts.items() if name.startswith("solid ")]
    assert solids == ["1.2e-05 m^3", "1.2e-05 m^3", "1e-06 m^3"]
    assert [text.partition(" m^3")[0] for text in found.defects] == [
        "solids 1 and 2 overlap by 2e-06",
        "solids 2 and 3 overlap by 1e-06",
    ]
    assert all("remedy: cut one out of the other" in text for text in found.defects)


def test_facets_of_overlapping_solids_enclose_them(overlapping: Path) -> None:
    """The facets of each solid are its own surface, without the surfaces of the solids that cut it."""
    vertices, triangles, solid = step_surface(overlapping)
    for k, area in enumerate((3.2e-3, 3.2e-3, 6e-4)):
        a, b, c = np.moveaxis(vertices[triangles[solid == k]], 1, 0)
        assert np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2.0 == pytest.approx(area, rel=1e-6)
