# SPDX-License-Identifier: Apache-2.0
"""Every shipped robot plays its program, has its expected motion, and keeps up 100 Hz on one core."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
import pytest

from benchmarks.robots import ROBOTS
from gdfe_ros import Simulation, load_scene
from gdfe_ros.results.step_result import StepResult

NAMES = [robot.scene for robot in ROBOTS]
RATE = 100.0
PACE = 10
"""Steps per second of simulation time: few, yet a jump of a degree is visible."""
Played = tuple[Simulation, list[StepResult]]


@pytest.fixture(scope="module")
def played() -> Callable[[str], Played]:
    """Play each robot's program once."""
    done: dict[str, Played] = {}

    def play(name: str) -> Played:
        if name not in done:
            simulation = Simulation(load_scene(name))
            done[name] = simulation, list(simulation.play(round(PACE * simulation.scene.program.duration)))
        return done[name]

    return play


def at(results: list[StepResult], moment: float) -> StepResult:
    """Return the step that ends at this time [s]."""
    return results[round(PACE * moment) - 1]


def angle(simulation: Simulation, result: StepResult, low: str, high: str) -> float:
    """Return the rotation [degrees] about y of the line from the lower probe to the upper one."""
    points = simulation.scene.probes
    across = points[high].at(result.positions)[0] - points[low].at(result.positions)[0]
    return float(np.degrees(np.arctan2(across[0], across[2])))


@pytest.mark.parametrize("name", NAMES)
def test_program_converges_without_crushing_an_element(name: str, played: Callable[[str], Played]) -> None:
    """Every step converges, with det F > 0.1 in every element."""
    _, results = played(name)
    assert all(result.converged for result in results)
    assert min(result.min_det for result in results) > 0.1


@pytest.mark.parametrize("name", ["pneunet", "bending_tube"])
def test_air_bends_smoothly_beyond_90_degrees(name: str, played: Callable[[str], Played]) -> None:
    """The angle rises with the pressure without a jump, to more than 90 degrees."""
    simulation, results = played(name)
    rising = [result for result in results if result.time <= 3.0]
    angles = np.array([angle(simulation, result, "tip", "tip_top") for result in rising])
    assert angles[-1] > 90.0
    assert np.diff(angles).min() > 0.0
    assert np.diff(angles).max() < 5.0
    pressures = [result.actuators["air"].effort for result in rising]
    volumes = [result.actuators["air"].extent for result in rising]
    assert np.diff(pressures).min() > 0.0
    assert np.diff(volumes).min() > 0.0


def test_finger_curls_both_ways(played: Callable[[str], Played]) -> None:
    """The flexor bends the fingertip down, and the extensor lifts it above its straight position."""
    simulation, results = played("tendon_finger")
    heights = [simulation.scene.probes["tip"].at(result.positions)[0][2] for result in results]
    assert min(heights) < -0.05
    straight = simulation.scene.probes["tip"].at(at(results, 2.5).positions)[0][2]
    assert max(heights) > straight + 0.002


def test_arm_leans_where_the_pressure_says(played: Callable[[str], Played]) -> None:
    """Pressure in the chamber at -y leans the arm to +y, at +y to -y, and in the upper chamber down."""
    simulation, results = played("three_chamber_arm")
    probe = simulation.scene.probes["tip"]
    left, right, upper = (probe.at(at(results, moment).positions)[0] for moment in (2.0, 4.0, 6.0))
    assert left[1] > 0.01
    assert right[1] < -0.01
    assert left[1] == pytest.approx(-right[1], rel=0.02)
    assert upper[2] < min(left[2], right[2]) - 0.02


def test_gripper_closes(played: Callable[[str], Played]) -> None:
    """The three fingertips come together while the wrist stays."""
    simulation, results = played("gripper")
    closed = at(results, 2.0)
    names = ("left_tip", "right_tip", "upper_tip")
    rest, now = (
        np.array([simulation.scene.probes[name].at(x)[0] for name in names])
        for x in (simulation.mesh.vertices, closed.positions)
    )

    def spread(tips: np.ndarray) -> float:
        return float(np.linalg.norm(tips - tips.mean(axis=0), axis=1).max())

    assert spread(now) < 0.3 * spread(rest)
    for name, shortening in (("left", 0.0045), ("right", 0.0045), ("upper", 0.0023)):
        assert closed.actuators[name].effort > 0.1
        assert closed.actuators[name].extent == pytest.approx(0.080 - shortening, abs=2e-5)


def test_strip_coils_by_growth_alone(played: Callable[[str], Played]) -> None:
    """The strip's end is turned by more than a right angle by growth alone."""
    simulation, results = played("shape_memory_strip")
    hot = simulation.scene.probes["tip"].at(at(results, 3.0).positions)[0]
    assert hot[0] < 0.03
    assert hot[2] > 0.03
    assert results[-1].actuators["heat"].extent == pytest.approx(0.96)


def test_joint_of_two_materials_tells_hyperelasticity(played: Callable[[str], Played]) -> None:
    """The joint of Fig. 10 moves by 0.33 +- 0.02 of the tip's path (measured: 0.315), by more with initial moduli."""
    simulation, results = played("two_material_bar")
    probes = simulation.probe_positions()
    share = probes["joint"][0] / probes["tip"][0]
    linear = {
        "materials.cheetah": {"law": "linear", "young": 19.13e6, "poisson": 0.49},
        "materials.ninjaflex": {"law": "linear", "young": 12.0e6, "poisson": 0.49},
    }
    assert share == pytest.approx(0.33, abs=0.02)
    plain = Simulation(load_scene("two_material_bar", overrides=linear))
    for result in plain.play():
        assert result.converged
    probes = plain.probe_positions()
    assert probes["joint"][0] / probes["tip"][0] > share + 0.03
    assert len(results) == 2 * PACE


@pytest.mark.bench
@pytest.mark.parametrize("name", NAMES)
def test_robot_streams_at_100_hz(name: str) -> None:
    """With steps of 10 ms, the program takes less processor time than its duration."""
    simulation = Simulation(load_scene(name))
    simulation.step()
    simulation.reset()
    started = time.process_time()
    results = list(simulation.play(round(RATE * simulation.scene.program.duration)))
    assert time.process_time() - started < simulation.scene.program.duration
    assert all(result.converged for result in results)
