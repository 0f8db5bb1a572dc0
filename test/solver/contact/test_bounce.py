# SPDX-License-Identifier: Apache-2.0
"""A ball that bounces."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from gdfe_ros.mesh.files.stored_mesh import pack_surface
from test.written import simulate, trace

BALL = """
mesh: {sphere: {inner: 0.02, outer: 0.05, cells: [4, 2]}}
materials: {soft: {law: neo_hookean, young: 2.0e5, poisson: 0.4, density: 1000}}
handles: {}
loads: {weight: {gravity: [0, 0, -9.81]}}
obstacles: {floor: {plane: [0, 0, 1], at: [0, 0, -0.06], fixed: true}}
dynamics: {step: 0.002}
"""
SHOT = """
mesh: {bar: {size: [0.05, 0.05, 0.05], cells: [3, 3, 3]}}
materials: {soft: {law: neo_hookean, young: 1.0e6, poisson: 0.4, density: 1000}}
handles: {}
obstacles: {wall: {box: {size: [0.01, 1, 1]}, at: [0.32, 0, 0], fixed: true}}
dynamics: {step: 0.005, velocity: [20, 0, 0]}
"""


@pytest.mark.parametrize("scheme", ["newmark", "generalised_alpha", "bdf2"])
def test_no_bounce_makes_energy(scheme: str) -> None:
    """A rubber ball that falls by a centimetre bounces back and never has more energy than at its start."""
    simulation = simulate(BALL, dynamics__scheme=scheme)
    energies = ("kinetic", "elastic", "potential")
    mass = float(simulation.stepper.mass.sum())
    heights, totals = trace(
        simulation, 120, lambda result: (result.positions[:, 2].mean(), sum(map(result.energies.get, energies)))
    ).T
    lowest = int(np.argmin(heights))
    assert heights[lowest] < -0.01
    assert max(heights[lowest:]) > -0.008
    assert max(totals) < 1e-6 * mass * 9.81 * 0.01


@pytest.mark.parametrize(("thickness", "kind"), [(0.002, "box"), (0.05, "box"), (0.05, "mesh")])
def test_what_is_fast_does_not_pass_a_wall(thickness: float, kind: str) -> None:
    """A cube that hits a wall at 20 m/s, ten centimetres per step of 5 ms, bounces off, however thin the wall is.

    The speed after the impact depends on the moment of the impact within the step.
    """
    surface = trimesh.creation.box((thickness, 1.0, 1.0))
    forms = {
        "box": {"size": [thickness, 1.0, 1.0]},
        "mesh": {"embedded": pack_surface(surface.vertices, surface.faces), "cell": 0.01},
    }
    wall = {kind: forms[kind], "at": [0.32, 0.0, 0.0], "fixed": True}
    simulation = simulate(SHOT, obstacles__wall=wall)
    fronts = trace(simulation, 10, lambda result: result.positions[:, 0].max())
    face = 0.32 - 0.5 * thickness
    assert max(fronts) == pytest.approx(face, abs=1e-4 * simulation.mesh.size)
    assert simulation.result.velocities[:, 0].mean() < -2.0
