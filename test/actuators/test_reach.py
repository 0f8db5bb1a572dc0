# SPDX-License-Identifier: Apache-2.0
"""Commands at the limit of a body's range: a straight cable, and far too large a volume."""

from __future__ import annotations

import pytest

from gdfe_ros import Simulation
from gdfe_ros.constraints import Pose
from gdfe_ros.errors import CommandError
from gdfe_ros.simulation import Command
from test.written import advance, scene_of

GUIDED = """
mesh: {bar: {size: [0.1, 0.02, 0.02], cells: [10, 2, 2]}}
materials: {soft: {law: neo_hookean, young: 1.0e6, poisson: 0.45, density: 1000}}
handles: {base: {where: {face: x-}, fixed: true}, tip: {where: {face: x+}}}
actuators: {wire: {cable: {points: [[0, 0, Z], [0.05, 0, Z], [0.1, 0, Z]], command: length}}}
"""
CHAMBER = """
mesh: {bar: {size: [0.04, 0.03, 0.03], cells: [8, 6, 6], cut: [{box: {x: [0.005, 0.035], y: [-0.0099, 0.0099],
  z: [-0.0099, 0.0099]}}]}}
materials: {soft: {law: neo_hookean, young: 1.0e6, poisson: 0.45, density: 1000}}
handles: {base: {where: {face: x-}, fixed: true}}
actuators: {air: {chamber: {cavity: 0, command: volume}}}
"""


@pytest.mark.parametrize("height", ["0", "0.005"])
def test_a_straight_cable_between_held_faces_keeps_its_length(height: str) -> None:
    """A straight cable between faces is slack if longer than their distance, taut at it, and refused if shorter."""
    simulation = Simulation(scene_of(GUIDED.replace("Z", height)))
    slack = advance(simulation, Command(actuators={"wire": 0.102}))
    assert slack.actuators["wire"].effort == 0.0
    taut = advance(simulation, Command({"tip": Pose((-0.002, 0.0, 0.0))}, {"wire": 0.098}))
    assert taut.actuators["wire"].extent == pytest.approx(0.098, abs=2e-6)
    refused = simulation.step(Command(actuators={"wire": 0.097}))
    assert not refused.converged
    assert "0.098 m apart; remedy" in refused.message


def test_a_volume_that_no_wall_can_follow_is_refused() -> None:
    """A volume of 1 m^3 for a chamber of 12 ml is refused with the allowed range, and then 15 ml are reached."""
    simulation = Simulation(scene_of(CHAMBER))
    with pytest.raises(CommandError, match=r"'air': volume 1\.0 m\^3 .* at most 1000 times .* check the unit"):
        simulation.step(Command(actuators={"air": 1.0}))
    result = advance(simulation, Command(actuators={"air": 1.5e-5}))
    assert result.actuators["air"].extent == pytest.approx(1.5e-5, rel=1e-4)


def test_a_volume_that_is_too_much_ends_at_a_sound_shape() -> None:
    """A chamber commanded to 900 times its volume stops with cells pressed flat, not folded, and says so."""
    simulation = Simulation(scene_of(CHAMBER))
    result = simulation.step(Command(actuators={"air": 1.08e-2}))
    assert not result.converged
    assert result.min_det > 0.0
    assert "pressed flat at a corner" in result.message
