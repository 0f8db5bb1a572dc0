# SPDX-License-Identifier: Apache-2.0
"""Impacts: at whatever moment within a step a soft body hits something, its energy does not grow."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from gdfe_ros import Simulation
from test.solver.motion.landings import thrown
from test.written import advance, scene_of

SOFT = """
materials: {soft: {law: neo_hookean, young: 1.0e6, poisson: 0.4, density: 1000}}
handles: {}
solver: {tolerance: 1.0e-5}
"""
MESHES = {
    "cube": "mesh: {bar: {size: [0.1, 0.1, 0.1], cells: [4, 4, 4]}}",
    "bar": "mesh: {bar: {size: [0.2, 0.03, 0.03], cells: [8, 2, 2]}}",
    "ball": "mesh: {sphere: {inner: 0.02, outer: 0.05, cells: [4, 2]}}",
    "pair": """
meshes:
  low: {bar: {size: [0.05, 0.05, 0.05], cells: [3, 3, 3]}}
  high: {bar: {size: [0.05, 0.05, 0.05], cells: [2, 2, 2]}, at: [0.004, 0.003, 0.053]}
self_contact: {}
""",
}
LOWEST = {"cube": -0.05, "bar": -0.015, "ball": -0.05, "pair": -0.025}
SCHEMES = {
    "newmark": {"scheme": "newmark"},
    "bdf2": {"scheme": "bdf2"},
    **{f"alpha {rho}": {"scheme": "generalised_alpha", "rho_inf": rho} for rho in (0.0, 0.8, 1.0)},
}


def played(simulation: Simulation, count: int) -> tuple[list[float], Any]:
    """Make converging steps; return the energy after each divided by that after the first, and the last result."""
    held = []
    for _ in range(count):
        result = advance(simulation)
        held.append(sum(result.energies[name] for name in ("kinetic", "elastic", "dissipated")))
    return [each / held[0] for each in held], result


BLOWS = [
    ("cube", 1e4, 0.005), ("cube", 1e5, 0.001), ("cube", 1e7, 0.0002), ("cube", 1e7, 0.005),
    ("bar", 1e6, 0.002), ("ball", 1e5, 0.005), ("pair", 1e5, 0.002), ("pair", 1e7, 0.001),
]  # fmt: skip
"""Cases of impacts: mesh, Young's modulus [Pa] and step [s]."""
PAIRED = ("bdf2", "newmark", "alpha 0.8")
"""Schemes used for the case of two bodies, which takes longest."""
STAYS = ("cube", 1e7, 0.005, "bdf2")
"""A case without a rebound: the BDF2 step that would gain energy is repeated by backward Euler (test_ceiling.py)."""
THROWN = [
    case
    for case in ((*blow, scheme) for blow in BLOWS for scheme in SCHEMES)
    if case != STAYS and (case[0] != "pair" or case[3] in PAIRED)
]


@pytest.mark.parametrize(("mesh", "young", "step", "scheme"), THROWN)
def test_a_blow_makes_no_energy(mesh: str, young: float, step: float, scheme: str) -> None:
    """A body thrown at a floor rebounds without an energy gain, at two moments of impact within a step.

    Schemes without damping keep the energy of linear bodies only; here it oscillates a little with long steps.
    """
    swing = 0.03 if scheme in ("newmark", "alpha 1.0") else 1e-3
    text, lowest = f"name: thrown\n{MESHES[mesh]}{SOFT}", LOWEST[mesh]
    for phase in (0.0, 0.4):
        held, result = played(thrown(text, SCHEMES[scheme], young, step, phase, lowest=lowest), 40)
        assert max(held) < 1.0 + swing
        assert result.velocities[:, 2].max() > 0.0


@pytest.mark.parametrize("scheme", SCHEMES)
def test_what_lies_on_a_floor_lies_still(scheme: str) -> None:
    """A cube comes to rest on a floor: velocity and acceleration vanish, and the floor carries its weight."""
    damping = {"mass": 400.0, "viscosity": 200.0}
    keys = {
        "materials.soft.young": 1e5,
        "dynamics": {**SCHEMES[scheme], "step": 0.004, "damping": damping},
        "loads": {"weight": {"gravity": [0, 0, -9.81]}},
        "obstacles": {"floor": {"plane": [0, 0, 1], "at": [0, 0, LOWEST["cube"]], "fixed": True}},
    }
    simulation = Simulation(scene_of(f"name: laid\n{MESHES['cube']}{SOFT}", overrides=keys))
    result = advance(simulation, count=400)
    weight = float(simulation.stepper.mass.sum()) * 9.81
    assert np.abs(result.velocities).max() < 1e-5
    assert np.abs(simulation.stepper.accelerations(simulation.state)).max() < 0.01
    assert result.reactions["floor"][2] == pytest.approx(weight, rel=2e-3)
    assert result.contacts["floor"].forces[:, 2].sum() == pytest.approx(weight, rel=2e-3)
