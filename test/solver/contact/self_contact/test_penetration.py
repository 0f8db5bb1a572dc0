# SPDX-License-Identifier: Apache-2.0
"""Vertices that lie inside another part of the mesh at the end of a step: their depths and the messages."""

from __future__ import annotations

import numpy as np
import pytest

from gdfe_ros import Command, Pose, Simulation, load_scene
from gdfe_ros.solver.contact.self_contact.own_contact import DEEPEST, OwnContact
from test.solver.contact.stacks import stack
from test.written import advance, scene_of

BLOCKS = """
meshes:
  low: {bar: {size: [0.05, 0.05, 0.05], cells: [2, 2, 2]}}
  high: {bar: {size: [0.05, 0.05, 0.05], cells: [1, 1, 1]}, at: [0, 0, 0.051]}
materials: {soft: {law: neo_hookean, young: 2.0e5, poisson: 0.4, density: 1000}}
handles: {low: {where: {mesh: low, face: z-}, fixed: true}, high: {where: {mesh: high, face: z+}}}
self_contact: {}
"""
PLATES = """
meshes:
  low: {bar: {size: [0.02, 0.002, 0.02], cells: [8, 1, 8]}}
  high: {bar: {size: [0.02, 0.002, 0.02], cells: [8, 1, 8]}, at: [0, 0, 0.0205]}
materials: {soft: {law: neo_hookean, young: 1.0e5, poisson: 0.45, density: 1000}}
handles: {low: {where: {mesh: low, face: z-}, fixed: true}, high: {where: {mesh: high, face: z+}}}
self_contact: {}
"""


def the_contact(simulation: Simulation) -> OwnContact:
    """Return the self-contact term."""
    return simulation.stepper.actuation.contacts[-1]


def deepest(simulation: Simulation) -> float:
    """Return the largest depth of a vertex inside another part, divided by the body's size."""
    term = the_contact(simulation)
    inside = term.penetration
    return float(inside.depths(simulation.state.positions, 0.0)[0].max()) / simulation.mesh.size


def turned(points: np.ndarray) -> np.ndarray:
    """Return points (n, 3) [m] rotated about all axes and shifted."""
    axes = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0]
    return points @ axes.T + np.array([0.3, -2.0, 1.0])


@pytest.mark.parametrize(("low", "high"), [(1, 2), (2, 2), (3, 4)])
@pytest.mark.parametrize("depth", [1e-6, 0.004, 0.02])
def test_depths_are_those_of_cubes_in_each_other(low: int, high: int, depth: float) -> None:
    """All vertices of two overlapping cubes have the exact depth in the other cube, at any depth and in any pose."""
    simulation = stack(low, high)
    term, x = the_contact(simulation), simulation.mesh.vertices.copy()
    vertices, above = term.surface.vertices, x[:, 2] > 0.0
    x[above] += [0.004, 0.003, -depth - 2e-4]
    inside = term.penetration
    found, cells = inside.depths(turned(x), 0.0)
    for side in (above, ~above):
        corner = x[~side].min(axis=0)
        true = np.minimum(x - corner, corner + 0.05 - x).min(axis=1)[vertices]
        chosen = side[vertices]
        np.testing.assert_allclose(found[chosen], np.maximum(0.0, true)[chosen], atol=1e-12)
    assert ((cells >= 0) == (found > 0.0)).all()
    assert found.max() == pytest.approx(depth)
    assert (inside.depths(turned(x), 1.01 * depth)[0] == 0.0).all()


@pytest.mark.parametrize("name", ["tendon_finger", "soft_pinch", "pneunet"])
def test_nothing_is_inside_at_rest(name: str) -> None:
    """No vertex of an undeformed shipped scene is inside other cells, and positions that are NaN have no depth."""
    simulation = Simulation(load_scene(name, overrides={"self_contact": {}}))
    assert deepest(simulation) == 0.0
    assert simulation.state.summary.converged, simulation.state.summary.message
    term = the_contact(simulation)
    lost = np.full_like(simulation.state.positions, np.nan)
    assert not term.penetration.depths(lost, 0.0)[0].any()


