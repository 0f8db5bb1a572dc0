# SPDX-License-Identifier: Apache-2.0
"""Landings that press corners flat: time goes on, every step converges, and no energy is made."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.landings import BALL, BAR, WAYS, Landing, Outcome, landed
from gdfe_ros import Command, Pose, Simulation
from gdfe_ros.checkpoint import load_state, save_state
from gdfe_ros.scene.loader import scene_from_text

HARD = Landing(up="corner", young=1e5, speed=3.0, step=0.002, height=0.001, lasts=0.03)
"""A landing with walls at work after three steps."""


def require_sound(outcome: Outcome) -> None:
    """Require that time went on, that all converged, and that no energy was made."""
    assert (outcome.stopped, outcome.unconverged, outcome.message) == (0, 0, "")
    assert outcome.most < 1.0 + 1e-9
    assert outcome.min_det > 0.0


def test_a_cube_that_falls_on_its_corner_lands() -> None:
    """Drop the soft cube of 4^3 cells by 10 mm on its corner: 0.3 s go by, through walls at work."""
    outcome = landed(Landing(up="corner", young=1e5, height=0.01, lasts=0.3))
    require_sound(outcome)
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
    """Throw it at the floor: no step stops."""
    require_sound(landed(replace(landing, scheme=scheme)))


def at_work(simulation: Simulation) -> Simulation:
    """Step until walls are at work."""
    while simulation.step().min_det > 0.2:
        assert simulation.time < 0.02
    return simulation


def test_a_landing_goes_on_from_a_file_to_the_same_bits() -> None:
    """Save a landing while walls are at work and go on from there: the same positions, iterations and energies."""
    first, second = at_work(HARD.simulation()), HARD.simulation()
    load_state(second, save_state(first))
    for _ in range(4):
        one, other = first.step(), second.step()
        assert (one.iterations, one.energies) == (other.iterations, other.energies)
        np.testing.assert_array_equal(one.positions, other.positions)


def test_threads_land_to_the_same_bits() -> None:
    """Land in one thread and in two: the same positions while walls are at work."""
    landing = replace(HARD, mesh="{bar: {size: [0.04, 0.04, 0.04], cells: [8, 8, 8]}}")
    one, two = landing.simulation(), landing.simulation(solver__threads=2)
    for _ in range(4):
        first, second = one.step(), two.step()
        assert first.iterations == second.iterations
        np.testing.assert_array_equal(first.positions, second.positions)
    assert first.min_det < 0.2


PAIR = """
name: pair
meshes:
  low: {bar: {size: [0.04, 0.04, 0.04], cells: [4, 4, 4]}}
  high: {bar: {size: [0.04, 0.04, 0.04], cells: [4, 4, 4]}, at: [0.0, 0.0, 0.07], rotation_deg: [-36.0, 36.0, 0.0]}
self_contact: {}
materials: {soft: {law: neo_hookean, young: 1.0e5, poisson: 0.45, density: 1000}}
regions: [{material: soft}]
handles: {base: {where: {box: {z: [-0.021, -0.019]}}, fixed: true}}
loads: {push: {gravity: [0.0, 0.0, -60.0]}}
dynamics: {step: 0.002}
"""


def test_a_cube_lands_on_another_with_its_corner() -> None:
    """Push a cube down on another with six times its weight, corner first: all converges, through walls at work."""
    simulation = Simulation(scene_from_text(PAIR))
    results = [simulation.step() for _ in range(13)]
    assert all(result.converged for result in results), [result.message for result in results if result.message]
    assert 0.0 < min(result.min_det for result in results) < 0.2
    assert simulation.time == pytest.approx(0.026)


@pytest.mark.parametrize("driven", ["chamber", "growth"])
def test_what_is_driven_lands_too(driven: str) -> None:
    """Throw a hollow ball that is blown up, and a cube that grows: walls act beside what drives them."""
    mesh = {"mesh": BALL, "up": "face"} if driven == "chamber" else {"up": "corner"}
    entry = {"chamber": {"chamber": {"command": "pressure"}}, "growth": {"growth": {"stretch": [1.2, 1.2, 1.2]}}}
    value = {"chamber": 2e3, "growth": 1.0}
    landing = Landing(**mesh, young=1e5, step=0.002, speed=5.0, lasts=0.04)
    simulation = landing.simulation(actuators={"a": entry[driven]})
    results = [simulation.step(Command(actuators={"a": value[driven]})) for _ in range(20)]
    assert all(result.converged for result in results), [result.message for result in results if result.message]
    assert 0.0 < min(result.min_det for result in results) < 0.2


def test_a_fall_that_folds_corners_goes_on() -> None:
    """Throw a very soft cube at 20 m/s: what does not converge says why, time goes on, and walls unfold what folded."""
    simulation = Landing(up="corner", young=1e4, speed=20.0).simulation()
    results = [simulation.step() for _ in range(5)]
    assert simulation.time == pytest.approx(0.025)
    for result in results:
        assert result.converged == (result.message == "")
        assert result.converged or "elements folded" in result.message or "elements pressed flat" in result.message
    assert results[-1].converged
    assert results[-1].min_det > 0.0


PRESS = """
name: press
mesh: {bar: {size: [0.04, 0.04, 0.04], cells: [4, 4, 4]}}
materials: {soft: {law: neo_hookean, young: 1.0e5, poisson: 0.4, density: 1000}}
regions: [{material: soft}]
handles: {base: {where: {face: z+}, fixed: true}}
"""


@pytest.mark.parametrize("way", ["edge", "corner"])
def test_a_press_goes_on_past_where_corners_fold(way: str) -> None:
    """Press an edge and a corner by 60 % of a cube's side: equilibria all along, and it comes home."""
    up = np.array(WAYS[way]) / np.linalg.norm(WAYS[way])
    at = (scene_from_text(PRESS).mesh.vertices @ up).min() * up
    plate = {"plane": up.tolist(), "at": at.tolist()}
    simulation = Simulation(scene_from_text(PRESS, overrides={"obstacles": {"plate": plate}}))
    for share in (0.15, 0.3, 0.45, 0.6):
        result = simulation.step(Command(handles={"plate": Pose(tuple(share * 0.04 * up))}))
        assert result.converged, result.message
        assert result.min_det > 0.0
    assert result.min_det < 0.2
    result = simulation.step(Command(handles={"plate": Pose()}))
    assert result.converged, result.message
    np.testing.assert_allclose(result.positions, simulation.mesh.vertices, atol=1e-5)
