# SPDX-License-Identifier: Apache-2.0
"""Tetrahedra from STEP files and surfaces, by meshers in separate processes."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

from gdfe_ros.errors import MeshError
from gdfe_ros.mesh import check_mesh, store, tetrahedralise
from gdfe_ros.mesh.cavities import find_cavities
from gdfe_ros.mesh.tetrahedralise import from_step, from_surface, step_facts

BOX, BALL = trimesh.creation.box((0.1, 0.06, 0.04)), trimesh.creation.icosphere(subdivisions=2, radius=0.012)
DRAWN = """
import gmsh, sys
gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
gmsh.model.occ.addBox(0, 0, 0, 60, 30, 20)
gmsh.model.occ.cut([(3, 1)], [(3, gmsh.model.occ.addCylinder(30, 15, -1, 0, 0, 22, 8))])
gmsh.model.occ.synchronize()
gmsh.write(sys.argv[1])
"""


@pytest.fixture(autouse=True)
def _own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store, "_folder", lambda: tmp_path / "kept")


@pytest.fixture
def step(tmp_path: Path) -> Path:
    """Write the STEP file of a block of 60 x 30 x 20 mm with a hole of radius 8 mm."""
    path = tmp_path / "block.step"
    subprocess.run([sys.executable, "-c", DRAWN, str(path)], check=True, capture_output=True)
    return path


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
    real = tetrahedralise._run
    monkeypatch.setattr(tetrahedralise, "_run", lambda *given: runs.append(given) or real(*given))
    assert np.array_equal(from_step(step, size=0.01).vertices, first.vertices)
    assert runs == []
    for entry in store._folder().iterdir():
        entry.write_text("damaged")
    assert from_step(step, size=0.01).n_cells == first.n_cells
    assert len(runs) == 1


def test_the_facts_of_a_step_file(step: Path) -> None:
    """The facts of a STEP file are its solids, surfaces and volume, in metres."""
    facts = dict(step_facts(step))
    assert facts["solids, surfaces"] == "1, 7"
    assert facts["volume"].startswith("3.19788e-05")


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
