# SPDX-License-Identifier: Apache-2.0
"""Edges of soft bodies that cross: two bars, each with an edge towards the other, and no vertex where they meet."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from gdfe_ros import Command, Pose, Simulation
from gdfe_ros.mesh import bar
from gdfe_ros.mesh.files.stored_mesh import pack_mesh
from gdfe_ros.mesh.tetmesh import divide
from gdfe_ros.scene import scene_from_text
from gdfe_ros.scene.document import write_document
from gdfe_ros.solver.contact.self_contact.own_pairs import NONE, OwnPairs
from test.written import advance

HALF = math.sqrt(0.5) * 0.01
"""Half of the diagonal of the bars' cross-section [m]."""
GAP = 1e-3
GRID = bar([0.1, 0.01, 0.01], [10, 1, 1])
RISEN = [45, 0, 0]


def crossing(
    mesh: Any = GRID, *, turn: list[int] = RISEN, height: float = 2 * HALF + GAP, **entries: Any
) -> Simulation:
    """Return two bars that cross in the middle of cells, turned about their axes, the upper one at a height [m]."""
    packed = {"embedded": pack_mesh(mesh)}
    text = {
        "name": "crossing",
        "meshes": {
            "low": {**packed, "rotation_deg": turn},
            "high": {**packed, "at": [0.045, -0.055, height], "rotation_deg": [turn, [0, 0, 90]]},
        },
        "materials": {"rubber": {"law": "neo_hookean", "young": 1e5, "poisson": 0.4, "density": 1000}},
        "regions": [{"material": "rubber"}],
        "handles": {
            "base": {"where": {"any": [{"mesh": "low", "face": face} for face in ("x-", "x+")]}, "fixed": True},
            "ends": {"where": {"any": [{"mesh": "high", "face": face} for face in ("x-", "x+")]}},
        },
        "self_contact": {},
        "solver": {"tolerance": 1e-5},
        **entries,
    }
    return Simulation(scene_from_text(write_document(text)))


def down(z: float, x: float = 0.0) -> Command:
    """Return the command that moves the ends of the upper bar down and along the lower bar [m]."""
    return Command(handles={"ends": Pose((x, 0.0, -z))})


def upper(simulation: Simulation) -> np.ndarray:
    """Return which vertices (n,) belong to the upper bar."""
    first = simulation.mesh.parts["high"].first_vertex
    place = np.arange(len(simulation.mesh.vertices))
    return (place >= first) & (place < first + len(GRID.vertices))


def clearance(simulation: Simulation) -> float:
    """Return the height [m] of the upper bar's lowest edge above the lower bar's highest edge, where they cross."""
    x, rest, high = simulation.state.positions, simulation.mesh.vertices, upper(simulation)
    top, bottom = ~high & (rest[:, 2] > HALF - 1e-9), high & (rest[:, 2] < rest[high, 2].min() + 1e-9)
    low, above = x[top][np.argsort(x[top, 0])], x[bottom][np.argsort(x[bottom, 1])]
    place = np.array([0.045, 0.0])
    for _ in range(20):  # the edges are nearly straight in the plane
        place[1] = np.interp(place[0], low[:, 0], low[:, 1])
        place[0] = np.interp(place[1], above[:, 1], above[:, 0])
    return float(np.interp(place[1], above[:, 1], above[:, 2]) - np.interp(place[0], low[:, 0], low[:, 2]))


def crossed(pairs: OwnPairs, x: np.ndarray, last: np.ndarray, reach: float) -> np.ndarray:
    """Return the gaps [m] of edges within a distance [m] that cross at positions (n, 3) [m]."""
    edges = NONE, pairs.kept.within(x, reach)[1]
    return pairs.look(x, last, reach, np.full(pairs.count, -1), candidates=edges).gap


def press(simulation: Simulation, *depths: float) -> float:
    """Move the upper bar down to each depth [m]; return the last force on the lower bar [N]."""
    for depth in depths:
        result = advance(simulation, down(depth))
    return float(-result.reactions["ends"][2])


@pytest.mark.parametrize("mesh", [GRID, divide(bar([0.1, 0.01, 0.01], [5, 1, 1]))], ids=["hexahedra", "tetrahedra"])
def test_they_touch_when_their_edges_meet(mesh: Any) -> None:
    """There is no force up to the gap; beyond it, the force rises with the depth, and the bars' reactions cancel."""
    simulation = crossing(mesh)
    assert press(simulation, 0.9 * GAP) == pytest.approx(0.0, abs=1e-8)
    first, second = press(simulation, 2.0 * GAP), press(simulation, 3.0 * GAP)
    assert 0.008 < first < 0.011
    assert second == pytest.approx(2.0 * first, rel=0.03)
    reactions = simulation.state.summary.reactions
    assert reactions["base"][:3] == pytest.approx(-reactions["ends"][:3], abs=1e-3 * second)


