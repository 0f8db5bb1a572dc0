# SPDX-License-Identifier: Apache-2.0
"""Coulomb friction: sticking, slipping, and what it takes."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from gdfe_ros import Command, Pose, Simulation
from gdfe_ros.scene.loader import scene_from_text

G = 9.81
DRAGGED = """
name: dragged
mesh: {bar: {size: [0.05, 0.05, 0.05], cells: [2, 2, 2]}}
materials: {soft: {law: neo_hookean, young: 2.0e5, poisson: 0.4, density: 1000}}
regions: [{material: soft}]
handles: {top: {where: {face: z+}}}
obstacles: {ball: {sphere: {radius: 0.03}, at: [0.003, 0.002, -0.0552], fixed: true, friction: 1.0}}
solver: {skip: []}
"""


def tilted(
    slider: Callable[..., Simulation], friction: float, *, angle: float = 30.0, **overrides: object
) -> Simulation:
    """Return the slab on a floor with gravity as on a slope of so many degrees."""
    slope = math.radians(angle)
    gravity = [G * math.sin(slope), 0.0, -G * math.cos(slope)]
    return slider(obstacles__floor__friction=friction, loads={"weight": {"gravity": gravity}}, **overrides)


def ways(simulation: Simulation, steps: int) -> np.ndarray:
    """Return the mean displacement (steps,) [m] along the slope."""
    found = []
    for _ in range(steps):
        result = simulation.step()
        assert result.converged, result.message
        found.append(result.positions[:, 0].mean())
    return np.array(found)


@pytest.mark.parametrize("friction", [0.1, 0.3, 0.5])
def test_a_slab_slides_as_theory_says(slider: Callable[..., Simulation], friction: float) -> None:
    """On a slope of 30 degrees it gathers speed by g (sin - mu cos), within 0.5 %."""
    path = ways(tilted(slider, friction), 160)
    late = np.arange(80, 160) * 0.005
    acceleration = 2.0 * np.polyfit(late, path[80:], 2)[0]
    slope = math.radians(30.0)
    assert acceleration == pytest.approx(G * (math.sin(slope) - friction * math.cos(slope)), rel=0.005)


@pytest.mark.parametrize("friction", [0.1, 0.57, 1.0])
def test_a_slab_sticks_below_the_cone_and_slips_above(slider: Callable[..., Simulation], friction: float) -> None:
    """On a slope that asks for 0.98 of the coefficient it stands, on one that asks for 1.02 it leaves."""
    speeds = {}
    for demand in (0.98, 1.02):
        simulation = tilted(slider, friction, angle=math.degrees(math.atan(demand * friction)))
        path = ways(simulation, 240)
        speeds[demand] = (path[-1] - path[-40]) / (39 * 0.005)
    assert abs(speeds[0.98]) < 1e-6
    assert speeds[1.02] > 1e-3


def test_what_sticks_does_not_creep(slider: Callable[..., Simulation]) -> None:
    """A slab that stands on a slope for ten seconds drifts by less than a nanometre in a second."""
    simulation = tilted(slider, 0.7, solver={"skip": []})
    ways(simulation, 800)
    path = ways(simulation, 2000)
    assert abs(path[-1] - path[0]) / 10.0 < 1e-9


def test_friction_takes_what_the_fall_gives(slider: Callable[..., Simulation]) -> None:
    """The balance of a slab that slides closes: what it lost in height is motion, or was rubbed off."""
    simulation = tilted(slider, 0.3)
    ways(simulation, 120)
    energies = simulation.result.energies
    held = energies["kinetic"] + energies["elastic"] + energies["potential"]
    assert energies["dissipated"] > 0.0
    assert held + energies["dissipated"] == pytest.approx(0.0, abs=0.01 * abs(energies["potential"]))


def test_what_is_dragged_over_a_ball_stays_when_it_is_asked_again() -> None:
    """Where a vertex slips about a ball, what presses turns with it: 4.5 tolerances were left of what had converged."""
    simulation, slipped = Simulation(scene_from_text(DRAGGED)), 0
    for way in ((0.0, 0.0, -0.004), (0.001, 0.0, -0.006), (0.004, 0.001, -0.006), (0.01, 0.002, -0.006)):
        command = Command(handles={"top": Pose(way)})
        result = simulation.step(command)
        assert result.converged, result.message
        slipped += int(result.contacts["ball"].slips.sum())
        for _ in range(3):
            again = simulation.step(command)
            assert np.abs(again.positions - result.positions).max() < 1e-4 * simulation.mesh.size
    assert slipped


FINGER = """
name: dragged
mesh: {bar: {size: [0.012, 0.012, 0.06], cells: [3, 3, 12]}}
materials: {soft: {law: neo_hookean, young: 5.0e5, poisson: 0.45, density: 1000}}
regions: [{material: soft}]
handles: {base: {where: {face: z+}}}
obstacles: {table: {box: {size: [0.3, 0.1, 0.02]}, at: [0, 0, AT], friction: 1, fixed: true}}
"""


def test_a_finger_that_is_dragged_over_a_table_is_found_at_every_step() -> None:
    """Press a slender finger on a table and drag it: friction lifts what it holds, and each step settles."""
    low = scene_from_text(FINGER.replace("AT", "-1")).mesh.vertices[:, 2].min()
    simulation = Simulation(scene_from_text(FINGER.replace("AT", str(low - 0.0101))))
    poses = [Pose((0.0, 0.0, -0.003 * step / 20)) for step in range(1, 21)]
    poses += [Pose((0.08 * step / 128, 0.0, -0.003)) for step in range(1, 65)]
    missed = [pose for pose in poses if not simulation.step(Command({"base": pose})).converged]
    assert not missed
