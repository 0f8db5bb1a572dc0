# SPDX-License-Identifier: Apache-2.0
"""Self-contact: the search for the nearest face of the body's surface, and the contact law."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gdfe_ros import Command, Pose, Simulation
from gdfe_ros.solver.contact.self_contact.closest import Nearest
from gdfe_ros.solver.contact.self_contact.own_contact import OwnContact
from gdfe_ros.solver.contact.self_contact.own_pairs import OwnPairs
from test.solver.contact.stacks import stack


def the_contact(simulation: Simulation) -> OwnContact:
    """Return the self-contact term."""
    return simulation.stepper.actuation.contacts[-1]


def faced(pairs: OwnPairs, x: np.ndarray, last: np.ndarray, reach: float) -> Nearest:
    """Return the nearest face within a distance [m] that each vertex can touch at positions (n, 3) [m]."""
    found = pairs.look(x, last, reach, np.full(pairs.count, -1))
    return Nearest(*(values[: len(pairs.surface.vertices)] for values in found))


def test_a_vertex_leaves_a_face_over_its_edge_by_and_by() -> None:
    """Beyond an edge, the fraction of the normal force that a face carries falls with distance, to zero at the rim."""
    simulation = stack(2, 2)
    pairs, rest = the_contact(simulation).pairs, simulation.mesh.vertices
    surface = pairs.surface
    corner = np.flatnonzero((surface.vertices >= 27) & (rest[surface.vertices] == rest[27]).all(axis=1))
    shares = []
    for beside in (0.0, 0.5, 0.99, 1.01):
        x = rest.copy()
        x[27:, 0] -= beside * surface.rim
        x[27:, 2] -= 3e-4
        found = faced(pairs, x, rest, 0.02)
        shares.append(float(found.support[corner[0]]))
    assert shares == pytest.approx([1.0, 0.75, 1.0 - 0.99**2, 0.0], abs=1e-9)


def test_rims_that_meet_press_across_and_not_along_their_ends() -> None:
    """Vertices at the rim of a tilted cube, hardly inside of the end face of another cube, touch that cube's top."""
    simulation = stack(2, 2)
    pairs, rest = the_contact(simulation).pairs, simulation.mesh.vertices
    surface = pairs.surface
    high, rim = np.arange(len(rest)) >= 27, rest[27:].min(axis=0)
    tilt = Rotation.from_euler("y", -0.3).as_matrix()
    x = np.where(high[:, None], (rest - rim) @ tilt.T + rim + [1e-7, 0.0, -3e-4], rest)
    found = faced(pairs, x, rest, 0.002)
    corners = np.isin(surface.vertices, np.flatnonzero(high & (rest[:, 0] == rim[0]) & (rest[:, 2] == rim[2])))
    assert found.gap[corners] == pytest.approx(-1e-4)
    np.testing.assert_allclose(found.normal[corners], np.broadcast_to([0.0, 0.0, 1.0], (3, 3)), atol=1e-12)


@pytest.mark.parametrize("friction", [0.0, 0.05, 5.0])
def test_forces_do_the_work_of_gaps_and_slips_and_sum_to_nothing(
    friction: float, virtual_work: Callable[..., np.ndarray]
) -> None:
    """The forces do the work of gaps and slips, sticking or slipping, and sum to zero to rounding."""
    simulation = stack(3, 2, friction=friction)
    simulation.step(Command(handles={"high": Pose((0.0, 0.0, -0.003))}))
    simulation.step(Command(handles={"high": Pose((0.001, 0.0, -0.003))}))
    term, x = the_contact(simulation), simulation.state.positions
    x = x + np.random.default_rng(4).normal(scale=3e-5, size=x.shape)
    forces = virtual_work(term, x, np.random.default_rng(5).normal(size=(4, *x.shape)))
    np.testing.assert_allclose(forces.sum(axis=0), 0.0, atol=1e-13 * np.abs(forces).sum())
    assert np.abs(forces).max() > 0.1
