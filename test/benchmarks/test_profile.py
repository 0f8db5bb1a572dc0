# SPDX-License-Identifier: Apache-2.0
"""The profile of a step: phases add up, and operations are counted."""

from __future__ import annotations

import pytest

from benchmarks.profile.operations import LAWS, Counted, counts
from benchmarks.profile.phases import ARCS, EVALUATIONS, REST, ROTATIONS, SOLVES, TANGENTS, Phases
from gdfe_ros.scene import load_scene
from gdfe_ros.simulation import Simulation
from gdfe_ros.solver.minimise import minimiser


@pytest.mark.parametrize(("scene", "steps"), [("bend5", 5), ("tendon_finger", 3)])
def test_phases_add_up(scene: str, steps: int) -> None:
    """The calls of each phase fit the scene, no time is negative, and the profiled functions are restored."""
    plain = minimiser.descend, minimiser.advance
    simulation = Simulation(load_scene(scene))
    phases = Phases.played(simulation, steps)
    assert (minimiser.descend, minimiser.advance) == plain
    assert phases.calls[REST] == steps
    assert phases.calls[EVALUATIONS] > steps
    assert phases.calls[SOLVES] > steps
    assert phases.calls[ROTATIONS] > 0
    assert phases.calls[ARCS] > 0
    assert phases.calls[TANGENTS] > 0
    assert min(phases.seconds.values()) >= 0.0


def test_numbers_count_what_is_done_with_them() -> None:
    """The value a x - y / z with counting numbers gives three operations and the right value."""
    a, x, y, z = (Counted(value) for value in (2.0, 3.0, 1.0, 4.0))
    Counted.done = 0
    assert a * x - y / z == 5.75
    assert Counted.done == 3


def test_the_simplest_law_takes_the_fewest_operations() -> None:
    """Of all laws, neo-Hookean needs the fewest operations, and its kernel fewer than a thousand."""
    found = counts()
    assert found.keys() == LAWS.keys()
    assert min(found, key=found.__getitem__) == "neo-Hookean"
    assert 500 < found["neo-Hookean"] < 1000
