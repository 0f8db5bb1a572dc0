# SPDX-License-Identifier: Apache-2.0
"""``gdfe new`` writes scenes that load, from surfaces, meshes and STEP files, and refuses input that does not fit."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import meshio
import numpy as np
import pytest
import trimesh

from gdfe_ros import Simulation
from gdfe_ros.cli import BAD_INPUT, main
from gdfe_ros.commands import new as command
from gdfe_ros.materials import PRESETS
from gdfe_ros.mesh import bar
from gdfe_ros.mesh.tetmesh import divide
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
    mesh = divide(bar([0.1, 0.02, 0.02], [3, 1, 1]))
    meshio.Mesh(mesh.vertices, [("tetra10", mesh.cells)]).write(tmp_path / "bar.vtu")
    assert main(["new", str(tmp_path / "bar.yaml"), "--from", str(tmp_path / "bar.vtu")]) == 0
    scene = load_scene(tmp_path / "bar.yaml")
    assert np.ptp(scene.mesh.vertices[scene.handles[0].vertices, 0]) == 0.0
    assert scene.actuators == ()
    assert Simulation(scene).probe_positions()["tip"] == pytest.approx([0.1, 0.0, 0.0], abs=1e-9)


def test_a_body_without_cavity_is_not_called_ready(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Without a closed cavity, the command says why there is no chamber, and does not send to a run that fails."""
    trimesh.creation.box((0.06, 0.02, 0.02)).export(tmp_path / "bar.stl")
    given = ["new", str(tmp_path / "bar.yaml"), "--from", str(tmp_path / "bar.stl"), "--size", "0.02"]
    assert main(given) == 0
    said = capsys.readouterr().out
    assert "chambers: 0" in said
    assert "close the inlet" in said
    assert "next: add actuators or loads, and a program" in said
    assert Simulation(load_scene(tmp_path / "bar.yaml")).probe_positions()["tip"] == pytest.approx([0.03, 0, 0])


def test_pieces_without_a_handle_are_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The second of two separate blocks, which nothing holds, is named; the file's remarks are printed, too."""
    first, second = bar([0.03, 0.02, 0.02], [1, 1, 1]), bar([0.03, 0.02, 0.02], [1, 1, 1])
    vertices = np.concatenate([first.vertices, second.vertices + np.array([0.031, 0, 0])])
    sets = {"left": [np.array([0]), np.array([])], "right": [np.array([1]), np.array([])]}
    cells = np.concatenate([first.cells, second.cells + first.n_vertices])
    blocks = [("hexahedron", cells), ("triangle", [[0, 1, 2]])]
    meshio.Mesh(vertices, blocks, cell_sets=sets).write(tmp_path / "gap.inp")
    assert main(["new", str(tmp_path / "gap.yaml"), "--from", str(tmp_path / "gap.inp")]) == 0
    said = capsys.readouterr().out
    assert "note: 1 elements of type" in said
    assert "note: no handle holds the piece right, with the vertices 8, 9, " in said
    assert "next: add a handle for each of these pieces, actuators or loads, and a program" in said


