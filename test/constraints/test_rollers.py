# SPDX-License-Identifier: Apache-2.0
"""Rollers and planes of symmetry: each vertex of a handle with `slide` slides by itself."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import fsolve

from gdfe_ros import Command, Pose, Simulation
from gdfe_ros.errors import CommandError, SceneError
from test.written import advance, scene_of

MATERIAL = """
materials: {m: {law: neo_hookean, young: 1.0e5, poisson: 0.4, density: 1000}}
solver: {tolerance: 1.0e-7}
"""
EIGHTH = (
    MATERIAL
    + """
mesh: {bar: {size: [0.04, 0.02, 0.02], cells: [4, 2, 2]}}
handles:
  mx: {where: {face: x-}, slide: [y, z]}
  my: {where: {face: y-}, slide: [x, z]}
  mz: {where: {face: z-}, slide: [x, y]}
loads: {pull: {surface: {where: {face: x+}, traction: [3.0e4, 0, 0]}}}
"""
)


def test_a_block_between_symmetry_planes_is_stretched_evenly() -> None:
    """Under a traction, an eighth of a block has the closed form's stretches; its planes bear what symmetry asks."""
    simulation = Simulation(scene_of(EIGHTH))
    result = simulation.step()
    mu, lame = 1e5 / 2.8, 1e5 * 0.4 / (1.4 * 0.2)

    def balance(stretches: np.ndarray) -> list[float]:
        along, across = stretches
        bulk = lame * np.log(along * across**2)
        return [mu * (along - 1 / along) + bulk / along - 3e4, mu * (across - 1 / across) + bulk / across]

    along, across = fsolve(balance, [1.2, 0.9])
    corner = np.array([0.0, -0.01, -0.01])
    assert result.converged
    expected = corner + (simulation.mesh.vertices - corner) * [along, across, across]
    np.testing.assert_allclose(result.positions, expected, atol=1e-7)
    np.testing.assert_allclose(result.reactions["mx"][:3], [-3e4 * 4e-4, 0, 0], atol=1e-4)
    np.testing.assert_allclose([result.reactions[name][:3] for name in ("my", "mz")], 0.0, atol=1e-4)


@pytest.mark.parametrize("order", [("l", "r", "sy", "sz"), ("l", "sy", "sz", "r"), ("sy", "sz", "l", "r")])
def test_reactions_of_rollers_do_not_depend_on_their_order(order: tuple[str, ...]) -> None:
    """A block that grows between two rollers presses both with E A (1.1 - 1 / 1.1) / 2; planes beside it bear nothing.

    A shared vertex gave all its forces to the first roller, also along axes on which this roller slides.
    """
    planes = {"l": "x- y z", "r": "x+ y z", "sy": "y- x z", "sz": "z- x y"}
    handles = {
        name: {"where": {"face": face}, "slide": axes} for name in order for face, *axes in [planes[name].split()]
    }
    text = MATERIAL + "mesh: {bar: {size: [0.02, 0.02, 0.02], cells: [2, 2, 2]}}\nhandles: {}\n"
    growth = {"g": {"growth": {"stretch": [1.1, 1.0, 1.0]}}}
    scene = scene_of(text, materials__m__poisson=0.0, handles=handles, actuators=growth)
    reactions = Simulation(scene).step(Command(actuators={"g": 1.0})).reactions
    force = 0.5e5 * 4e-4 * (1.1 - 1.0 / 1.1)
    for name, expected in {"l": force, "r": -force, "sy": 0.0, "sz": 0.0}.items():
        np.testing.assert_allclose(reactions[name][:3], [expected, 0.0, 0.0], atol=1e-6 * force)


