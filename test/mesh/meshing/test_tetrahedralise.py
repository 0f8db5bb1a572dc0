# SPDX-License-Identifier: Apache-2.0
"""Tetrahedra from STEP files and surfaces, by meshers in separate processes."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

from gdfe_ros.errors import MeshError
from gdfe_ros.mesh import HexMesh, TetMesh, bar, check_mesh
from gdfe_ros.mesh.cavities import find_cavities
from gdfe_ros.mesh.cells.faces import corners_of
from gdfe_ros.mesh.cells.tetrahedra import EDGES
from gdfe_ros.mesh.generators import grid
from gdfe_ros.mesh.meshing import tetrahedralise
from gdfe_ros.mesh.meshing.tetrahedralise import from_step, from_surface, step_surface
from gdfe_ros.mesh.selection import Side, Where, at_end, select_faces
from gdfe_ros.mesh.tetmesh import divide

BOX, BALL = trimesh.creation.box((0.1, 0.06, 0.04)), trimesh.creation.icosphere(subdivisions=2, radius=0.012)


@pytest.fixture(autouse=True)
def _own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "kept"))


def test_a_step_file_is_filled_in_metres_with_curved_edges(step: Path) -> None:
    """The mesh of a STEP file has the drawing's volume to 1e-4; straight edges have a hundred times that error."""
    mesh = from_step(step, size=0.008)
    report = check_mesh(mesh)
    assert report.defects == []
    assert report.volume == pytest.approx(0.06 * 0.03 * 0.02 - np.pi * 0.008**2 * 0.02, rel=1e-4)
    wide = {name: np.ptp(mesh.vertices[ids], axis=0) for name, ids in mesh.vertex_sets.items()}
    (hole,) = [mesh.vertex_sets[name] for name, (x, _, z) in wide.items() if 0.01 < x < 0.02 < z + 1e-3]
    distance = np.linalg.norm(mesh.vertices[hole, :2] - (0.03, 0.015), axis=1)
    np.testing.assert_allclose(distance, 0.008, rtol=1e-6)