@pytest.mark.parametrize("name", ["my part (1)", "hülle", "-x", "x" * 80])
def test_any_file_name_gives_a_scene_that_loads(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    """The scene's name is made from the file's, and the printed command names the file to a shell."""
    monkeypatch.chdir(tmp_path)
    mesh = bar([0.1, 0.02, 0.02], [3, 1, 1])
    meshio.Mesh(mesh.vertices, [("hexahedron", mesh.cells)]).write("bar.vtu")
    assert main(["new", "--from", "bar.vtu", "--", f"{name}.yaml"]) == 0
    command = capsys.readouterr().out.partition("then gdfe solve ")[2]
    (path,) = shlex.split(command)
    assert not path.startswith("-")
    assert load_scene(path).name == {"my part (1)": "my_part__1_", "hülle": "h_lle", "-x": "_x"}.get(name, "x" * 64)


def test_a_least_size_is_written_into_the_scene(tmp_path: Path) -> None:
    """With ``--least-size``, the scene has the key, and loads."""
    trimesh.creation.box((0.04, 0.04, 0.003)).export(tmp_path / "plate.stl")
    given = ["--from", str(tmp_path / "plate.stl"), "--size", "0.02", "--least-size", "0.005"]
    assert main(["new", str(tmp_path / "plate.yaml"), *given]) == 0
    assert "size: 0.02, least_size: 0.005" in (tmp_path / "plate.yaml").read_text()
    assert load_scene(tmp_path / "plate.yaml").mesh.noun == "tetrahedra"


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("suffix", "sizes", "told"),
    [
        ("stl", ["--size", "0"], "--size = 0; allowed is a number: 0 < largest edge of the tetrahedra [m] <= 1"),
        ("stl", ["--size", "4"], "0 < largest edge of the tetrahedra [m] <= 1; 4 mm are 0.004"),
        ("stl", ["--least-size", "-1"], "--least-size = -1; allowed is a number: 0 < smallest edge"),
        ("stl", ["--size", "nan"], "--size = nan; allowed is a number: 0 < "),
        ("stl", ["--least-size", "nan"], "--least-size = nan; allowed is a number: 0 < "),
        ("stl", ["--scale", "nan"], "--scale = nan; allowed is a number: 0 < metres per unit of the file <= 1000"),
        ("stl", ["--scale", "inf"], "--scale = inf; allowed is a number: 0 < "),
        ("stl", ["--scale", "0"], "--scale = 0; allowed is a number: 0 < "),
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


def _must_not_mesh(*given: object, **options: object) -> None:
    raise AssertionError("a mesher was started")


@pytest.mark.parametrize(
    ("scene", "source", "more", "told"),
    [
        ("there.yaml", "hand.stl", "", "such a file already"),
        ("no/new.yaml", "hand.stl", "", "there is no folder"),
        ("new.yaml", ".", "", "this is a folder"),
        ("new.yaml", "part.step", "--scale 0.001", "a STEP file states its unit; remedy: leave out --scale"),
        ("new.yaml", "part.step", "--cavity far.stl", "close blind holes by a second solid"),
        ("new.yaml", "hand.stl", "--cavity partly.stl", "partly.stl: the air is partly outside"),
        ("new.yaml", "hand.stl", "--cavity far.stl", "far.stl: the air is outside of the body's material at (0.995, "),
        ("new.yaml", "hand.stl", "--cavity far.stl", "m; allowed: wholly inside of the body's material; remedy: "),
        ("new.yaml", "hand.stl", "--material nothing", "there is no such preset; allowed: ecoflex_00_30, "),
        ("new.yaml", "hand.stl", "--material ecoflex_0030", "did you mean 'ecoflex_00_30'? allowed: "),
        ("new.yaml", "hand.stl", "--material ninjaflex", "has no Poisson's ratio, and a scene with it needs the key "
                                                         "`poisson`; remedy: "),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_refused_before_meshing(
    scene: str,
    source: str,
    more: str,
    told: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Paths, cavities and materials that do not fit are refused with a place or the allowed values."""
    monkeypatch.setattr(command, "from_surface", _must_not_mesh)
    monkeypatch.chdir(tmp_path)
    Path("there.yaml").write_text("name: mine")
    trimesh.creation.box((0.1, 0.06, 0.04)).export("hand.stl")
    trimesh.creation.box((0.01, 0.01, 0.01)).apply_translation((1.0, 0, 0)).export("far.stl")
    trimesh.creation.box((0.09, 0.05, 0.03)).apply_translation((0.05, 0, 0)).export("partly.stl")
    Path("part.step").touch()
    before = set(tmp_path.iterdir())
    assert main(["new", scene, "--from", source, *more.split()]) == BAD_INPUT
    assert told in " ".join(capsys.readouterr().err.split())
    assert set(tmp_path.iterdir()) == before


def test_a_preset_in_the_help_is_allowed(capsys: pytest.CaptureFixture[str]) -> None:
    """The example in the help of ``--material`` is the name of a preset."""
    with pytest.raises(SystemExit):
        main(["new", "--help"])
    (example,) = re.findall(r"e\.g\. (\w+) \(default", " ".join(capsys.readouterr().out.split()))
    assert example in PRESETS
