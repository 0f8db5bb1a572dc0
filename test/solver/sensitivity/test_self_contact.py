# SPDX-License-Identifier: Apache-2.0
"""Exact derivatives of soft parts in contact with each other, against differences of steps from that state."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from gdfe_ros import Command, Pose, Simulation, load_scene
from gdfe_ros.scene import scene_from_text

BLOCKS = """
name: blocks
meshes:
  lower: {bar: {size: [0.02, 0.02, 0.01], cells: [3, 3, 2]}}
  upper: {bar: {size: [0.012, 0.012, 0.01], cells: [2, 2, 2]}, at: [0.004, 0, 0.0105], rotation_deg: [0, 0, 6]}
materials:
  hard: {law: neo_hookean, young: 1.5e5, poisson: 0.3, density: 1000}
  soft: {law: neo_hookean, young: 1.0e5, poisson: 0.3, density: 1000}
regions: [{material: hard}, {material: soft, where: {mesh: lower}}]
handles: {floor: {where: {mesh: lower, face: z-}, fixed: true}, lid: {where: {mesh: upper, face: z+}}}
self_contact: {friction: 0.0}
probes: {top: {mesh: lower, at: [0.009, 0.001, 0.005]}, under: {mesh: upper, at: [0.003, 0.002, -0.005]}}
solver: {tolerance: 1.0e-10, max_iterations: 100000}
"""
NEAR = 1e-4
"""Allowed relative difference between a derivative and a difference."""
SLIPPING = 5e-4
"""The same after ten steps in which pairs slip; the measured difference is 1.7e-4."""
ROUGH = 3e-3
"""The same where an edge slips along another one: the differences vary by 1e-3 with the rounding."""
ARM = 0.01
"""Size of the upper block [m]: the tolerance of moments is that of forces times this length."""


def pressed(friction: float, sideways: list[float], **overrides: Any) -> Simulation:
    """Press the upper block into the lower one, and push it sideways in steps."""
    simulation = Simulation(scene_from_text(BLOCKS, overrides={"self_contact.friction": friction, **overrides}))
    assert simulation.step(lid(0.0)).converged
    for x in sideways:
        assert simulation.step(lid(x)).converged, simulation.result.message
    return simulation


def lid(x: float, z: float = -1.5e-3) -> Command:
    """Return the upper block's handle, moved by (x, 0, z) [m]."""
    return Command(handles={"lid": Pose((x, 0.0, z))})


def seen(simulation: Simulation) -> np.ndarray:
    """Return the probes (6,) [m] and the reaction of the lid [N, N m] (6,)."""
    return np.concatenate([*simulation.probe_positions().values(), simulation.result.reactions["lid"]])


def agree(exact: np.ndarray, difference: np.ndarray, near: float = NEAR, arm: float = ARM) -> None:
    """Compare positions, forces and moments, each relative to its largest component."""
    places, forces = (np.abs(difference[part]).max() for part in (slice(0, 6), slice(6, 9)))
    for part, size in ((slice(0, 6), places), (slice(6, 9), forces), (slice(9, 12), arm * forces)):
        np.testing.assert_allclose(exact[part], difference[part], rtol=0, atol=near * size)


@pytest.mark.parametrize(("name", "step"), [("handles.lid.z", 1e-6), ("materials.soft.young", 30.0)])
def test_without_friction(name: str, step: float) -> None:
    """Without friction, derivatives by the lid's displacement and by a modulus equal differences."""
    outputs = ["probes.top", "probes.under", "reactions.lid"]
    exact = pressed(0.0, []).sensitivities(outputs, [name]).matrix[:, 0]
    sides = []
    for change in (step, -step):
        if name == "handles.lid.z":
            simulation = pressed(0.0, [])
            assert simulation.step(lid(0.0, -1.5e-3 + change)).converged
        else:
            simulation = pressed(0.0, [], **{name: 1e5 + change})
        sides.append(seen(simulation))
    agree(exact, (sides[0] - sides[1]) / (2.0 * step))


