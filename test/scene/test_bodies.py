# SPDX-License-Identifier: Apache-2.0
"""Rigid bodies of a scene file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from gdfe_ros.constraints.form import Capsule, Form, Sphere
from gdfe_ros.constraints.rigid_body import RigidBody
from gdfe_ros.errors import SceneError
from gdfe_ros.mesh.surfaces.shells import inertia_of
from gdfe_ros.scene import load_scene

SCENE = """
name: bodies
mesh: {bar: {size: [0.1, 0.1, 0.1], cells: [2, 2, 2]}}
materials: {soft: {law: neo_hookean, young: 1.0e5, poisson: 0.4, density: 1000}}
regions: [{material: soft}]
handles: {base: {where: {face: x-}, fixed: true}}
bodies: {part: %s}
dynamics: {}
"""
BALL = trimesh.creation.icosphere(subdivisions=3, radius=0.02)


def stretched(length: float) -> trimesh.Trimesh:
    """Return a fine capsule with a radius of 1 cm: a ball whose halves are moved apart by ``length`` [m]."""
    surface = trimesh.creation.icosphere(subdivisions=5, radius=0.01)
    surface.vertices[:, 2] += np.where(surface.vertices[:, 2] >= 0.0, 0.5, -0.5) * length
    return surface


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder with surfaces of a ball: in metres, in millimetres, open, and with inward triangles."""
    BALL.export(tmp_path / "ball.stl")
    BALL.copy().apply_scale(1000.0).export(tmp_path / "ball_mm.stl")
    trimesh.Trimesh(BALL.vertices, BALL.faces[:-5]).export(tmp_path / "open.stl")
    inverted = BALL.copy()
    inverted.invert()
    inverted.export(tmp_path / "inverted.stl")
    return tmp_path


def load(folder: Path, part: str) -> RigidBody:
    """Return the body of a scene with the given entry."""
    (folder / "scene.yaml").write_text(SCENE % part)
    return load_scene(folder / "scene.yaml").handles[-1]


def test_mass_and_density_agree(folder: Path) -> None:
    """The mass of a body given by density is that of its volume, and a ball's inertia is 2/5 m r^2."""
    by_density = load(folder, "{sphere: {radius: 0.02}, density: 1200, at: [0.2, 0, 0]}")
    by_mass = load(folder, "{sphere: {radius: 0.02}, mass: 0.0402, at: [0.2, 0, 0]}")
    assert by_density.mass == pytest.approx(1200 * 4 / 3 * np.pi * 0.02**3)
    assert by_mass.mass == 0.0402
    np.testing.assert_allclose(by_mass.form.moments, 0.02**2 / 5.0)


@pytest.mark.parametrize(
    ("form", "surface"),
    [(Sphere(0.02), trimesh.creation.icosphere(subdivisions=5, radius=0.02)), (Capsule(0.01, 0.03), stretched(0.03))],
    ids=["sphere", "capsule"],
)
def test_closed_forms_agree_with_fine_surfaces(form: Form, surface: trimesh.Trimesh) -> None:
    """The volume and moments of round shapes equal those of fine surfaces, and trimesh's, up to the facets' error."""
    found = inertia_of(np.array(surface.vertices), np.array(surface.faces))
    assert found.volume == pytest.approx(form.volume, rel=5e-3)
    np.testing.assert_allclose(found.moments, form.moments, rtol=6e-3)
    assert found.volume == pytest.approx(surface.volume, rel=1e-9)
    total = found.moments.sum()
    np.testing.assert_allclose(
        np.sort(total - found.moments), surface.principal_inertia_components / surface.volume, rtol=1e-6
    )


