# SPDX-License-Identifier: Apache-2.0
"""A box that is held between two soft pads."""

from __future__ import annotations

import re

import pytest

from benchmarks.contact import GRIP, grip
from benchmarks.peers.grip_case import SQUEEZE, WEIGHT
from gdfe_ros import Command, Pose, Simulation
from gdfe_ros.scene.loader import scene_from_text
from test.written import advance


def test_a_grip_holds_what_friction_can_hold() -> None:
    """A gripped box stays without creep at 1.02 times the least friction coefficient, and falls at 0.98 times it."""
    least = WEIGHT / (2.0 * grip(0.02, seconds=0.0)["press"])
    held, lost = (grip(demand * least, seconds=0.5) for demand in (1.02, 0.98))
    assert abs(held["drift"]) < 1e-7
    assert lost["sunk"] + lost["drift"] > 0.01


def test_a_grip_that_cannot_hold_says_where_and_which_friction_would_hold() -> None:
    """A box that slips out of its grip is told with its vertices, its friction, and the least one that holds it."""
    simulation = Simulation(scene_from_text(GRIP, overrides={"bodies.part.friction": 0.01}))
    simulation.step(Command(loads={"weight": 0.0}))
    for share in range(1, 21):
        way = SQUEEZE * share / 20
        moves = {"left": Pose((way, 0.0, 0.0)), "right": Pose((-way, 0.0, 0.0))}
        result = simulation.step(Command(handles=moves))
    assert not result.message
    for _ in range(10):
        result = advance(simulation, Command(loads={"weight": 1.0}))
    told = re.search(r"slips .* at vertices .*: its friction is 0.01, and about (\S+) would hold it", result.message)
    assert told is not None, result.message
    assert float(told[1]) == pytest.approx(WEIGHT / result.contacts["part"].presses.sum(), rel=0.05)
