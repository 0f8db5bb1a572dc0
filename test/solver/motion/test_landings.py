# SPDX-License-Identifier: Apache-2.0
"""Landings that press corners flat: time passes, every step converges, and no energy is made."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gdfe_ros import Command, Pose, Simulation
from gdfe_ros.checkpoint import load_state, save_state
from test.solver.motion.landings import BALL, BAR, WAYS, Landing, Outcome, landed
from test.written import advance, scene_of

HARD = Landing(up="corner", young=1e5, speed=3.0, step=0.002, height=0.001, lasts=0.03)
"""A landing in which the fold barrier acts after three steps."""


def sound(outcome: Outcome) -> bool:
    """Return whether no step stopped, all converged, no energy was made, and no element is inverted."""
    went_on = (outcome.stopped, outcome.unconverged, outcome.message) == (0, 0, "")
    return went_on and outcome.most < 1.0 + 1e-9 and outcome.min_det > 0.0


def test_a_cube_that_falls_on_its_corner_lands() -> None:
    """A soft cube of 4^3 cells that falls by 10 mm on its corner is simulated for 0.3 s while the fold barrier acts."""
    outcome = landed(Landing(up="corner", young=1e5, height=0.01, lasts=0.3))
    assert sound(outcome), outcome
    assert outcome.min_det < 0.2
    assert outcome.iterations < 60


@pytest.mark.parametrize("scheme", ["bdf2", "newmark", "generalised_alpha"])
@pytest.mark.parametrize(
    "landing",
    [
        Landing(up="edge", young=1e5, step=0.002, speed=5.0, lasts=0.04),
        Landing(mesh=BALL, up="face", young=1e5, step=0.002, speed=5.0, lasts=0.04),
        Landing(mesh=BAR, up="corner", young=1e6, step=0.002, speed=5.0, lasts=0.04),
        Landing(up="corner", young=1e4, step=0.005, speed=2.0, lasts=0.06),
    ],
    ids=["cube on its edge", "hollow ball", "bar on its corner", "soft cube on its corner"],
)
def test_what_is_thrown_goes_on(landing: Landing, scheme: str) -> None:
    """A body thrown at the floor converges in every step."""
    outcome = landed(replace(landing, scheme=scheme))
    assert sound(outcome), outcome


def at_work(simulation: Simulation) -> Simulation:
    """Make steps until the fold barrier acts."""
    while simulation.step().min_det > 0.2:
        assert simulation.time < 0.02
    return simulation


def test_a_landing_goes_on_from_a_file_to_the_same_bits() -> None:
    """A landing saved while the fold barrier acts continues with the same positions, iterations and energies."""
    first, second = at_work(HARD.simulation()), HARD.simulation()
    load_state(second, save_state(first))
    for _ in range(4):
        one, other = first.step(), second.step()
        assert (one.iterations, one.energies) == (other.iterations, other.energies)
        np.testing.assert_array_equal(one.positions, other.positions)


def test_threads_land_to_the_same_bits() -> None:
    """A landing in two threads has the same positions as one in a single thread while the fold barrier acts."""
    landing = replace(HARD, mesh="{bar: {size: [0.04, 0.04, 0.04], cells: [8, 8, 8]}}")
    one, two = landing.simulation(), landing.simulation(solver__threads=2)
    for _ in range(4):
        first, second = one.step(), two.step()
        assert first.iterations == second.iterations
        np.testing.assert_array_equal(first.positions, second.positions)
    assert first.min_det < 0.2


PAIR = """
meshes:
  low: {bar: {size: [0.04, 0.04, 0.04], cells: [4, 4, 4]}}
  high: {bar: {size: [0.04, 0.04, 0.04], cells: [4, 4, 4]}, at: [0.0, 0.0, 0.07], rotation_deg: [-36.0, 36.0, 0.0]}
self_contact: {}
materials: {soft: {law: neo_hookean, young: 1.0e5, poisson: 0.45, density: 1000}}
handles: {base: {where: {box: {z: [-0.021, -0.019]}}, fixed: true}}
loads: {push: {gravity: [0.0, 0.0, -60.0]}}
dynamics: {step: 0.002}
"""


def test_a_cube_lands_on_another_with_its_corner() -> None:
    """A cube pushed corner first onto another with six times its weight converges while the fold barrier acts."""
    simulation = Simulation(scene_of(PAIR))
    results = [simulation.step() for _ in range(13)]
    assert all(result.converged for result in results), [result.message for result in results if result.message]
    assert 0.0 < min(result.min_det for result in results) < 0.2
    assert simulation.time == pytest.approx(0.026)


@pytest.mark.parametrize("driven", ["chamber", "growth"])
def test_what_is_driven_lands_too(driven: str) -> None:
    """A pressurised hollow ball and a growing cube land with the fold barrier at work beside the actuator."""
    mesh = {"mesh": BALL, "up": "face"} if driven == "chamber" else {"up": "corner"}
    entry = {"chamber": {"chamber": {"command": "pressure"}}, "growth": {"growth": {"stretch": [1.2, 1.2, 1.2]}}}
    value = {"chamber": 2e3, "growth": 1.0}
    landing = Landing(**mesh, young=1e5, step=0.002, speed=5.0, lasts=0.04)
    simulation = landing.simulation(actuators={"a": entry[driven]})
    results = [simulation.step(Command(actuators={"a": value[driven]})) for _ in range(20)]
    assert all(result.converged for result in results), [result.message for result in results if result.message]
    assert 0.0 < min(result.min_det for result in results) < 0.2


def test_a_fall_that_folds_corners_goes_on() -> None:
    """A very soft cube thrown at 20 m/s folds: failed steps say so, time passes, and the barrier unfolds corners.

    Rounding decides which of the steps fail.
    """
    simulation = Landing(up="corner", young=1e4, speed=20.0).simulation()
    results = [simulation.step() for _ in range(8)]
    assert simulation.time == pytest.approx(0.04)
    for result in results:
        assert result.converged == (result.message == "" or result.message.startswith("the cells are too coarse"))
        assert result.converged or "elements folded" in result.message or "elements pressed flat" in result.message
    failed = [result.converged for result in results].index(False)
    later = [result for result in results[failed:] if result.converged]
    assert later
    assert min(result.min_det for result in later) > 0.0


PRESS = """
mesh: {bar: {size: [0.04, 0.04, 0.04], cells: [4, 4, 4]}}
materials: {soft: {law: neo_hookean, young: 1.0e5, poisson: 0.4, density: 1000}}
handles: {base: {where: {face: z+}, fixed: true}}
"""


@pytest.mark.parametrize("way", ["edge", "corner"])
def test_a_press_goes_on_past_where_corners_fold(way: str) -> None:
    """A cube pressed on an edge or corner by 60 % of its side converges at each step and returns to its shape."""
    up = np.array(WAYS[way]) / np.linalg.norm(WAYS[way])
    at = (scene_of(PRESS).mesh.vertices @ up).min() * up
    plate = {"plane": up.tolist(), "at": at.tolist()}
    simulation = Simulation(scene_of(PRESS, overrides={"obstacles": {"plate": plate}}))
    for share in (0.15, 0.3, 0.45, 0.6):
        result = advance(simulation, Command(handles={"plate": Pose(tuple(share * 0.04 * up))}))
        assert result.min_det > 0.0
    assert result.min_det < 0.2
    result = advance(simulation, Command(handles={"plate": Pose()}))
    np.testing.assert_allclose(result.positions, simulation.mesh.vertices, atol=1e-5)