@pytest.mark.parametrize("friction", [2.0, 0.1])
def test_with_friction(friction: float) -> None:
    """With friction, the derivative by the upper block's sideways push equals differences in stick and in slip."""
    simulation = pressed(friction, [1e-5] if friction > 1.0 else [4e-4, 8e-4, 1.0e-3])
    here, at = simulation.snapshot(), 1e-5 if friction > 1.0 else 1.0e-3
    exact = simulation.sensitivities(["probes.top", "probes.under", "reactions.lid"], ["handles.lid.x"]).matrix[:, 0]
    began, slopes = seen(simulation), []
    for step in (2e-7, 4e-7):
        simulation.restore(here)
        assert simulation.step(lid(at + step)).converged
        slopes.append((seen(simulation) - began) / step)
    agree(exact, 2.0 * slopes[0] - slopes[1])


@pytest.mark.parametrize("friction", [0.0, 2.0])
def test_of_skins(tmp_path: Path, friction: float) -> None:
    """With two balls that touch by their skins, derivatives equal differences.

    They are by a modulus without friction, and by the lid's sideways push where friction holds: friction is measured
    from the last state, which the derivative holds.
    """
    trimesh.creation.icosphere(3, 0.01).export(tmp_path / "ball.stl")
    ball = "{voxels: {surface: ball.stl, cell: 0.004, cells: cut}, skin: {file: ball.stl}"
    meshes = f"meshes:\n  lower: {ball}}}\n  upper: {ball}, at: [0.001, 0.002, 0.0201], rotation_deg: [5, 9, 20]}}\n"
    text = meshes + BLOCKS[BLOCKS.index("materials:") :]
    text = text.replace("face: z-", "box: {z: [-1, -0.004]}").replace("face: z+", "box: {z: [0.004, 1]}")
    text = text.replace("[0.009, 0.001, 0.005]", "[0, 0, 0.006]").replace("[0.003, 0.002, -0.005]", "[0, 0, -0.006]")
    (tmp_path / "balls.yaml").write_text(f"name: balls\n{text}")

    def pressed_balls(young: float, *ways: float) -> Simulation:
        overrides = {"self_contact.friction": friction, "materials.soft.young": young}
        simulation = Simulation(load_scene(tmp_path / "balls.yaml", overrides=overrides))
        for x in ways or (0.0, 2e-5):
            assert simulation.step(lid(x)).converged, simulation.result.message
        return simulation

    outputs = ["probes.top", "probes.under", "reactions.lid"]
    simulation, by = pressed_balls(1e5), "materials.soft.young" if friction == 0.0 else "handles.lid.x"
    exact = simulation.sensitivities(outputs, [by]).matrix[:, 0]
    if friction == 0.0:
        sides, apart = [seen(pressed_balls(young)) for young in (1e5 + 30.0, 1e5 - 30.0)], 60.0
    else:
        sides, apart = [], 2e-6
        for x in (2.1e-5, 1.9e-5):
            simulation = pressed_balls(1e5, 0.0)
            assert simulation.step(lid(x)).converged
            sides.append(seen(simulation))
    difference = (sides[0] - sides[1]) / apart
    agree(exact, difference, NEAR if friction == 0.0 else ROUGH)


@pytest.mark.parametrize("friction", [0.0, 0.1, 2.0])
def test_in_motion(friction: float) -> None:
    """Over ten steps in motion, the derivative by one block's modulus equals differences."""

    def moved(change: float, followed: bool = False) -> Simulation:
        more = {"self_contact.friction": friction, "materials.soft.young": 1e5 + change, "dynamics": {"step": 0.005}}
        simulation = Simulation(scene_from_text(BLOCKS, overrides=more))
        if followed:
            simulation.follow(["materials.soft.young"])
        for step in range(1, 11):
            assert simulation.step(lid(2e-4 * max(0, step - 5), -1.5e-3 * min(1.0, step / 5))).converged
        return simulation

    exact = moved(0.0, followed=True).sensitivities(["probes.top", "probes.under", "reactions.lid"]).matrix[:, 0]
    found = {change: seen(moved(change)) for change in (50.0, -50.0, 100.0, -100.0)}
    near, far = ((found[h] - found[-h]) / (2.0 * h) for h in (50.0, 100.0))
    agree(exact, (4.0 * near - far) / 3.0, SLIPPING if friction == 0.1 else NEAR)


