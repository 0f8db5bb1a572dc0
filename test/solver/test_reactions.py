# SPDX-License-Identifier: Apache-2.0
"""Reactions of handles are sums of corner forces and of their moments."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from gdfe_ros.constraints import Handle
from gdfe_ros.mesh import HexMesh, bar
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.forces.actuation import handle_reactions, vertex_forces

MakeBody = Callable[..., Body]
End = Callable[[HexMesh, str], NDArray[np.int32]]


@pytest.fixture
def body(make_body: MakeBody, end: End) -> Body:
    """Make a bar held at both ends."""
    mesh = bar([0.3, 0.1, 0.1], [3, 2, 2])
    return make_body(mesh, None, [Handle("base", end(mesh, "x-"), fixed=True), Handle("tip", end(mesh, "x+"))])


def test_reaction_sums_the_corners_at_the_handle(body: Body) -> None:
    """A handle's reaction is the sum of the corner forces at its vertices, with moments about its present centre."""
    random = np.random.default_rng(0)
    force, x = random.normal(size=(12, 8, 3)), random.normal(size=body.rest.shape)
    reactions = handle_reactions(body, x, force)
    for handle in body.handles:
        members = np.isin(body.cells, handle.vertices)
        levers = x[body.cells[members]] - x[handle.vertices].mean(axis=0)
        expected = np.concatenate([force[members].sum(axis=0), np.cross(levers, force[members]).sum(axis=0)])
        np.testing.assert_allclose(reactions[handle.name], expected, atol=1e-12)


def test_vertex_forces_of_all_vertices_are_the_assembly(body: Body) -> None:
    """Vertex forces of all vertices equal the assembly by numpy."""
    force = np.random.default_rng(1).normal(size=(12, 8, 3))
    expected = np.zeros_like(body.rest)
    np.add.at(expected, body.cells.ravel(), force.reshape(-1, 3))
    found = vertex_forces(body, np.arange(len(body.rest)), force)
    np.testing.assert_allclose(found, expected, atol=1e-13)