def test_the_same_file_is_meshed_once(step: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file's mesh comes from the cache the second time, and a damaged entry is made again."""
    first = from_step(step, size=0.01)
    runs = []
    real = tetrahedralise.run_mesher
    monkeypatch.setattr(tetrahedralise, "run_mesher", lambda *given: runs.append(given) or real(*given))
    assert np.array_equal(from_step(step, size=0.01).vertices, first.vertices)
    assert runs == []
    for entry in Path(os.environ["NUMBA_CACHE_DIR"], "gdfe_ros_bodies").iterdir():
        entry.write_text("damaged")
    assert from_step(step, size=0.01).n_cells == first.n_cells
    assert len(runs) == 1


def test_the_sets_of_overlapping_solids_are_the_drawn_solids(overlapping: Path) -> None:
    """The set of each solid has its whole volume, also in an overlap; a mesh from the cache has the remarks, too."""
    for _ in range(2):
        mesh = from_step(overlapping, size=0.01)
        volumes = check_mesh(mesh).volumes
        sets = {name: volumes[ids].sum() for name, ids in mesh.cell_sets.items()}
        assert sets == pytest.approx({"solid_1": 1.2e-5, "solid_2": 1.2e-5, "solid_3": 1e-6}, rel=1e-6)
        assert volumes.sum() == pytest.approx(2.2e-5, rel=1e-6)
        assert [text.partition(" m^3")[0][-8:] for text in mesh.remarks] == ["by 2e-06", "by 1e-06"]


def test_a_surface_with_a_cavity_is_filled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A ball-shaped cavity is kept with triangles of either orientation, and no file is left behind."""
    trimesh.util.concatenate([BOX, BALL]).export(tmp_path / "hollow.stl")
    monkeypatch.chdir(tmp_path)
    mesh = from_surface(tmp_path / "hollow.stl", size=0.03)
    assert {path.name for path in tmp_path.iterdir()} == {"hollow.stl", "kept"}
    assert check_mesh(mesh).defects == []
    assert check_mesh(mesh).volume == pytest.approx(BOX.volume - BALL.volume, rel=0.01)
    (cavity,) = find_cavities(mesh)
    assert cavity.volume == pytest.approx(BALL.volume, rel=0.05)


def _fill(monkeypatch: pytest.MonkeyPatch, block: HexMesh, points: NDArray[np.float64]) -> None:
    """Replace the mesher by one that returns the tetrahedra of a block of hexahedra, with corners at ``points``."""
    found = {"vertices": points, "cells": divide(block).cells[:, :4]}
    monkeypatch.setattr(tetrahedralise, "run_mesher", lambda *_: found)


@pytest.mark.parametrize("off", [-1e-4, 1e-4])
@pytest.mark.parametrize("side", Side)
def test_corners_off_a_flat_face_are_moved_into_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, side: Side, off: float
) -> None:
    """Corners that the mesher leaves 0.1 mm off a flat face are in it, so that `face` selects the whole face."""
    BOX.export(tmp_path / "box.stl")
    block, axis = bar(BOX.extents, [4, 3, 2]), "xyz".index(side.value[0])
    points = block.vertices - [0.5 * BOX.extents[0], 0.0, 0.0]
    points[np.flatnonzero(at_end(points, side, 1e-9))[[0, 5]], axis] += off
    _fill(monkeypatch, block, points)
    mesh = from_surface(tmp_path / "box.stl", size=0.03)
    assert check_mesh(mesh).volume == pytest.approx(BOX.volume, rel=1e-6)
    a, b, c = np.moveaxis(mesh.vertices[corners_of(select_faces(mesh, Where(face=side)))], 1, 0)
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
    assert area == pytest.approx(BOX.volume / BOX.extents[axis], rel=1e-6)


def test_no_cell_is_flattened_into_a_face(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A layer of cells beyond a flat face keeps its corners, because their move would make the cells flat."""
    BOX.export(tmp_path / "box.stl")
    block = grid([-0.05, 0.0, 0.05, 0.05005], [-0.03, 0.03], [-0.02, 0.02])
    _fill(monkeypatch, block, block.vertices)
    mesh = from_surface(tmp_path / "box.stl", size=0.03)
    assert check_mesh(mesh).defects == []
    assert mesh.vertices[:, 0].max() == 0.05005


def test_a_round_end_is_not_flattened(tmp_path: Path) -> None:
    """A ball, which touches its bounding box only at points, keeps its volume and gets no face at an end."""
    BALL.export(tmp_path / "ball.stl")
    mesh = from_surface(tmp_path / "ball.stl", size=0.01)
    assert check_mesh(mesh).volume == pytest.approx(BALL.volume, rel=0.01)
    assert all(len(select_faces(mesh, Where(face=side))) == 0 for side in Side)


def test_what_cannot_be_filled_is_refused_at_once(tmp_path: Path, step: Path) -> None:
    """Wrong sizes, limits, units and suffixes are refused before a mesher runs for minutes."""
    BOX.export(tmp_path / "box.stl")
    BOX.copy().apply_scale(1e3).export(tmp_path / "big.stl")
    with pytest.raises(MeshError, match=r"tetrahedra; allowed: up to 2e\+06; remedy: a size of at least"):
        from_surface(tmp_path / "box.stl", size=1e-4)
    with pytest.raises(MeshError, match=r"diagonal is 0\.123 m; remedy: a smaller size"):
        from_surface(tmp_path / "box.stl", size=0.5)
    with pytest.raises(MeshError, match=r"give `scale: 0.001`"):
        from_surface(tmp_path / "big.stl", size=5.0)
    with pytest.raises(MeshError, match=r"tetrahedra; allowed: up to 2e\+06"):
        from_step(step, size=1e-4)
    with pytest.raises(MeshError, match="unknown kind of file"):
        from_step(tmp_path / "box.stl", size=0.01)


def test_a_missing_extra_is_one_line(step: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without gmsh, the error is one line that says how to install it."""
    hidden = tmp_path / "hidden"
    hidden.mkdir()
    (hidden / "gmsh.py").write_text("raise ModuleNotFoundError('no gmsh', name='gmsh')")
    monkeypatch.setenv("PYTHONPATH", str(hidden))
    with pytest.raises(MeshError, match=r"gmsh is not installed; remedy: pip install 'gdfe_ros\[cad\]'"):
        from_step(step, size=0.01)


def test_a_broken_step_file_is_refused(tmp_path: Path) -> None:
    """A broken STEP file is refused in one line with the mesher's reason."""
    (tmp_path / "broken.step").write_text("ISO-10303-21; nonsense")
    with pytest.raises(MeshError, match=r"the mesher says|there is no solid"):
        from_step(tmp_path / "broken.step", size=0.01)


def longest_edges(mesh: TetMesh) -> np.ndarray:
    """Return the longest edge of each cell [m]."""
    ends = mesh.vertices[mesh.cells[:, EDGES]]
    return np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2).max(axis=1)


def test_cells_are_small_only_at_a_thin_wall(walled: Path) -> None:
    """With a least size, a wall of 1 mm has edges of about 2 mm, and the block of 10 mm beside it keeps its cells."""
    plain, fine = from_step(walled, size=0.005), from_step(walled, size=0.005, least_size=0.001)
    for mesh in (plain, fine):
        assert check_mesh(mesh).defects == []
        assert check_mesh(mesh).volume == pytest.approx(1.2e-6, rel=1e-9)
    (wall, fine_wall), (block, fine_block) = (
        [longest_edges(mesh)[some(mesh.centroids[:, 0])] for mesh in (plain, fine)]
        for some in (lambda x: x > 0.011, lambda x: x < 0.005)
    )
    assert np.median(wall) > 0.0028
    assert np.median(fine_wall) < 0.0023
    assert len(fine_wall) > 1.8 * len(wall)
    assert len(fine_block) == pytest.approx(len(block), rel=0.15)


def test_cells_of_a_surface_are_small_only_at_a_thin_wall(walled: Path, tmp_path: Path) -> None:
    """Cells of fTetWild are smaller at a wall of 1 mm as well, and larger in the block beside it."""
    trimesh.Trimesh(*step_surface(walled)[:2]).export(tmp_path / "walled.stl")
    plain, fine = (from_surface(tmp_path / "walled.stl", size=0.004, least_size=least) for least in (None, 0.0007))
    for mesh in (plain, fine):
        assert check_mesh(mesh).defects == []
        assert check_mesh(mesh).volume == pytest.approx(1.2e-6, rel=0.01)
    at_wall, far = (
        [np.median(longest_edges(mesh)[some(mesh.centroids[:, 0])]) for mesh in (plain, fine)]
        for some in (lambda x: x > 0.011, lambda x: x < 0.005)
    )
    assert at_wall[1] < 0.85 * at_wall[0]
    assert far[1] > 1.25 * at_wall[1]


def test_parts_that_overlap_are_united_and_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Two boxes that overlap give the volume of their union; the self-intersections are told."""
    other = BOX.copy().apply_translation((0.05, 0.01, 0.01))
    trimesh.util.concatenate([BOX, other]).export(tmp_path / "two.stl")
    mesh = from_surface(tmp_path / "two.stl", size=0.04)
    assert check_mesh(mesh).volume == pytest.approx(2.0 * BOX.volume - 0.05 * 0.05 * 0.03, rel=0.01)
    assert "the surface cuts itself" in capsys.readouterr().err


def test_a_turned_triangle_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A box with a triangle that is wound in the opposite direction is filled, and the triangle is told."""
    turned = BOX.faces.copy()
    turned[0] = turned[0, ::-1]
    trimesh.Trimesh(BOX.vertices, turned, process=False).export(tmp_path / "turned.ply")
    assert check_mesh(from_surface(tmp_path / "turned.ply", size=0.04)).volume == pytest.approx(BOX.volume, rel=0.05)
    assert "3 edges are wound in opposite directions" in capsys.readouterr().err


def test_a_least_size_that_does_not_fit_is_refused(tmp_path: Path, walled: Path) -> None:
    """Least sizes above the size, of too many cells, and of open surfaces are refused with a remedy."""
    with pytest.raises(MeshError, match=r"least_size = 0\.01 m; allowed: up to size = 0\.005 m"):
        from_step(walled, size=0.005, least_size=0.01)
    with pytest.raises(MeshError, match=r"allowed: up to 2e\+06; remedy: a larger least_size"):
        from_surface(_plate(tmp_path, 5e-5), size=0.005, least_size=1e-5)
    half = BOX.copy()
    half.update_faces(np.arange(len(half.faces)) > 0)
    half.export(tmp_path / "open.stl")
    with pytest.raises(MeshError, match=r"least_size needs a closed surface.*remedy: leave it out"):
        from_surface(tmp_path / "open.stl", size=0.01, least_size=0.001)


def _plate(folder: Path, thickness: float) -> Path:
    """Write the surface of a plate of 0.1 x 0.1 m; return its path."""
    trimesh.creation.box((0.1, 0.1, thickness)).export(folder / "plate.stl")
    return folder / "plate.stl"


def test_an_old_ftetwild_refuses_a_least_size(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A pytetwild without background meshes refuses a least size with the version that has them."""
    hidden = tmp_path / "hidden"
    hidden.mkdir()
    (hidden / "pytetwild.py").write_text("def tetrahedralize(vertices, faces): raise SystemExit(1)")
    monkeypatch.setenv("PYTHONPATH", str(hidden))
    with pytest.raises(MeshError, match=r"0\.4\.2 or newer.*or leave out least_size"):
        from_surface(_plate(tmp_path, 0.002), size=0.05, least_size=0.01)


def test_a_closed_foil_is_not_called_open(tmp_path: Path) -> None:
    """A closed surface that is thinner than the mesher's envelope is refused for its thickness."""
    trimesh.creation.box((0.04, 0.04, 1e-7)).export(tmp_path / "foil.stl")
    with pytest.raises(MeshError) as caught:
        from_surface(tmp_path / "foil.stl", size=0.01)
    (defect,) = caught.value.defects
    assert "the surface is closed, but its walls are too thin for the size" in defect
    assert "about 1e-07 m thick, and the mesher may move the surface by 5.7e-05 m; remedy: thicker walls" in defect
    assert "encloses nothing" not in defect
