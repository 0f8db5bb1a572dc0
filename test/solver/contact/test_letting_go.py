# SPDX-License-Identifier: Apache-2.0
"""Bodies that an obstacle presses so far that they cannot follow it."""

from __future__ import annotations

import pytest

from gdfe_ros import Command, Pose, Simulation
from gdfe_ros.solver.vectors import largest_distance
from test.written import advance, scene_of

POKED = """
mesh: {bar: {size: [0.10, 0.05, 0.05], cells: [8, 4, 4]}}
materials: {soft: {law: neo_hookean, young: 1.0e5, poisson: 0.4}}
handles: {base: {where: {face: x-}, fixed: true}}
obstacles: {thing: {box: {size: [0.04, 0.03, 0.02]}, at: [0.06, 0.0, 0.125], friction: 0.5}}
solver: {tolerance: 1.0e-6, max_iterations: 2000}
"""
INTO = (
    Pose((0.046, 0.023, -0.137), (0.35, -1.01, 1.20)),
    Pose((-0.05, 0.014, -0.163), (-1.01, -0.57, -1.31)),
)
"""Successive poses of the box inside the body: its elements cannot follow them."""
AWAY = Pose((0.0, 0.0, 0.5))


@pytest.fixture
def poked() -> Simulation:
    """Return a body whose last step into the box did not converge: it is between its start and the box's last pose."""
    simulation = Simulation(scene_of(POKED))
    for pose in INTO:
        result = simulation.step(Command(handles={"thing": pose}))
        assert result.min_det > 0.0
    assert not result.converged
    assert result.message
    assert len(result.contacts["thing"].vertices)
    return simulation


def test_a_body_goes_back_to_rest_when_what_is_stuck_in_it_is_taken_away(poked: Simulation) -> None:
    """When the box is taken away, the body returns to its undeformed shape, and a dropped contact is reported.

    Contact is dropped where elements would fold on the load path. Whether they would depends on rounding.
    """
    result = advance(poked, Command(handles={"thing": AWAY}))
    lets_go = "contact with thing was dropped without following the load path, on which " in result.message
    assert lets_go or not result.message
    assert result.restarts == lets_go
    assert largest_distance(result.positions, poked.mesh.vertices) < 1e-5 * poked.mesh.size
    assert not len(result.contacts["thing"].vertices)
    assert not result.reactions["thing"].any()
    assert poked.step(Command(handles={"thing": Pose((0.0, 0.0, 0.6))})).message == ""


def test_nothing_passes_through_a_body_that_cannot_follow(poked: Simulation) -> None:
    """Contact with a box that turns further inside the body is not dropped, because the body would still touch it.

    A solve that was cut may end between two touches, and says that it did not converge.
    """
    for turn in (0.2, 0.4):
        result = poked.step(Command(handles={"thing": Pose((-0.004, 0.014, -0.150), (-1.01, -0.57, -1.31 + turn))}))
        assert "was dropped" not in result.message
        assert result.restarts == 0
        assert result.min_det > 0.0
        assert len(result.contacts["thing"].vertices) or not result.converged


def test_a_box_that_cannot_be_pulled_out_is_given_up_early() -> None:
    """Increments in which the steps of contact shrink no more end soon: none of them uses all of its iterations."""
    box = {"box": {"size": [0.03] * 3}, "at": [0.0, 0.0, 0.2], "friction": 0.5}
    coarse = {"mesh.bar.cells": [4, 2, 2], "obstacles": {"thing": box}}
    simulation = Simulation(scene_of(POKED, overrides=coarse))
    inside = Pose((0.038, 0.032, -0.212), (1.14, 0.03, 1.04))
    results = [simulation.step(Command(handles={"thing": pose})) for pose in (inside, AWAY)]
    assert max(result.iterations for result in results) < simulation.scene.solver.max_iterations
    assert min(result.min_det for result in results) > 0.0