@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_a_coarse_block_does_not_end_inside_of_another(friction: float) -> None:
    """Blocks moved by more than a cell per step do not end inside each other, and return to their undeformed shape.

    Earlier they ended a sixth of their size inside each other and were reported as converged. A step that stops before
    its target says so.
    """
    simulation = Simulation(scene_of(BLOCKS, overrides={"self_contact": {"friction": friction}}))
    random = np.random.default_rng(0)
    for _ in range(6):
        way = tuple(random.uniform([-0.02, -0.02, -0.07], [0.02, 0.02, -0.03]))
        result = simulation.step(Command(handles={"high": Pose(way, tuple(random.uniform(-0.3, 0.3, 3)))}))
        assert np.isfinite(result.positions).all()
        assert result.converged or result.message
        assert deepest(simulation) < (DEEPEST if result.converged else 10.0 * DEEPEST)
        assert result.min_det > 0.0
    for _ in range(3):
        result = advance(simulation, Command(handles={"high": Pose()}))
    assert np.abs(result.positions - simulation.mesh.vertices).max() < 1e-3 * simulation.mesh.size


def test_a_step_that_ends_inside_says_who_where_and_how_deep() -> None:
    """Where blocks would penetrate each other, the message names both, the depth, the position and a remedy."""
    far = {"meshes.low.at": [50, 0, 0], "meshes.high.at": [50, 0, 0.051], "solver.max_iterations": 2000}
    simulation = Simulation(scene_of(BLOCKS, overrides=far))
    result = simulation.step(Command(handles={"high": Pose((0.006, 0.0, -0.06))}))
    assert not result.converged
    assert "m inside of mesh" in result.message
    assert "deepest at [50" in result.message or "deepest at [49.9" in result.message
    assert "remedy" in result.message
    assert deepest(simulation) < 10.0 * DEEPEST


def test_what_is_put_inside_comes_out_or_says_so_again() -> None:
    """From vertices placed inside another mesh, a step converges with them outside, or reports that they are inside."""
    simulation = Simulation(scene_of(BLOCKS, overrides={"handles.high": {"where": {"mesh": "high", "face": "x+"}}}))
    x = simulation.mesh.vertices.copy()
    x[x[:, 2] > 0.0255, 2] -= 0.008
    x[the_contact(simulation)._body.handles[1].vertices, 2] += 0.008
    simulation.set_positions(x)
    assert deepest(simulation) > 0.03
    for _ in range(4):
        result = simulation.step()
        assert (deepest(simulation) < DEEPEST) if result.converged else ("inside of mesh" in result.message)
    assert result.converged


@pytest.mark.parametrize("friction", [0.3, 1.0, 5.0, 10.0])
def test_a_step_with_friction_stays_when_it_is_asked_again(friction: float) -> None:
    """Repeating the command of a converged step with slip moves no vertex by more than three tolerances.

    Earlier it was 126 tolerances.
    """
    overrides = {
        "self_contact": {"friction": friction},
        "solver": {"skip": []},
        "meshes.low.bar.cells": [5, 4, 4],
        "meshes.high": {"bar": {"size": [0.04] * 3, "cells": [3, 3, 2]}, "at": [0.002, 0.001, 0.0455]},
    }
    simulation = Simulation(scene_of(BLOCKS, overrides=overrides))
    slipped, tolerance = 0, 1e-4 * simulation.mesh.size
    for way in ((0.002, 0.001, -0.002), (-0.003, 0.003, -0.003), (0.004, -0.002, -0.002)):
        for turn in ((0.0, 0.05, 0.0), (0.08, -0.05, 0.05)):
            command = Command(handles={"high": Pose(way, turn)})
            result = advance(simulation, command)
            slipped += int(result.contacts["(self)"].slips.sum())
            again = simulation.step(command)
            assert np.abs(again.positions - result.positions).max() < 3.0 * tolerance
    assert slipped > 0


@pytest.mark.parametrize("overlap", [0.001, 0.0015, 0.0025])
def test_plates_of_one_cell_that_overlap_in_their_plane_are_told(overlap: float) -> None:
    """Where all vertices lie on the other plate's surface, the middles of faces tell that the plates overlap."""
    simulation = Simulation(scene_of(PLATES))
    x = simulation.mesh.vertices.copy()
    x[simulation.mesh.parts["high"].first_vertex :, 2] -= 0.0005 + overlap
    depth, text = the_contact(simulation).penetration.tell(turned(x), 1e-6)
    assert depth == pytest.approx(0.001)
    assert "mesh 'low' lies 0.001 m inside of mesh 'high'" in text or "mesh 'high' lies 0.001 m" in text