def test_thousands_of_vertices_on_rollers_add_no_rigid_parts() -> None:
    """A plane of symmetry with 2209 vertices, held by rollers alone, is stretched as the closed form says."""
    text = EIGHTH.replace("cells: [4, 2, 2]", "cells: [2, 46, 46]")
    simulation = Simulation(scene_of(text))
    assert simulation.stepper.body.unknowns.rigid_rows == 0
    result = advance(simulation)
    coarse = Simulation(scene_of(EIGHTH)).step()
    np.testing.assert_allclose(result.positions[-1], coarse.positions[-1], atol=1e-7)
    assert result.reactions["mx"][0] == pytest.approx(-3e4 * 4e-4, rel=1e-5)


HALVES = {
    "half": ("{size: [0.03, 0.02, 0.02], cells: [6, 4, 4]}", "mirror: {where: {face: x-}, slide: [y, z]}"),
    "whole": ("{size: [0.06, 0.02, 0.02], cells: [12, 4, 4]}", "other: {where: {face: x-}}"),
}


def _bent(kind: str, more: str = "") -> tuple[Simulation, object]:
    """Return a bar that is moved down at its ends, or its right half beside a plane of symmetry."""
    size, handle = HALVES[kind]
    text = f"{MATERIAL}mesh: {{bar: {size}}}\nhandles: {{{handle}, tip: {{where: {{face: x+}}}}}}\n{more}"
    simulation = Simulation(scene_of(text))
    poses = {"tip": Pose((0.001, 0, -0.006), (0, 0.3, 0))}
    if kind == "whole":
        poses["other"] = Pose((-0.001, 0, -0.006), (0, -0.3, 0))
    return simulation, poses


@pytest.mark.parametrize("more", ["loads: {w: {gravity: [0, 0, -9.81]}}", "dynamics: {step: 0.002}"])
def test_half_a_bar_moves_as_the_whole(more: str) -> None:
    """A half beside a plane of symmetry, which slides vertically, has the whole bar's positions and reaction."""
    found = []
    for kind in HALVES:
        simulation, poses = _bent(kind, more)
        result = advance(simulation, Command(poses), dt=0.002, count=3)
        right = simulation.mesh.vertices[:, 0] > (0.0299 if kind == "whole" else -1.0)
        rest = simulation.mesh.vertices[right] - [0.03 if kind == "whole" else 0.0, 0, 0]
        order = np.lexsort(rest.round(6).T)
        found.append(((result.positions[right] - simulation.mesh.vertices[right])[order], result.reactions["tip"]))
    (half, of_half), (whole, of_whole) = found
    np.testing.assert_allclose(half, whole, atol=3e-6)
    np.testing.assert_allclose(of_half[:3], of_whole[:3], atol=1e-3)


def test_derivatives_agree_with_differences() -> None:
    """The derivative of a probe on the plane by the commanded height agrees with central differences."""
    simulation, poses = _bent("half", "probes: {middle: [0, 0, 0]}\nloads: {w: {gravity: [0, 0, -9.81]}}\n")

    def middle(height: float) -> np.ndarray:
        simulation.step(Command({"tip": Pose((0.001, 0, -0.006 + height), poses["tip"].rotation)}))
        return simulation.probe_positions()["middle"].copy()

    expected = (middle(1e-4) - middle(-1e-4)) / 2e-4
    middle(0.0)
    found = simulation.sensitivities(["probes.middle"], ["handles.tip.z"]).of("probes.middle", "handles.tip.z")
    np.testing.assert_allclose(found, expected, atol=2e-3)
    assert abs(expected[2]) > 0.1


def test_rollers_take_no_commands_and_need_a_place_of_their_own() -> None:
    """A command of rollers, rollers that are fixed, and rollers wholly inside of a handle are refused."""
    simulation = Simulation(scene_of(EIGHTH))
    with pytest.raises(CommandError, match="mx"):
        simulation.step(Command({"mx": Pose((0, 0, 0.01))}))
    with pytest.raises(SceneError, match="slide excludes fixed"):
        scene_of(EIGHTH.replace("slide: [y, z]", "slide: [y, z], fixed: true"))
    with pytest.raises(SceneError, match="belongs to other handles"):
        scene_of(EIGHTH.replace("  my:", "  all: {where: {face: x-}, fixed: true}\n  my:"))
