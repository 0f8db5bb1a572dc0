# SPDX-License-Identifier: Apache-2.0
"""Folded elements: the least determinant is at a corner, and no folded state is taken for an equilibrium."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest

from gdfe_ros import Simulation
from gdfe_ros.results.step_result import StepResult
from test.written import scene_of

FOLDED = r"fold|inside out"
REMEDY = r"reset|rest|smaller|slower|set_positions|finer"
HOLLOW = "cut: [{box: {x: [0.01, 0.09], y: [-0.006, 0.006], z: [-0.006, 0.006]}}]"
MESHES = {
    "hollow": f"cells: [10, 5, 5], {HOLLOW}",
    "thin": f"cells: [20, 4, 4], {HOLLOW}",
    "solid": "cells: [12, 3, 3]",
}
TEXT = """\
mesh: {{bar: {{size: [0.1, 0.02, 0.02], {mesh}}}}}
materials: {{rubber: {{law: {law}, young: 1.0e6, poisson: 0.45}}}}
handles: {{base: {{where: {{face: x-}}, fixed: true}}}}
actuators: {{pull: {{cable: {{points: [[0, 0, 0.008], [0.1, 0, 0.008]], command: tension}}}}}}
"""
PULLS = [("hollow", 8.0), ("hollow", 20.0), ("thin", 8.0), ("thin", 20.0), ("solid", 20.0), ("solid", 50.0)]
LINEAR = [("hollow", 8.0), ("solid", 20.0)]


def folding(mesh: str, law: str = "neo_hookean") -> Simulation:
    """Return a bar whose elements fold when the cable along its upper edge is pulled."""
    return Simulation(scene_of(TEXT.format(mesh=MESHES[mesh], law=law)))


@pytest.fixture(scope="module")
def pulled(lab: Any) -> Callable[..., tuple[Simulation, list[StepResult]]]:
    """Give a function that pulls a bar once and releases it in three steps; all tests use its results."""

    @cache
    def pull(mesh: str, tension: float, law: str) -> tuple[Simulation, list[StepResult]]:
        simulation = folding(mesh, law)
        return simulation, [lab.go(simulation, pull=value) for value in (tension, 0.0, 0.0, 0.0)]

    return pull


@pytest.mark.parametrize(
    ("mesh", "tension", "law"), [*((*pull, "neo_hookean") for pull in PULLS), *((*pull, "linear") for pull in LINEAR)]
)
def test_no_fold_is_an_equilibrium(lab: Any, pulled: Callable, mesh: str, tension: float, law: str) -> None:
    """A step that ends with a folded corner is not converged and says so."""
    simulation, results = pulled(mesh, tension, law)
    for result in results:
        if lab.least_corner(simulation.mesh, result.positions) <= 0.0:
            assert not result.converged
            assert re.search(FOLDED, result.message)


@pytest.mark.parametrize(("mesh", "tension"), PULLS)
def test_the_least_determinant_is_that_of_a_corner(lab: Any, pulled: Callable, mesh: str, tension: float) -> None:
    """A step's least determinant is the least one of the trilinear map at the corners."""
    simulation, results = pulled(mesh, tension, "neo_hookean")
    for result in results:
        expected = lab.least_corner(simulation.mesh, result.positions)
        assert result.min_det == pytest.approx(expected, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize(("mesh", "tension"), PULLS)
def test_a_folded_body_unfolds_or_says_what_to_do(lab: Any, pulled: Callable, mesh: str, tension: float) -> None:
    """After the cable's release the bar is undeformed, or not converged with a message that names fold and remedy."""
    simulation, (*_, result) = pulled(mesh, tension, "neo_hookean")
    if result.converged:
        assert lab.distance(result.positions, simulation.mesh.vertices, simulation.mesh) < 0.01
    else:
        assert re.search(FOLDED, result.message)
        assert re.search(REMEDY, result.message)
    simulation.reset()
    assert lab.go(simulation, pull=0.1).converged


def test_a_vertex_pushed_through_its_cell_is_seen_and_comes_back(lab: Any) -> None:
    """One folded corner is found by the least determinant, and from there the undeformed shape is reached."""
    simulation = folding("solid")
    positions = simulation.mesh.vertices.copy()
    tip = int(np.argmax(positions @ [1.0, 1.0, 1.0]))
    positions[tip] -= 0.01
    assert lab.least_corner(simulation.mesh, positions) < 0.0
    simulation.set_positions(positions)
    result = simulation.step(cut_after=0)
    assert result.min_det == pytest.approx(lab.least_corner(simulation.mesh, result.positions), rel=1e-6, abs=1e-9)
    while not result.converged:
        result = simulation.step()
    assert lab.distance(result.positions, simulation.mesh.vertices, simulation.mesh) < 1e-3
