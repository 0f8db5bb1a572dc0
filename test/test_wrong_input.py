# SPDX-License-Identifier: Apache-2.0
"""Commands and times of the wrong kind: named, and nothing has changed."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from gdfe_ros import Command, Pose, Simulation
from gdfe_ros.errors import CommandError
from gdfe_ros.scene import scene_from_text

SCENE = """\
name: wrong
mesh: {bar: {size: [0.1, 0.02, 0.02], cells: [3, 1, 1]}}
materials: {m: {law: linear, young: 1.0e5, poisson: 0.3, density: 1000}}
regions: [{material: m}]
handles: {base: {where: {face: x-}, fixed: true}, tip: {where: {face: x+}}}
actuators: {pull: {cable: {points: [[0, 0, 0.008], [0.1, 0, 0.008]], command: tension}}}
loads: {weight: {gravity: [0, 0, -9.81]}}
"""
LIFT = Command(handles={"tip": Pose((0.0, 0.0, 0.01))})


@pytest.mark.parametrize(
    "times",
    [
        {"dt": True},
        {"deadline": "a"},
        {"deadline": -1.0},
        {"deadline": np.nan},
        {"deadline": True},
        {"cut_after": 1.5},
        {"cut_after": -1},
        {"cut_after": True},
    ],
    ids=str,
)
def test_times_are_refused_before_anything_moves(times: dict[str, Any]) -> None:
    """Give a time that is none: named, and neither time nor target has moved."""
    simulation = Simulation(scene_from_text(SCENE))
    with pytest.raises(CommandError, match=next(iter(times))):
        simulation.step(LIFT, **{"dt": 1.0, **times})
    assert simulation.time == 0.0
    assert simulation.targets["tip"] == Pose()


@pytest.mark.parametrize(
    "command",
    [
        Command(actuators={"pull": None}),
        Command(actuators={"pull": np.ones(2)}),
        Command(actuators={"pull": True}),
        Command(loads={"weight": "2"}),
        Command(handles={"tip": (0.0, 0.0, 0.01)}),
    ],
    ids=["none", "array", "flag", "text", "tuple"],
)
def test_values_of_the_wrong_kind_are_named(command: Command) -> None:
    """Command what is no number and no pose: named with what is allowed."""
    simulation = Simulation(scene_from_text(SCENE))
    with pytest.raises(CommandError, match=r"(pull|weight|tip)'.*allowed"):
        simulation.step(command)
    assert simulation.commands == {"pull": 0.0, "weight": 1.0}


@pytest.mark.parametrize("part", ["handles", "actuators", "loads", "bodies"])
@pytest.mark.parametrize("given", [None, [], "tip"], ids=str)
def test_parts_of_a_command_are_mappings(part: str, given: Any) -> None:
    """Give a list, a word or nothing instead: named, nothing has changed."""
    simulation = Simulation(scene_from_text(SCENE))
    with pytest.raises(CommandError, match=f"{part} of a Command are a mapping by name"):
        simulation.step(Command(**{part: given}))
    assert simulation.time == 0.0


def test_positions_that_are_no_numbers_are_named() -> None:
    """Give a word as positions: refused."""
    with pytest.raises(CommandError, match="no array of numbers"):
        Simulation(scene_from_text(SCENE)).set_positions("abc")


@pytest.mark.parametrize("given", [5, "tip", {"tip": Pose()}], ids=str)
def test_what_is_no_command_and_no_snapshot_is_named(given: Any) -> None:
    """Step with, and restore, something else: told what is taken, nothing has changed."""
    simulation = Simulation(scene_from_text(SCENE))
    with pytest.raises(CommandError, match="a step follows a Command, or None; got"):
        simulation.step(given)
    with pytest.raises(CommandError, match=r"a snapshot is what Simulation.snapshot returned; got"):
        simulation.restore(given)
    assert simulation.time == 0.0
    assert simulation.step(LIFT).converged