CROSS = """
name: cross
meshes:
  low: {bar: {size: [0.1, 0.01, 0.01], cells: [6, 1, 1]}, rotation_deg: [45, 0, 0]}
  high: {bar: {size: [0.1, 0.01, 0.01], cells: [6, 1, 1]}, at: [0.043, -0.056, 0.0145],
    rotation_deg: [[45, 0, 0], [0, 0, 90]]}
materials: {soft: {law: neo_hookean, young: 1.0e5, poisson: 0.3, density: 1000}}
regions: [{material: soft}]
handles:
  floor: {where: {any: [{mesh: low, face: x-}, {mesh: low, face: x+}]}, fixed: true}
  lid: {where: {any: [{mesh: high, face: x-}, {mesh: high, face: x+}]}}
self_contact: {friction: 0.0}
probes: {top: {mesh: low, at: [0.043, 0.004, 0.004]}, under: {mesh: high, at: [0.05, 0.0, 0.0]}}
solver: {tolerance: 1.0e-10, max_iterations: 100000}
"""


@pytest.mark.parametrize("friction", [0.0, 0.2, 2.0])
def test_of_edges_that_cross(friction: float) -> None:
    """Derivatives of two bars whose edges cross equal differences: free to slip, slipping and sticking."""
    simulation = Simulation(scene_from_text(CROSS, overrides={"self_contact.friction": friction}))
    for x, z in ((0.0, -1e-3), (0.0, -2e-3), *([(1e-3, -2e-3), (1.5e-3, -2e-3)] if friction < 1.0 else [])):
        assert simulation.step(lid(x, z)).converged, simulation.result.message
    exact = simulation.sensitivities(["probes.top", "probes.under", "reactions.lid"], ["handles.lid.x"]).matrix[:, 0]
    here, began, slopes = simulation.snapshot(), seen(simulation), []
    size, near = (4e-6, ROUGH) if 0.0 < friction < 1.0 else (1e-5, NEAR)
    for step in (size, 2.0 * size):
        simulation.restore(here)
        assert simulation.step(lid(x + step, z)).converged
        slopes.append((seen(simulation) - began) / step)
    agree(exact, 2.0 * slopes[0] - slopes[1], near, arm=0.05)


SLOT = """
name: slot
mesh: {bar: {size: [0.06, 0.02, 0.03], cells: [12, 2, 6], cut: [{box: {x: [0.02, 0.06], z: [-0.005, 0.005]}}]}}
materials: {soft: {law: neo_hookean, young: 1.0e5, poisson: 0.4, density: 1000}}
regions: [{material: soft}]
handles: {base: {where: {face: x-}}}
actuators: {pull: {cable: {points: [[0.055, 0, 0.01], [0.055, 0, -0.01]], command: shortening}}}
self_contact: {friction: 1.0}
loads: {weight: {gravity: [0, 1.0, -9.81]}}
probes: {tip: [0.06, 0.01, 0.015]}
solver: {tolerance: 1.0e-9}
"""


def test_of_a_body_that_only_contact_makes_stable() -> None:
    """Lips that a cable pulls together would buckle; where they stick to each other, derivatives equal differences."""
    simulation = Simulation(scene_from_text(SLOT))
    assert simulation.step(Command(actuators={"pull": 0.0115})).converged
    exact = simulation.sensitivities(["probes.tip"], ["actuators.pull"]).matrix[:, 0]
    here, places = simulation.snapshot(), []
    for change in (1e-5, -1e-5):
        simulation.restore(here)
        assert simulation.step(Command(actuators={"pull": 0.0115 + change})).converged
        places.append(simulation.probe_positions()["tip"])
    np.testing.assert_allclose(exact, (places[0] - places[1]) / 2e-5, rtol=5e-3)
