# SPDX-License-Identifier: Apache-2.0
"""A skin is attached to the cells, drawn in their place, stored in bags, and refused where it is beside the body."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
import trimesh

from gdfe_ros.analysis.picture import draw_body
from gdfe_ros.errors import SceneError
from gdfe_ros.live.surface import DrawnSurface
from gdfe_ros.mesh.outside import REACH
from gdfe_ros.scene import load_scene, scene_from_text
from gdfe_ros.scene.scene import Scene

SCENE = """
name: rod
mesh: {{voxels: {{surface: rod.stl, cell: 0.005, cells: cut}}}}
skin: {skin}
materials: {{soft: {{law: neo_hookean, young: 1.0e5, poisson: 0.45}}}}
regions: [{{material: soft}}]
handles: {{base: {{where: {{face: x-}}, fixed: true}}}}
"""
HELD = "handles: {left: {where: {mesh: left}, fixed: true}, right: {where: {mesh: right}, fixed: true}}"
RNG = np.random.default_rng(3)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder with a rod in metres, in millimetres, an open half of it, and one beside the body."""
    rod = trimesh.creation.capsule(height=0.05, radius=0.01, count=[24, 24])
    rod.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [0, 1, 0]))
    rod.export(tmp_path / "rod.stl")
    rod.copy().apply_scale(1000.0).export(tmp_path / "rod_mm.stl")
    rod.copy().apply_translation([0.0, 0.02, 0.0]).export(tmp_path / "beside.stl")
    trimesh.Trimesh(rod.vertices, rod.faces[: len(rod.faces) // 2]).export(tmp_path / "open.stl")
    return tmp_path


def load(folder: Path, skin: str = "{file: rod.stl}") -> Scene:
    """Load the rod with a skin."""
    (folder / "scene.yaml").write_text(SCENE.format(skin=skin))
    return load_scene(folder / "scene.yaml")


def test_a_skin_is_where_its_file_is_and_follows_any_affine_motion(folder: Path) -> None:
    """The undeformed skin is the file's surface, in parts short enough to bend, and moves with affine motions."""
    mesh = load(folder).mesh
    wanted = trimesh.load(folder / "rod.stl")
    at_rest = mesh.outside.at(mesh.vertices)
    found = trimesh.Trimesh(at_rest, mesh.outside.faces, process=False)
    assert (found.area, found.volume) == pytest.approx((wanted.area, wanted.volume), rel=1e-6)
    assert found.is_watertight
    assert found.edges_unique_length.max() <= 0.005 < wanted.edges_unique_length.max()
    matrix, shift = RNG.normal(size=(3, 3)), RNG.normal(size=3)
    np.testing.assert_allclose(mesh.outside.at(mesh.vertices @ matrix + shift), at_rest @ matrix + shift, atol=1e-12)
    nearest = np.linalg.norm(mesh.centroids[mesh.outside.cells] - at_rest[mesh.outside.faces[:, 0]], axis=1)
    assert nearest.max() < 0.005 * REACH * 3**0.5 / 2.0


@pytest.mark.parametrize("skin", ["{file: rod_mm.stl, scale: 0.001}", "{file: open.stl}"])
def test_a_scene_carries_its_skin_without_the_file(folder: Path, skin: str) -> None:
    """A scene rebuilt from its text, as in a bag, has the same skin to the bit, also an open one."""
    scene = load(folder, skin)
    (folder / "scene.yaml").unlink()
    again = scene_from_text(scene.source).mesh.outside
    assert again.skin
    for name in ("faces", "cells", "corners", "weights"):
        np.testing.assert_array_equal(getattr(again, name), getattr(scene.mesh.outside, name))


def test_a_skin_that_faces_inwards_is_turned(folder: Path) -> None:
    """Triangles of a closed skin that face inward are reversed."""
    inverted = trimesh.load(folder / "rod.stl")
    inverted.invert()
    inverted.export(folder / "rod.stl")
    outside = load(folder).mesh.outside
    assert trimesh.Trimesh(outside.at(load(folder).mesh.vertices), outside.faces, process=False).volume > 0.0


@pytest.mark.parametrize(
    ("skin", "expected"),
    [
        ("{file: none.stl}", r"skin.file = 'none.stl' \(line 4\): there is no such file"),
        ("{file: rod_mm.stl}", r"skin.file = 'rod_mm.stl' .*scale: 0.001"),
        (
            "{file: beside.stl}",
            r"skin.file .*\d+ of \d+ vertices lie far outside of the cells; the farthest, at \(.*\) m, is 0.0\d+ m "
            r"away from their vertices; "
            r"allowed: the edge of a cell, 0.005 m there; remedy: check scale and place of the file",
        ),
        ("{embedded: abc}", r"skin.embedded = 'abc' .*damaged"),
        ("{}", r"skin .*give exactly one of file, embedded"),
    ],
)
def test_bad_skins_are_defects_with_key_and_remedy(folder: Path, skin: str, expected: str) -> None:
    """A bad skin is reported with the reason, the place and a remedy."""
    with pytest.raises(SceneError, match=expected):
        load(folder, skin)


def test_pictures_and_the_page_show_the_skin(folder: Path) -> None:
    """The page's glTF has the skin's own points, and a picture differs from that of the cells."""
    scene = load(folder)
    mesh, bare = scene.mesh, load(folder, "null").mesh
    surface = DrawnSurface(mesh)
    data = surface.pack(mesh.vertices, np.linspace(0.0, 1.0, surface.count))
    read = trimesh.load(io.BytesIO(data), file_type="glb", process=False).geometry.popitem()[1]
    np.testing.assert_allclose(read.vertices, mesh.outside.at(mesh.vertices), atol=1e-6)
    assert not bare.outside.skin
    pictures = []
    for shown in (mesh, bare):
        draw_body(picture := io.BytesIO(), shown, shown.vertices, shown.centroids[:, 0], title="rod", label="x [m]")
        pictures.append(picture.getvalue())
    assert pictures[0] != pictures[1]


def test_a_body_that_was_made_once_is_recalled(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The stored body has the same bits and source, and is made anew when its file changes."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(folder / "cache"))
    made, found = load(folder), None
    with monkeypatch.context() as patch:
        patch.setattr("gdfe_ros.scene.schemas.mesh_schema.carry_skin", None)  # what is recalled is not made again
        patch.setattr("gdfe_ros.scene.schemas.mesh_schema.read_voxels", None)
        found = load(folder)
    for kind, names in (("skin", ("faces", "cells", "corners", "weights")), ("touching", ("corners", "weights"))):
        for name in names:
            first, second = (getattr(getattr(scene.mesh, kind), name) for scene in (made, found))
            assert first.dtype == second.dtype
            assert np.array_equal(first, second)
    assert np.array_equal(made.mesh.vertices, found.mesh.vertices)
    assert np.array_equal(made.mesh.filling.spread, found.mesh.filling.spread)
    assert made.source == found.source
    rod = trimesh.load(folder / "rod.stl")
    rod.apply_scale([1.1, 1.0, 1.0])
    rod.export(folder / "rod.stl")
    assert np.ptp(load(folder).mesh.vertices[:, 0]) > np.ptp(made.mesh.vertices[:, 0])


def test_a_left_and_a_right_body_of_one_file_are_made_once(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Bodies of one file that differ only in their poses share a stored one, and their recorded scene is the same."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(folder / "cache"))
    load(folder)
    rod = "voxels: {surface: rod.stl, cell: 0.005, cells: cut}, skin: {file: rod.stl}"
    pair = f"meshes:\n  left: {{{rod}, at: [0, 0.1, 0], mirror: x}}\n  right: {{{rod}, rotation_deg: [0, 0, 30]}}"
    text = SCENE.format(skin="null").replace("skin: null\n", "").splitlines()
    (folder / "pair.yaml").write_text("\n".join([*text[:2], pair, *text[3:-1], HELD]))
    with monkeypatch.context() as patch:
        patch.setattr("gdfe_ros.scene.schemas.mesh_schema.read_voxels", None)
        found = load_scene(folder / "pair.yaml")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(folder / "empty"))
    made = load_scene(folder / "pair.yaml")
    assert found.source == made.source
    again = scene_from_text(found.source)
    for scene in (made, again):
        np.testing.assert_array_equal(scene.mesh.vertices, found.mesh.vertices)
        np.testing.assert_array_equal(scene.mesh.outside.weights, found.mesh.outside.weights)
