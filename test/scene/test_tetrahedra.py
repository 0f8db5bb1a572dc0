# SPDX-License-Identifier: Apache-2.0
"""Scenes with bodies of tetrahedra: chambers, cables, loads, contact and motion; unsupported features are refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest

from gdfe_ros.command import Command
from gdfe_ros.constraints import Pose
from gdfe_ros.errors import SceneError
from gdfe_ros.mesh import HexMesh, TetMesh, bar
from gdfe_ros.mesh.assembly import keep_cells
from gdfe_ros.mesh.files.stored_mesh import pack_mesh
from gdfe_ros.mesh.tetmesh import divide, elevate
from gdfe_ros.scene import Scene
from gdfe_ros.scene.loader import scene_from_text
from gdfe_ros.scene.solvable import remarks
from gdfe_ros.simulation import Simulation
from gdfe_ros.solver.settings import Policy
from test import written
from test.written import advance

YOUNG = 1e5
SLAB = bar([0.1, 0.1, 0.04], [3, 3, 1])


RUBBER = f"materials: {{rubber: {{law: neo_hookean, young: {YOUNG}, poisson: 0.0, density: 1000}}}}\n"
TWO = f"""{RUBBER}
handles: {{base: {{where: {{mesh: low, face: z-}}, fixed: true}}, top: {{where: {{mesh: high, face: z+}}}}}}
self_contact: {{}}
solver: {{tolerance: 1.0e-5}}
"""


def scene_of(mesh: HexMesh | TetMesh, **entries: Any) -> Any:
    """Return a scene of one rubber body with further entries."""
    base = {"base": {"where": {"face": "z-"}, "fixed": True}}
    return written.scene_of(RUBBER, {"mesh": {"embedded": pack_mesh(mesh)}, "handles": base, **entries})


def test_a_plate_presses_evenly() -> None:
    """A slab of nu = 0 compressed by a tenth has the exact uniaxial force and no lateral displacement, to 1e-3."""
    plate = {"plate": {"plane": [0, 0, -1], "at": [0.05, 0.0, 0.02]}}
    simulation = Simulation(scene_of(divide(SLAB), obstacles=plate, solver={"tolerance": 1e-5}))
    for down in (0.001, 0.002, 0.003, 0.004):
        result = advance(simulation, Command(handles={"plate": Pose((0.0, 0.0, -down))}))
    stretch = 0.9
    exact = -0.5 * YOUNG * (stretch - 1.0 / stretch) * 0.01
    assert -result.reactions["plate"][2] == pytest.approx(exact, rel=1e-3)
    assert result.reactions["base"][2] == pytest.approx(exact, rel=2e-3)
    moved = result.positions - simulation.mesh.vertices
    assert np.abs(moved[:, :2]).max() < 1e-3 * 0.004


def test_a_chamber_pushes_as_its_pressure_says() -> None:
    """The forces on a closed chamber balance, and its volume grows with the pressure."""
    block = bar([0.09, 0.09, 0.09], [3, 3, 3])
    hollow = divide(keep_cells(block, np.arange(27) != 13))
    air = {"air": {"chamber": {"cavity": 0, "command": "pressure", "range": [0, 2e4]}}}
    simulation = Simulation(scene_of(hollow, actuators=air))
    at_rest = simulation.step(Command(actuators={"air": 0.0}))
    pressed = advance(simulation, Command(actuators={"air": 2e3}))
    assert at_rest.actuators["air"].extent == pytest.approx(0.03**3)
    assert pressed.actuators["air"].extent > 1.01 * 0.03**3
    assert np.abs(pressed.reactions["base"][:3]).max() < 1e-4 * 2e3 * 0.03**2


def test_weight_and_cable_reach_the_handle() -> None:
    """The base carries the weight, a traction and a point load; a cable between body points adds no force."""
    loads = {
        "weight": {"gravity": [0, 0, -9.81]},
        "pull": {"surface": {"where": {"face": "z+"}, "traction": [50.0, 0, 0]}},
        "nudge": {"point": {"at": [0.05, 0.0, 0.01], "force": [0, 0.1, 0]}},
    }
    ends = [[0.01, 0.0, 0.005], [0.05, 0.01, 0.015], [0.09, 0.0, 0.005]]
    cable = {"tendon": {"cable": {"points": ends, "command": "tension", "range": [0, 5]}}}
    simulation = Simulation(scene_of(divide(SLAB), loads=loads, actuators=cable, probes={"top": [0.05, 0.0, 0.02]}))
    result = advance(simulation, Command(actuators={"tendon": 0.3}))
    weight = 1000 * 9.81 * 0.1 * 0.1 * 0.04
    np.testing.assert_allclose(result.reactions["base"][:3], [-0.5, -0.1, weight], atol=2e-3 * weight)


def test_a_body_falls_as_it_should() -> None:
    """A free body falls by g t^2 / 2 without strain, and viscosity does not resist rigid motion."""
    mesh = divide(bar([0.1, 0.1, 0.1], [1, 1, 1]))
    dynamics = {"scheme": "newmark", "step": 0.01, "damping": {"viscosity": 50.0}}
    loads = {"weight": {"gravity": [0, 0, -9.81]}}
    simulation = Simulation(scene_of(mesh, handles={}, dynamics=dynamics, loads=loads))
    result = advance(simulation, Command(loads={"weight": 1.0}), count=10)
    drop = (mesh.vertices - result.positions)[:, 2]
    np.testing.assert_allclose(drop, 0.5 * 9.81 * 0.1**2, rtol=1e-4)


def test_a_shaken_body_keeps_its_period_and_damps() -> None:
    """A bar held at one end swings about its static stretch with the period 4 L / c, and viscosity damps it."""
    mesh = divide(bar([0.02, 0.02, 0.2], [1, 1, 6]))
    period = 4.0 * 0.2 / np.sqrt(YOUNG / 1000.0)
    loads = {"pull": {"surface": {"where": {"face": "z+"}, "traction": [0, 0, 200.0]}}}
    heights = {}
    for viscosity in (0.0, 100.0):
        dynamics = {"scheme": "newmark", "step": float(period / 40), "damping": {"viscosity": viscosity}}
        simulation = Simulation(scene_of(mesh, dynamics=dynamics, loads=loads, probes={"end": [0.01, 0.0, 0.1]}))
        steps = [simulation.step(Command(loads={"pull": 1.0})) for _ in range(45)]
        heights[viscosity] = np.array([step.positions[:, 2].max() for step in steps]) - mesh.vertices[:, 2].max()
    still = 200.0 * 0.2 / YOUNG
    assert heights[0.0][:40].mean() == pytest.approx(still, rel=0.02)
    assert abs(int(np.argmax(heights[0.0])) - 19) <= 1
    assert heights[100.0].max() < 0.95 * heights[0.0].max()


def test_what_tetrahedra_lack_is_refused() -> None:
    """The policy `relative` is refused with a remedy."""
    with pytest.raises(SceneError, match="cannot take tetrahedra"):
        scene_of(divide(SLAB), solver={"policy": "relative"})


def _two(low: dict[str, Any], high: dict[str, Any], **entries: Any) -> Scene:
    """Return a scene of two bodies, one above the other, that touch."""
    return written.scene_of(TWO, {"meshes": {"low": low, "high": high}, **entries})


GAP = 1e-4
BLOCK = {"bar": {"size": [0.1, 0.1, 0.04], "cells": [2, 2, 1]}, "at": [0.0, 0.0, 0.04 + GAP]}


def test_hexahedra_press_on_tetrahedra() -> None:
    """In a scene that has tetrahedra, too, hexahedra are divided, told so, and bear the exact uniaxial force."""
    scene = _two({"embedded": pack_mesh(divide(SLAB))}, BLOCK, solver={"tolerance": 1e-4})
    assert [text for text in remarks(scene, Policy.ENERGY) if "4 hexahedra were divided into 24 tetrahedra" in text]
    simulation = Simulation(scene)
    for down in (0.002, 0.004, 0.006, 0.008):
        result = advance(simulation, Command(handles={"top": Pose((0.0, 0.0, -down - GAP))}))
    exact = -0.5 * YOUNG * (0.9 - 1.0 / 0.9) * 0.01
    assert -result.reactions["top"][2] == pytest.approx(exact, rel=0.02)


def test_a_skin_on_hexahedra_beside_tetrahedra_is_refused(tmp_path: Path) -> None:
    """Cut cells and skins cannot be divided into tetrahedra: they are refused by name, with a remedy."""
    surface = tmp_path / "block.stl"
    meshio.Mesh(SLAB.vertices, [("triangle", SLAB.surface()[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3))]).write(surface)
    high = {"voxels": {"surface": str(surface), "cell": 0.015, "cells": "cut"}, "at": [0.0, 0.0, 0.1]}
    lost = "meshes.high .*: other meshes of this scene have tetrahedra, .* cut cells and a skin; remedy: tets"
    with pytest.raises(SceneError, match=lost):
        _two({"embedded": pack_mesh(divide(SLAB))}, {**high, "skin": {"file": str(surface)}})


def test_raised_tetrahedra_are_told() -> None:
    """A remark says that linear tetrahedra of a file were converted to second order."""
    tets = divide(SLAB)
    corners = np.unique(tets.cells[:, :4])
    mesh = elevate(tets.vertices[corners], np.searchsorted(corners, tets.cells[:, :4]), linear=True)
    scene = scene_of(tets)
    object.__setattr__(scene, "mesh", mesh)
    assert any("got a node on each edge" in text for text in remarks(scene, Policy.ENERGY))


def test_a_least_size_above_the_size_is_refused(tmp_path: Path) -> None:
    """A least size above the size is refused with both values before a mesher runs."""
    (tmp_path / "body.step").write_text("")
    entry = f"{{step: {tmp_path / 'body.step'}, size: 0.005, least_size: 0.01}}"
    with pytest.raises(SceneError, match=r"least_size = 0\.01 m; allowed: up to size = 0\.005 m"):
        scene_from_text(f"name: thin\nmesh: {{tets: {entry}}}\n")