def test_neither_enters_the_other() -> None:
    """Where the edges cross, the upper one stays above the lower one, within the tolerance."""
    simulation = crossing()
    press(simulation, *(0.001 * k for k in range(1, 9)))
    assert clearance(simulation) > -1e-4 * simulation.mesh.size


@pytest.mark.parametrize("friction", [0.1, 0.3])
def test_friction_drags_along_the_edge(friction: float) -> None:
    """An edge that slides over the nodes of another one drags it by at most the friction, and each step converges."""
    simulation = crossing(self_contact={"friction": friction})
    press(simulation, 0.001, 0.002, 0.003, 0.004)
    for k in range(1, 13):
        result = advance(simulation, down(0.004, 0.001 * k))
        touch = result.contacts["(self)"]
        assert touch.slips.all()
        assert np.linalg.norm(touch.shears, axis=1) == pytest.approx(friction * touch.presses, rel=1e-3)
    assert result.reactions["ends"][0] > 0.9 * friction * -result.reactions["ends"][2]


def test_rims_of_flat_bars_that_cross_touch() -> None:
    """Two flat bars of one cell across cross without a vertex between them: the rims of their faces touch."""
    simulation = crossing(bar([0.1, 0.01, 0.01], [5, 1, 1]), turn=[0, 0, 0], height=0.01 + GAP)
    assert press(simulation, 0.9 * GAP) == pytest.approx(0.0, abs=1e-8)
    assert press(simulation, 2.0 * GAP) > 0.01


def test_forces_do_the_work_of_gaps_and_slips_and_sum_to_nothing(virtual_work: Callable[..., np.ndarray]) -> None:
    """Forces of crossing edges do the work of gaps and slips, and sum to zero to rounding."""
    simulation = crossing(self_contact={"friction": 0.3})
    press(simulation, 0.002, 0.004)
    simulation.step(down(0.004, 0.001))
    term, x = simulation.stepper.actuation.contacts[-1], simulation.state.positions
    forces = virtual_work(term, x, np.random.default_rng(5).normal(size=(4, *x.shape)))
    np.testing.assert_allclose(forces.sum(axis=0), 0.0, atol=1e-13 * np.abs(forces).sum())
    assert len(np.unique(np.argwhere(forces != 0.0)[:, 0])) == 4


def test_a_bar_falls_on_another_one() -> None:
    """A bar that falls on the middle of a clamped one bends it and stays above it; every step converges."""
    handles = {"base": {"where": {"any": [{"mesh": "low", "face": face} for face in ("x-", "x+")]}, "fixed": True}}
    dynamics = {"scheme": "bdf2", "step": 0.002, "damping": {"viscosity": 5.0}}
    loads = {"weight": {"gravity": [0, 0, -9.81]}}
    simulation = crossing(handles=handles, dynamics=dynamics, loads=loads, self_contact={"friction": 0.5})
    for _ in range(60):
        result = advance(simulation, Command(loads={"weight": 1.0}))
        assert clearance(simulation) > -1e-3 * HALF
    assert result.contacts["(self)"].presses.sum() > 0.0


@pytest.mark.parametrize(("angle", "friction"), [(18, 0.0), (28, 0.5)])
def test_bars_pushed_through_each_other_in_a_step_are_told(angle: int, friction: float) -> None:
    """A step of two bar thicknesses at a small angle converges only if the bars do not overlap where they cross."""
    mesh = {"bar": {"size": [0.08, 0.01, 0.01], "cells": [8, 1, 1]}}
    turn = math.radians(angle)
    start = [-0.04 * math.cos(turn), -0.04 * math.sin(turn), 0.0105]
    bars = {"low": {**mesh, "at": [-0.04, 0, 0]}, "high": {**mesh, "at": start, "rotation_deg": [0, 0, angle]}}
    rubber = {"law": "neo_hookean", "young": 3e5, "poisson": 0.45, "density": 1100}
    entries = {"solver": {"tolerance": 1e-4}, "self_contact": {"friction": friction}}
    simulation = crossing(meshes=bars, materials={"rubber": rubber}, **entries)
    result = simulation.step(down(0.0205))
    pairs = simulation.stepper.actuation.contacts[-1].pairs
    gaps = crossed(pairs, result.positions, simulation.mesh.vertices, 0.03)
    assert not result.converged or gaps.min() > -2e-4 * simulation.mesh.size
    assert result.converged or result.message
