# SPDX-License-Identifier: Apache-2.0
"""Settling of the contact multipliers: the estimate of the distance that remains."""

from __future__ import annotations

import numpy as np
import pytest

from gdfe_ros import Command, Pose, Simulation
from gdfe_ros.scene import scene_from_text
from gdfe_ros.solver.contact.settling import PLAIN, Settling

TUBE = """
name: tube
mesh: {tube: {inner: 0.006, outer: 0.01, length: 0.02, cells: [2, 32, 8]}}
materials: {rubber: {law: neo_hookean, young: 1.0e5, poisson: 0.4, density: 1100}}
regions: [{material: rubber}]
handles:
  low: {where: {box: {y: [-1, -0.0085]}}, fixed: true}
  top: {where: {box: {y: [0.0085, 1]}}}
self_contact: {friction: 0.3}
"""


def ways(places: list[float]) -> list[float]:
    """Return the estimates after plain updates that take one vertex to each of some places [m]."""
    settling, found = Settling(np.zeros((1, 3)), held=True), []
    for place in places:
        found.append(settling.way(np.array([[place, 0.0, 0.0]]), 0.0))
    return found


@pytest.mark.parametrize("rate", [0.3, 0.6, 0.9])
def test_the_rest_of_a_geometric_sequence_is_known(rate: float) -> None:
    """Displacements that shrink by one factor leave the sum of all that follow, or at least the last one."""
    places = [1.0 - rate**k for k in range(1, PLAIN + 4)]
    last, rest = rate ** len(places) * (1.0 / rate - 1.0), rate ** len(places)
    assert ways(places)[-1] == pytest.approx(max(rest, last))


@pytest.mark.parametrize("rate", [0.6, 0.9, 1.0])
def test_a_swing_leaves_no_more_than_itself(rate: float) -> None:
    """Displacements that reverse each other swing about the equilibrium, however slowly they shrink."""
    places = [(-rate) ** k for k in range(PLAIN + 6)]
    last = abs(places[-1] - places[-2])
    assert abs(places[-1]) <= ways(places)[-1] <= 1.001 * last


def test_a_tube_is_pressed_flat_node_on_node() -> None:
    """A vertex that lands on a vertex changes between the faces around it in each update, and the step converges."""
    simulation = Simulation(scene_from_text(TUBE))
    for k in range(1, 29):
        result = simulation.step(Command(handles={"top": Pose((0.0, -5e-4 * k, 0.0))}))
        assert result.converged, result.message
    assert result.contacts["(self)"].presses.sum() > 10.0
