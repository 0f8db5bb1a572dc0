# SPDX-License-Identifier: Apache-2.0
"""Commands and times of a wrong type are refused by name, and nothing changes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from gdfe_ros import Command, Pose, Simulation
from gdfe_ros.actuators import Gravity
from gdfe_ros.errors import CommandError
from gdfe_ros.solver.settings import Damping, Dynamics, SolverSettings
from test.written import scene_of

SCENE = """\
mesh: {bar: {size: [0.1, 0.02, 0.02], cells: [3, 1, 1]}}
materials: {m: {law: linear, young: 1.0e5, poisson: 0.3, density: 1000}}
handles: {base: {where: {face: x-}, fixed: true}, tip: {where: {face: x+}}}
actuators: {pull: {cable: {points: [[0, 0, 0.008], [0.1, 0, 0.008]], command: tension}}}
loads: {weight: {gravity: [0, 0, -9.81]}}
"""
LIFT = Command(handles={"tip": Pose((0.0, 0.0, 0.01))})


@pytest.mark.parametrize(
    "times",
    [
        {"dt": True},
        {"dt": -1.0},
        {"dt": -1e-9},
        {"dt": np.nan},
        {"dt": np.inf},
        {"dt": 1e300},
        {"dt": 10**400},
        {"deadline": np.inf},
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
    """An invalid time is refused by name, and neither time nor targets, commands and readings change."""
    simulation = Simulation(scene_of(SCENE, overrides={"actuators.pull.cable.rate": 1.0}))
    simulation.step(Command(actuators={"pull": 0.1}), dt=0.1)
    before = simulation.time, simulation.targets, simulation.commands, simulation.actuator_states()
    with pytest.raises(CommandError, match=next(iter(times))):
        simulation.step(Command(LIFT.handles, {"pull": 0.5}), **{"dt": 1.0, **times})
    assert (simulation.time, simulation.targets, simulation.commands, simulation.actuator_states()) == before


@pytest.mark.parametrize(
    "command",
    [
        Command(actuators={"pull": None}),
        Command(actuators={"pull": np.ones(2)}),
        Command(actuators={"pull": True}),
        Command(actuators={"pull": np.nan}),
        Command(actuators={"pull": np.inf}),
        Command(actuators={"pull": -np.inf}),
        Command(actuators={"pull": 10**400}),
        Command(loads={"weight": np.inf}),
        Command(loads={"weight": 10**400}),
        Command(loads={"weight": "2"}),
        Command(handles={"tip": (0.0, 0.0, 0.01)}),
    ],
    ids=["none", "array", "flag", "nan", "inf", "minus_inf", "huge", "load_inf", "load_huge", "text", "tuple"],
)
@pytest.mark.parametrize("motion", ["", "dynamics: {}"], ids=["statics", "motion"])
def test_values_of_the_wrong_kind_are_named(command: Command, motion: str) -> None:
    """A command that is no finite number or no pose is refused with what is allowed, with and without dynamics."""
    simulation = Simulation(scene_of(SCENE + motion))
    with pytest.raises(CommandError, match=r"(pull|weight|tip)'.*allowed"):
        simulation.step(command)
    assert simulation.commands == {"pull": 0.0, "weight": 1.0}


@pytest.mark.parametrize("part", ["handles", "actuators", "loads", "bodies"])
@pytest.mark.parametrize("given", [None, [], "tip"], ids=str)
def test_parts_of_a_command_are_mappings(part: str, given: Any) -> None:
    """A list, a word or None in place of a mapping is refused by name, and nothing changes."""
    simulation = Simulation(scene_of(SCENE))
    with pytest.raises(CommandError, match=f"{part} of a Command are a mapping by name"):
        simulation.step(Command(**{part: given}))
    assert simulation.time == 0.0


def test_positions_that_are_no_numbers_are_named() -> None:
    """A word in place of positions is refused."""
    with pytest.raises(CommandError, match="no array of numbers"):
        Simulation(scene_of(SCENE)).set_positions("abc")


@pytest.mark.parametrize("given", [5, "tip", {"tip": Pose()}], ids=str)
def test_what_is_no_command_and_no_snapshot_is_named(given: Any) -> None:
    """A wrong object in place of a command or snapshot is refused with what is allowed, and nothing changes."""
    simulation = Simulation(scene_of(SCENE))
    with pytest.raises(CommandError, match="a step follows a Command, or None; got"):
        simulation.step(given)
    with pytest.raises(CommandError, match=r"a snapshot is what Simulation.snapshot returned; got"):
        simulation.restore(given)
    assert simulation.time == 0.0
    assert simulation.step(LIFT).converged


def test_a_time_of_too_many_internal_steps_is_refused() -> None:
    """A year in one step is refused with the allowed range for a body with mass, and accepted once it is settled."""
    simulation = Simulation(scene_of(SCENE.partition("loads")[0] + "dynamics: {step: 1.0e-3}"))
    with pytest.raises(CommandError, match=r"3.15e\+10 internal steps of 0.001 s.*allowed: 0 to 100 s"):
        simulation.step(Command(actuators={"pull": 0.1}), dt=3.15e7)
    assert simulation.time == 0.0
    assert simulation.commands == {"pull": 0.0}
    simulation.step(dt=1e-3)
    simulation.step(dt=3.15e7)
    assert simulation.time == pytest.approx(3.15e7)


@pytest.mark.parametrize("value", [1e20, 1e150, 1e300])
def test_a_command_out_of_all_proportion_ends(value: float) -> None:
    """A pull far beyond the body's strength ends unconverged with a reason, with and without dynamics."""
    for motion in ("", "dynamics: {}"):
        simulation = Simulation(scene_of(SCENE + motion))
        result = simulation.step(Command(actuators={"pull": value}), dt=0.01)
        assert not result.converged
        assert result.message
        assert np.isfinite(result.positions).all()


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_numbers_of_a_scene_made_in_python_are_finite(value: float) -> None:
    """Dynamics, gravity and settings made in Python refuse a number that is not finite, by name."""
    numbers = (
        (Dynamics, "velocity", (0.0, value, 0.0)),
        (Dynamics, "spin", (value, 0.0, 0.0)),
        (Damping, "viscosity", value),
    )
    for kind, name, given in numbers:
        with pytest.raises(ValueError, match=f"{name} = .*{value}.*: allowed is"):
            kind(**{name: given})
    with pytest.raises(ValueError, match="'weight': acceleration must be three finite numbers"):
        Gravity(name="weight", acceleration=np.array([0.0, 0.0, value]), density=np.ones(1))
    with pytest.raises(ValueError, match=f"tolerance = {value}: allowed is"):
        SolverSettings(tolerance=value)
