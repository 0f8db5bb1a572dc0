# SPDX-License-Identifier: Apache-2.0
"""Chambers whose open edges lie on handles: plates that move with the handles close them."""

from __future__ import annotations

import numpy as np
import pytest

from gdfe_ros import Command, Pose, Simulation
from gdfe_ros.errors import SceneError
from gdfe_ros.mesh import bar
from gdfe_ros.mesh.files.stored_mesh import pack_mesh
from gdfe_ros.mesh.tetmesh import divide
from test.written import advance, scene_of

BOX = """
mesh: {bar: {size: [0.05, 0.05, 0.03], cells: [5, 5, 3], cut: [{box: {x: [0.01, 0.04], y: [-0.015, 0.015],
  z: [-0.005, 0.005]}}]}}
materials: {m: {law: neo_hookean, young: 1.0e5, poisson: 0.45, density: 1000}}
handles:
  rim:
    where:
      any: [{box: {x: [-1, 0.01]}}, {box: {x: [0.04, 1]}}, {box: {y: [-1, -0.015]}}, {box: {y: [0.015, 1]}},
        {box: {z: [-1, -0.005]}}]
probes: {top: [0.025, 0, 0.015]}
actuators: {air: {chamber: {CHAMBER, command: pressure}}}
solver: {tolerance: 1.0e-7}
"""
LID = "where: {box: {x: [0.01, 0.04], y: [-0.015, 0.015], z: [0.005, 0.005]}}"
KINDS = {
    "hexahedra": lambda text: text,
    "volume": lambda text: text.replace("pressure", "volume"),
    "motion": lambda text: text + "dynamics: {step: 0.002}\n",
}


def _simulation(chamber: str, kind: str = "hexahedra") -> Simulation:
    return Simulation(scene_of(KINDS[kind](BOX.replace("CHAMBER", chamber))))


@pytest.mark.parametrize("kind", KINDS)
def test_an_open_lid_moves_as_a_closed_chamber(kind: str) -> None:
    """The lid of a chamber whose other walls are held moves as with the whole chamber; so do reaction and torque."""
    found = []
    for chamber in ("cavity: 0", LID):
        simulation = _simulation(chamber, kind)
        rest = simulation.commands["air"]
        command = Command({"rim": Pose((0.0, 0.001, 0.0), (0.3, 0.0, 0.1))}, actuators={"air": rest + 1e-6})
        if kind != "volume":
            command = Command(command.handles, actuators={"air": 5e3})
        results = [simulation.step(command, dt=0.002) for _ in range(2)]
        assert results[-1].converged
        found.append((results[-1].positions, results[-1].reactions["rim"], results[-1].actuators["air"].effort))
    for whole, lid in zip(*found, strict=True):
        np.testing.assert_allclose(lid, whole, atol=1e-5 * np.abs(whole).max())


def test_derivatives_are_those_of_a_closed_chamber() -> None:
    """Derivatives by the pressure and by the handle's rotation are those with the whole chamber."""
    found = []
    for chamber in ("cavity: 0", LID):
        simulation = _simulation(chamber)
        simulation.step(Command(actuators={"air": 5e3}))
        names = ["actuators.air", "handles.rim.rx", "materials.m.young"]
        found.append(simulation.sensitivities(["probes.top", "reactions.rim"], names).matrix)
    assert (np.abs(found[1] - found[0]).max(axis=0) < 1e-4 * np.abs(found[0]).max(axis=0)).all()


def test_tetrahedra_bulge_as_hexahedra() -> None:
    """A flat plate of tetrahedra that is clamped at its sides bulges by as much as one of hexahedra."""
    text = BOX[BOX.index("materials") : BOX.index("handles")] + (
        "name: plate\nprobes: {top: [0.04, 0, 0.002]}\nactuators: {air: {chamber: {where: {face: z-}}}}\n"
        "handles: {rim: {where: {any: [{face: x-}, {face: x+}, {face: y-}, {face: y+}]}}}\n"
    )
    heights = []
    plate = bar([0.08, 0.08, 0.004], [8, 8, 1])
    for mesh in (plate, divide(plate)):
        simulation = Simulation(scene_of(f"{text}mesh: {{embedded: {pack_mesh(mesh)}}}\n"))
        assert simulation.commands["air"] == 0.0
        result = advance(simulation, Command(actuators={"air": 1e3}))
        np.testing.assert_allclose(result.reactions["rim"][:3], 0.0, atol=1e-2)  # the plate and the rim are one
        heights.append(simulation.probe_positions()["top"][2] - 0.002)
    assert heights[0] > 0.004
    assert heights[1] == pytest.approx(heights[0], rel=0.1)


def test_an_edge_beside_the_handles_leaks() -> None:
    """An open edge that no handle holds, or that leads from one handle to another, is named with its place."""
    with pytest.raises(SceneError, match=r"leak at 3 edges.*hold each open end by one handle"):
        scene_of(BOX.replace("CHAMBER", LID).replace("{box: {x: [-1, 0.01]}}, ", ""))
    text = BOX.replace("CHAMBER", LID).replace("{box: {x: [-1, 0.01]}}, ", "")
    with pytest.raises(SceneError, match=r"leak at \d+ edges.*hold each open end by one handle"):
        scene_of(text.replace("probes:", "  left: {where: {box: {x: [-1, 0.01], z: [0.004, 1]}}}\nprobes:"))
