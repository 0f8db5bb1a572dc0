# SPDX-License-Identifier: Apache-2.0
"""Findings on surfaces: direction of normals, thin walls for a size, self-intersections."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from gdfe_ros.mesh.meshing.surface_findings import SurfaceFindings, surface_findings

PLATE = trimesh.creation.box((0.1, 0.1, 0.001))


def findings_of(*parts: trimesh.Trimesh, size: float = 0.005) -> SurfaceFindings:
    """Return the findings on several surfaces together."""
    whole = trimesh.util.concatenate(list(parts))
    return surface_findings(np.asarray(whole.vertices), np.asarray(whole.faces), size=size)


@pytest.mark.parametrize(("size", "told"), [(0.005, True), (0.003, False)])
def test_walls_that_are_thin_for_the_size_are_remarked(size: float, told: bool) -> None:
    """A plate of 1 mm is thinner than both sizes, and is remarked with a remedy above four times its thickness."""
    found = findings_of(PLATE, size=size)
    facts = dict(found.facts)
    assert facts["thinnest wall"].startswith("0.001 m near (")
    assert facts[f"surface at walls thinner than {size:g} m"] == "98.0%"
    assert found.defects == []
    assert bool(found.remarks) is told
    for text in found.remarks:
        assert "`least_size: 0.001` beside `size`" in text
        assert "for voxels a `cell` of at most 0.0005 m" in text


def test_the_direction_of_normals_is_told() -> None:
    """Normals are outward, inward with a remark for obstacles, or outward except at a cavity."""
    ball, block = trimesh.creation.icosphere(radius=0.01), trimesh.creation.box((0.05, 0.05, 0.05))
    outward, inward = findings_of(block), findings_of(trimesh.Trimesh(block.vertices, block.faces[:, ::-1]))
    assert outward.normals == "out of the material"
    assert not any("refuse this surface" in remark for remark in outward.remarks)
    assert inward.normals == "into the material"
    assert any("`obstacles` and `bodies` refuse this surface" in remark for remark in inward.remarks)
    assert findings_of(block, ball).normals == "out of the material, except in 1 of 2 shells"
    for found in (inward, findings_of(block, ball)):
        assert found.walls.thickness.min() > 0.01


def test_a_surface_that_cuts_itself_has_no_walls() -> None:
    """Two plates that cut each other are a defect with places, and their walls are unknown."""
    found = findings_of(PLATE, PLATE.copy().apply_transform(trimesh.transformations.rotation_matrix(1.0, (1, 0, 0))))
    assert found.walls is None
    assert dict(found.facts)["walls"].startswith("unknown")
    assert "pairs of its triangles cut each other or lie on each other, e.g. near (" in found.defects[0]
    assert len(found.wrong_edges) == 0


def test_wrong_edges_are_found() -> None:
    """A missing and a turned triangle give their edges, and a defect for the winding."""
    faces = PLATE.faces.copy()
    faces[3] = faces[3, ::-1]
    found = surface_findings(np.asarray(PLATE.vertices), faces[1:], size=0.01)
    assert found.wrong_edges.shape == (6, 2, 3)
    assert "wound in opposite directions" in found.defects[0]


def test_walls_too_thin_for_any_size_are_a_defect() -> None:
    """A foil of 0.1 um is a defect with its place, and no advice to use cells of 0.1 um."""
    found = findings_of(trimesh.creation.box((0.04, 0.04, 1e-7)), size=0.0027)
    (defect,) = found.defects
    assert "too thin for cells of any size, the thinnest 1e-07 m near (" in defect
    assert "allowed: up to 2e+06; remedy: thicker walls" in defect
    assert found.remarks == []
