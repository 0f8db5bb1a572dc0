# SPDX-License-Identifier: Apache-2.0
"""Growth of quadratic tetrahedra: free growth is without stress, and a bilayer bends as theory says."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from gdfe_ros import Command, Simulation
from gdfe_ros.mesh import Mesh, bar
from gdfe_ros.mesh.files.stored_mesh import pack_mesh
from gdfe_ros.mesh.tetmesh import divide
from test.written import simulate

LENGTH, HEIGHT = 0.06, 0.004


def _grown(mesh: Mesh, growth: dict[str, Any], handles: dict[str, Any], poisson: float) -> Simulation:
    text = (
        f"materials: {{rubber: {{law: neo_hookean, young: 1.0e5, poisson: {poisson}}}}}\nsolver: {{tolerance: 1.0e-6}}"
    )
    actuators = {"swell": {"growth": growth}}
    simulation = simulate(text, mesh={"embedded": pack_mesh(mesh)}, handles=handles, actuators=actuators)
    for command in (0.5, 1.0):
        assert simulation.step(Command(actuators={"swell": command})).converged
    return simulation


@pytest.mark.parametrize("poisson", [0.3, 0.499])
def test_free_growth_is_without_stress(poisson: float) -> None:
    """A block that can grow freely has the shape of its growth, and no energy, also with pressures."""
    mesh = divide(bar([0.03, 0.02, 0.01], [2, 1, 1]))
    growth = {"stretch": [1.2, 1.1, 0.9]}
    corners = [np.argmax(mesh.vertices @ way) for way in ([-1, -1, -1], [1, -1, -1], [-1, 1, -1])]
    held = {f"h{i}": {"where": {"vertices": [int(v)]}, "free": ["x", "y"][:i]} for i, v in enumerate(corners)}
    simulation = _grown(mesh, growth, held, poisson)
    extent = np.ptp(simulation.positions, axis=0)
    np.testing.assert_allclose(extent, [0.036, 0.022, 0.009], rtol=1e-4)
    assert simulation.result.energy < 1e-9


def test_a_bilayer_bends_by_timoshenko() -> None:
    """A strip whose upper half shortens by 1 % has the curvature 3/2 of that over its height (Timoshenko 1925)."""
    mesh = divide(bar([LENGTH, 0.004, HEIGHT], [12, 1, 2]))
    growth = {"stretch": [0.99, 1.0, 1.0], "where": {"box": {"z": [-1e-9, 1.0]}}}
    simulation = _grown(mesh, growth, {"base": {"where": {"face": "x-"}, "fixed": True}}, 0.3)
    middle = np.abs(mesh.vertices[:, [1, 2]]).max(axis=1) < 1e-9
    rest, now = mesh.vertices[middle], simulation.positions[middle]
    inside = (rest[:, 0] > 0.2 * LENGTH) & (rest[:, 0] < 0.9 * LENGTH)
    curvature = 2.0 * np.polyfit(rest[inside, 0], now[inside, 2], 2)[0]
    assert curvature == pytest.approx(1.5 * 0.01 / HEIGHT, rel=0.05)