def test_the_frame_of_a_mesh_has_its_principal_axes(folder: Path) -> None:
    """A rotated brick away from its file's origin has the brick's moments about its centre, in the nearest axes."""
    turn = trimesh.transformations.rotation_matrix(0.3, [1.0, 2.0, 3.0])
    brick = trimesh.creation.box((0.03, 0.02, 0.01))
    brick.apply_transform(turn)
    brick.apply_translation([0.004, -0.003, 0.002])
    found = inertia_of(np.array(brick.vertices), np.array(brick.faces))
    np.testing.assert_allclose(found.centre, [0.004, -0.003, 0.002], atol=1e-12)
    np.testing.assert_allclose(found.axes, turn[:3, :3], atol=1e-9)
    np.testing.assert_allclose(found.moments, np.square([0.03, 0.02, 0.01]) / 12.0, rtol=1e-9)
    brick.export(folder / "brick.stl")
    body = load(folder, "{mesh: {file: brick.stl}, density: 1000, at: [0.2, 0, 0]}")
    np.testing.assert_allclose(body.origin, [0.204, -0.003, 0.002], atol=1e-8)
    assert body.mass == pytest.approx(1000 * 0.03 * 0.02 * 0.01, rel=1e-6)


@pytest.mark.parametrize(
    ("part", "message"),
    [
        ("{mesh: {file: open.stl}, density: 900}", r"bodies.part.mesh.file .*the surface is open: .*close the holes"),
        ("{mesh: {file: inverted.stl}, density: 900}", r"bodies.part.mesh.file .*inside out: .*turn its triangles"),
        ("{mesh: {file: ball_mm.stl}, density: 900}", r"bodies.part.mesh.file .*diagonal is 69.* `scale: 0.001`"),
        ("{mesh: {file: none.stl}, density: 900}", r"bodies.part.mesh.file .*there is no such file"),
        ("{mesh: {file: ball.stl, cell: 0.1}, density: 900}", r"bodies.part.mesh.* cell"),
        ("{sphere: {radius: 0.02}}", r"bodies.part.*give exactly one of density \[kg/m\^3\] and mass \[kg\]"),
        ("{sphere: {radius: 0.02}, density: 900, mass: 1}", r"bodies.part.*give exactly one of density"),
        ("{sphere: {radius: 0.02}, mass: 0}", r"bodies.part.mass = 0 .*1e-15 <= mass"),
        ("{sphere: {radius: -1}, mass: 1}", r"bodies.part.sphere.radius = -1"),
        ("{mass: 1}", r"bodies.part.*exactly one of sphere, box, capsule, cylinder, mesh"),
    ],
)
def test_unusable_bodies_are_named_with_the_remedy(folder: Path, part: str, message: str) -> None:
    """An unusable body is refused with its key, its defect and the remedy."""
    with pytest.raises(SceneError, match=message):
        load(folder, part.replace("density", "at: [0.2, 0, 0], density") if "at:" not in part else part)


@pytest.mark.parametrize("shape", ["sphere: {radius: 0.02}", "capsule: {radius: 0.01, length: 0.02}", "mesh: BALL"])
def test_a_start_inside_of_the_body_is_refused(folder: Path, shape: str) -> None:
    """A body that starts inside the soft body is refused with the depth and a shift, for each shape."""
    entry: Any = shape.replace("BALL", "{file: ball.stl}")
    with pytest.raises(SceneError, match=r"body 'part' is .*inside of the soft body"):
        load(folder, f"{{{entry}, density: 900, at: [0.045, 0, 0]}}")


def test_defects_of_the_dynamics_are_the_only_ones(folder: Path) -> None:
    """A misspelt key of the dynamics is the only defect: no message says that dynamics are missing."""
    entry = "{sphere: {radius: 0.02}, mass: 0.1, at: [0.2, 0, 0]}"
    text = (SCENE % entry).replace("dynamics: {", "dynamics: {damping: {viscosty: 1.0}, ", 1)
    (folder / "scene.yaml").write_text(text)
    with pytest.raises(SceneError, match="viscosty") as error:
        load_scene(folder / "scene.yaml")
    assert len(error.value.defects) == 1
