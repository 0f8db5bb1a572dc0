# SPDX-License-Identifier: Apache-2.0
"""A surface file with a cavity becomes a chambered robot with one scene file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from gdfe_ros import Simulation, load_scene
from gdfe_ros.cli import main
from gdfe_ros.simulation import Command

SCENE = """\
name: blown
mesh: {voxels: {surface: body.stl, cell: 0.002, scale: 0.001}}
materials: {rubber: {law: neo_hookean, young: 0.3e6, poisson: 0.45}}
regions: [{material: rubber}]
handles: {base: {where: {face: x-}, fixed: true}}
actuators: {air: {chamber: {command: pressure, range: [0, 40.0e3]}}}
probes: {top: [0, 0, 0.01]}
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Write a hollow box in millimetres with a cavity off its centre, and its scene; return the folder."""
    outer = trimesh.creation.box([40, 20, 20])
    inner = trimesh.creation.box([32, 12, 12])
    inner.apply_translation([0, 0, 2])
    inner.invert()
    trimesh.util.concatenate([outer, inner]).export(tmp_path / "body.stl")
    (tmp_path / "blown.yaml").write_text(SCENE)
    return tmp_path


def test_surface_with_a_cavity_becomes_a_robot(folder: Path) -> None:
    """The filled box has the chamber, and under pressure its thin roof rises and the volume grows."""
    simulation = Simulation(load_scene(folder / "blown.yaml"))
    assert simulation.actuator_states()["air"].extent == pytest.approx(32 * 12 * 12 * 1e-9)
    result = simulation.step(Command(actuators={"air": 2e4}))
    assert result.converged
    assert result.actuators["air"].extent > 1.05 * 32 * 12 * 12 * 1e-9
    assert simulation.probe_positions()["top"][2] > 0.0105
    np.testing.assert_allclose(result.reactions["base"][:3], 0.0, atol=2e-3)


def test_inspect_names_the_cavity(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """``inspect`` prints counts and the cavity, and requests the scale of a file in millimetres."""
    assert main(["inspect", str(folder / "body.stl"), "--scale", "0.001"]) == 0
    shown = capsys.readouterr().out
    assert "bodies, cavities" in shown
    assert "1, 1" in shown
    assert main(["inspect", str(folder / "body.stl")]) == 1
    assert "scale: 0.001" in " ".join(capsys.readouterr().err.split())


def test_inspect_draws_hexahedra(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """``inspect`` draws a mesh file, and reports a missing file."""
    import meshio

    from gdfe_ros.mesh import bar

    mesh = bar([0.1, 0.02, 0.02], [4, 2, 2])
    meshio.Mesh(mesh.vertices, [("hexahedron", mesh.cells)]).write(tmp_path / "bar.vtk")
    picture = tmp_path / "bar.png"
    assert main(["inspect", str(tmp_path / "bar.vtk"), "--picture", str(picture)]) == 0
    assert picture.stat().st_size > 5000
    assert "can be used as it is" in capsys.readouterr().out
    assert main(["inspect", str(tmp_path / "none.vtk")]) == 2
    assert "there is no such file" in capsys.readouterr().err
