# SPDX-License-Identifier: Apache-2.0
"""``gdfe new`` writes scenes that load, from surfaces, meshes and STEP files, and refuses input that does not fit."""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np
import pytest
import trimesh

from gdfe_ros.cli import BAD_INPUT, main
from gdfe_ros.mesh import bar
from gdfe_ros.mesh.tetmesh import divided
from gdfe_ros.scene import load_scene


@pytest.fixture(autouse=True)
def _own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


def test_a_cavity_from_a_second_surface_becomes_a_chamber(tmp_path: Path) -> None:
    """A body and an inner surface, both in millimetres, give a scene with a chamber of that size and a program."""
    ball = trimesh.creation.icosphere(subdivisions=2, radius=12.0)
    trimesh.creation.box((100, 60, 40)).export(tmp_path / "hand.stl")
    ball.export(tmp_path / "inner.stl")
    given = ["new", str(tmp_path / "hand.yaml"), "--from", str(tmp_path / "hand.stl"), "--size", "0.03"]
    assert main([*given, "--cavity", str(tmp_path / "inner.stl"), "--scale", "0.001"]) == 0
    scene = load_scene(tmp_path / "hand.yaml")
    (air,) = scene.actuators
    assert scene.mesh.noun == "tetrahedra"
    assert air.quads.shape[1] == 6
    assert np.ptp(scene.mesh.vertices[air.vertices], axis=0) == pytest.approx([0.024] * 3, rel=0.05)
    assert scene.program.duration == 1.0
    assert "&id" not in (tmp_path / "hand.yaml").read_text()


def test_a_mesh_file_becomes_a_scene(tmp_path: Path) -> None:
    """A mesh of tetrahedra becomes a scene that holds it at the low end of its longest side."""
    mesh = divided(bar([0.1, 0.02, 0.02], [3, 1, 1]))
    meshio.Mesh(mesh.vertices, [("tetra10", mesh.cells)]).write(tmp_path / "bar.vtu")
    assert main(["new", str(tmp_path / "bar.yaml"), "--from", str(tmp_path / "bar.vtu")]) == 0
    scene = load_scene(tmp_path / "bar.yaml")
    assert np.ptp(scene.mesh.vertices[scene.handles[0].vertices, 0]) == 0.0
    assert scene.actuators == ()


def test_what_does_not_fit_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """An existing scene file, and a cavity outside of the body, are refused."""
    (tmp_path / "there.yaml").write_text("name: mine")
    trimesh.creation.box((0.1, 0.06, 0.04)).export(tmp_path / "hand.stl")
    trimesh.creation.box((0.01, 0.01, 0.01)).apply_translation((1.0, 0, 0)).export(tmp_path / "far.stl")
    source = ["--from", str(tmp_path / "hand.stl")]
    assert main(["new", str(tmp_path / "there.yaml"), *source]) == BAD_INPUT
    assert "such a file already" in capsys.readouterr().err
    assert main(["new", str(tmp_path / "new.yaml"), *source, "--cavity", str(tmp_path / "far.stl")]) == BAD_INPUT
    assert "0 of 1 cavities lie inside of the body" in capsys.readouterr().err
    assert not (tmp_path / "new.yaml").exists()


def test_a_cavity_beside_a_step_file_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`--cavity` beside a STEP file is refused with a remedy, not ignored."""
    given = ["new", str(tmp_path / "new.yaml"), "--from", str(tmp_path / "part.step")]
    assert main([*given, "--cavity", str(tmp_path / "air.stl")]) == BAD_INPUT
    assert "close blind holes by a second solid" in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "new.yaml").exists()


def test_a_least_size_is_written_into_the_scene(tmp_path: Path) -> None:
    """With ``--least-size``, the scene has the key, and loads."""
    trimesh.creation.box((0.04, 0.04, 0.003)).export(tmp_path / "plate.stl")
    given = ["--from", str(tmp_path / "plate.stl"), "--size", "0.02", "--least-size", "0.005"]
    assert main(["new", str(tmp_path / "plate.yaml"), *given]) == 0
    assert "size: 0.02, least_size: 0.005" in (tmp_path / "plate.yaml").read_text()
    assert load_scene(tmp_path / "plate.yaml").mesh.noun == "tetrahedra"


@pytest.mark.parametrize(
    ("suffix", "sizes", "told"),
    [
        ("stl", ["--size", "0"], "size = 0 m; allowed: > 0"),
        ("stl", ["--least-size", "-1"], "least_size = -1 m; allowed: > 0"),
        ("stl", ["--size", "0.01", "--least-size", "0.02"], "least_size = 0.02 m; allowed: up to size = 0.01 m"),
        ("vtu", ["--least-size", "0.01"], "this file has cells already"),
    ],
)
def test_sizes_that_do_not_fit_are_refused(
    suffix: str, sizes: list[str], told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Sizes that are not positive, too large, or for a file with cells are refused."""
    path = tmp_path / f"body.{suffix}"
    trimesh.creation.box((0.04, 0.04, 0.04)).export(path) if suffix == "stl" else path.write_text("")
    assert main(["new", str(tmp_path / "new.yaml"), "--from", str(path), *sizes]) == BAD_INPUT
    assert told in " ".join(capsys.readouterr().err.split())
