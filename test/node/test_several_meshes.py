# SPDX-License-Identifier: Apache-2.0
"""Several soft meshes in a node: one mesh on its topics, positions by name, bags without files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import meshio
import numpy as np
import pytest

from gdfe_ros.analysis.bag_run import BagRun
from gdfe_ros.cli import main
from gdfe_ros.constraints import Pose
from gdfe_ros.mesh import bar
from gdfe_ros.simulation import Command
from gdfe_ros.testing import Simulator

PADS = """
name: pads
description: Two pads of one file close on a block that nothing holds.
meshes:
  left: {file: pad.vtk, at: [-0.03, 0, 0]}
  right: {file: pad.vtk, at: [0.03, 0, 0], rotation_deg: [0, 0, 180]}
  part: {bar: {size: [0.02, 0.016, 0.016], cells: [2, 2, 2]}, at: [-0.01, 0, 0]}
materials: {soft: {law: neo_hookean, young: 2.0e5, poisson: 0.4, density: 1000}}
regions: [{material: soft}]
handles: {left: {where: {mesh: left, face: x-}}, right: {where: {mesh: right, face: x-}}}
self_contact: {friction: 0.8}
sensors: {left: {where: {mesh: left, face: x+}}, part: {where: {mesh: part}}}
probes: {middle: {mesh: part, at: [0.01, 0, 0]}}
dynamics: {scheme: bdf2, step: 0.01, damping: {viscosity: 500}}
loads: {weight: {gravity: [0, 0, -9.81]}}
solver: {tolerance: 1.0e-5}
"""


def test_a_part_is_held_told_and_replayed(tmp_path: Path, replays: Callable) -> None:
    """A block held by two pads stays, each pad has its force, and the replay has the same bits."""
    mesh = bar([0.02, 0.02, 0.02], [2, 2, 2])
    meshio.Mesh(mesh.vertices, [("hexahedron", mesh.cells)]).write(tmp_path / "pad.vtk", binary=False)
    path, bag = tmp_path / "pads.yaml", tmp_path / "bag"
    path.write_text(PADS)
    with Simulator(path, bag=bag, parameters={"dt": 0.02}) as simulator:
        scene = simulator.scene
        assert scene.mesh.n_vertices == 3 * 27
        assert simulator.state.positions.shape == (81, 3)
        close = {"left": Pose((0.0015, 0.0, 0.0)), "right": Pose((-0.0015, 0.0, 0.0))}
        for _ in range(40):
            state = simulator.step(Command(handles=close))
        first = scene.mesh.parts["part"].first_vertex
        points = state.contacts
        assert ((points["vertex"] < first) != (points["other"] < first)).all()
        felt, held = state.sensors["left"][:3], state.sensors["part"][:3]
        weight = 1000 * 0.02 * 0.016**2 * 9.81
        assert felt[0] < -0.1
        assert held[2] == pytest.approx(weight, rel=0.05)
        assert state.probes["middle"].translation[2] == pytest.approx(0.0, abs=3e-4)
    (tmp_path / "pad.vtk").unlink()
    assert {("mesh", "x"), ("contacts", "other"), ("sensors/part/wrench", "wrench.force.z")} <= replays(bag)
    assert main(["report", str(bag), "--out", str(tmp_path / "report.html")]) == 0
    np.testing.assert_array_equal(BagRun(bag).scene.mesh.vertices, scene.mesh.vertices)
