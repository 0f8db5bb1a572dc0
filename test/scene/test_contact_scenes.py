# SPDX-License-Identifier: Apache-2.0
"""Every shipped scene with contact converges over its program and has its expected behaviour."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from gdfe_ros import Simulation, load_scene
from gdfe_ros.mesh import check_mesh
from gdfe_ros.results.step_result import StepResult

SCENES = ["finger_press", "grasp", "ball_gripper", "ball_drop", "crawler", "peg_in_soft_hole", "soft_pinch"]
Played = tuple[Simulation, list[StepResult], list[np.ndarray]]


@pytest.fixture(scope="module")
def played() -> Callable[[str], Played]:
    """Play each scene's program once; return the simulation, its results, and its rigid body's displacements [m]."""
    done: dict[str, Played] = {}

    def play(name: str) -> Played:
        if name not in done:
            simulation, results, places = Simulation(load_scene(name)), [], []
            bodies = [handle.name for handle in simulation.scene.handles if handle.section == "bodies"]
            for result in simulation.play():
                results.append(result)
                places.extend(np.array(simulation.handle_pose(body).translation) for body in bodies)
            done[name] = simulation, results, places
        return done[name]

    return play


@pytest.mark.parametrize("name", SCENES)
def test_program_converges(name: str, played: Callable[[str], Played]) -> None:
    """Every step converges without a crushed element, and penetration is at most 1e-4 of the body's size."""
    simulation, results, _ = played(name)
    assert [(result.time, result.message) for result in results if not result.converged] == []
    assert min(result.min_det for result in results) > 0.1
    gaps = np.concatenate([touch.gaps for result in results for touch in result.contacts.values()])
    assert len(gaps) > 0
    assert gaps.min() > -1e-4 * simulation.mesh.size


def test_the_finger_presses_with_the_tendon(played: Callable[[str], Played]) -> None:
    """The finger presses harder on the plate with every newton of the tendon, and separates later."""
    _, results, _ = played("finger_press")
    tensions = np.array([result.actuators["flexor"].effort for result in results])
    forces = np.array([result.reactions["plate"][2] for result in results])
    peak = int(np.argmax(tensions))
    assert peak >= 5
    assert np.diff(forces[: peak + 1]).min() > 0.0
    assert forces[peak] > 1.0
    assert forces[-1] == 0.0


def test_the_gripper_carries_the_box(played: Callable[[str], Played]) -> None:
    """The gripper lifts the box by 5 cm, holds it for 10 s without creep, puts it down at its place, and opens."""
    simulation, results, places = played("grasp")
    times, way = np.array([result.time for result in results]), np.array(places)
    held = (times > 2.5) & (times < 12.39)
    assert way[held, 2].min() > 0.05
    assert np.ptp(way[held], axis=0).max() < 1e-8
    assert np.abs(way[-1]).max() < 1e-5
    lifted = results[int(np.flatnonzero(held)[-1])]
    assert -lifted.reactions["part"][2] == pytest.approx(9.81 * 500 * 0.034 * 0.03 * 0.03, rel=0.01)
    assert not lifted.reactions["table"].any()
    assert not lifted.contacts["part"].slips.any()
    tips = [simulation.scene.sensors[name].wrench(lifted)[0] for name in ("left_tip", "right_tip")]
    assert tips[0] == pytest.approx(-tips[1], rel=0.01)
    assert abs(tips[0]) > 0.2
    assert not results[-1].reactions["part"].any()


def test_what_is_held_costs_few_iterations(played: Callable[[str], Played]) -> None:
    """A step of the grasp takes fewer than 5 iterations on average and fewer than 100 at most."""
    iterations = [result.iterations for result in played("grasp")[1]]
    assert np.mean(iterations) < 5.0
    assert max(iterations) < 100


def test_the_ball_bounces_and_rolls(played: Callable[[str], Played]) -> None:
    """The ball bounces with less energy each time, then rolls down the slope and turns."""
    simulation, results, _ = played("ball_drop")
    totals = np.array(
        [sum(result.energies[name] for name in ("kinetic", "elastic", "potential")) for result in results]
    )
    touches = np.array([len(result.contacts["slope"].vertices) > 0 for result in results])
    landings = np.flatnonzero(np.diff(touches.astype(int)) == 1) + 1
    assert len(landings) >= 2
    flights = [flight[~on] for flight, on in zip(np.split(totals, landings), np.split(touches, landings), strict=True)]
    assert np.diff([flight.max() for flight in flights if len(flight)]).max() < 0.0
    mesh, end = simulation.mesh, results[-1]
    top = int(np.argmax(mesh.vertices[:, 2]))
    middle = end.positions.mean(axis=0)
    arm, turning = end.positions[top] - middle, end.velocities[top] - end.velocities.mean(axis=0)
    spin = np.cross(arm, turning)[1] / (arm @ arm)
    speed = end.velocities.mean(axis=0)[0]
    assert speed > 0.1
    assert middle[0] > 0.03
    assert spin == pytest.approx(speed / 0.03, rel=0.2)


def test_the_crawler_advances(played: Callable[[str], Played]) -> None:
    """The crawler moves forward with every wave of its muscles, and has its undeformed length at the end."""
    simulation, results, _ = played("crawler")
    times = np.array([result.time for result in results])
    middles = np.array([result.positions[:, 0].mean() for result in results])
    rest = simulation.mesh.vertices[:, 0].mean()
    first, second = (middles[int(np.argmin(np.abs(times - moment)))] for moment in (1.0, 2.0))
    assert first > rest + 0.001
    assert second > first + 0.001
    assert np.ptp(results[-1].positions[:, 0]) == pytest.approx(0.104, abs=1e-3)


def test_soft_fingers_carry_a_soft_ball(played: Callable[[str], Played]) -> None:
    """Two soft fingers lift a soft ball, each with half of its weight and without creep, and release it."""
    simulation, results, _ = played("soft_pinch")
    scene, times = simulation.scene, np.array([result.time for result in results])
    ball, rest = scene.mesh.parts["ball"].first_vertex, scene.mesh.vertices
    hangs = [result for result, time in zip(results, times, strict=True) if 2.5 < time < 3.0]
    places = np.array([result.positions[ball:].mean(axis=0) for result in hangs])
    assert places[:, 2].min() > rest[ball:, 2].mean() + 0.03
    assert np.ptp(places, axis=0).max() < 1e-7
    felt = np.array([scene.sensors[name].wrench(hangs[-1])[:3] for name in ("left", "right")])
    volume = check_mesh(scene.mesh).volumes[scene.mesh.parts["ball"].first_cell :].sum()
    np.testing.assert_allclose(felt[:, 2], -0.5 * 200 * 9.81 * volume, rtol=0.01)
    assert felt[1, 0] == pytest.approx(-felt[0, 0], rel=1e-3)
    assert felt[1, 0] > 0.2
    assert not results[-1].contacts["(self)"].vertices.size


def test_three_fingers_lift_the_ball(played: Callable[[str], Played]) -> None:
    """The fingers lift the ball with the palm by 5 cm, share its weight, and hold it without slip."""
    simulation, results, places = played("ball_gripper")
    last, weight = results[-1], 9.81 * 500 * 4.0 / 3.0 * np.pi * 0.02**3
    np.testing.assert_allclose(places[-1], [0.0, 0.0, 0.05], atol=0.003)
    assert last.reactions["ball"][2] == pytest.approx(-weight, rel=0.01)
    assert not last.reactions["table"].any()
    assert not last.contacts["ball"].slips.any()
    tip = simulation.scene.sensors["front_tip"].wrench(last)
    assert tip[2] == pytest.approx(-weight / 3.0, rel=0.02)
    assert tip[0] > 0.2


def test_the_page_about_the_gripper_has_the_shipped_scene() -> None:
    """The scene on docs/gripper.md is the shipped one, to the letter."""
    root = Path(__file__).parents[2]
    scene = (root / "config" / "scenes" / "ball_gripper.yaml").read_text(encoding="utf-8")
    assert f"```yaml\n{scene}```" in (root / "docs" / "gripper.md").read_text(encoding="utf-8")


def test_the_peg_widens_the_hole(played: Callable[[str], Played]) -> None:
    """The hole resists the peg on the way in, drags at it by friction on the way out, and closes again."""
    simulation, results, _ = played("peg_in_soft_hole")
    times, along = (
        np.array(values) for values in zip(*((r.time, r.reactions["peg"][0]) for r in results), strict=True)
    )
    assert along[(times > 0.9) & (times <= 2.5)].min() > 0.1
    assert along[(times > 2.6) & (times < 3.4)].max() < -0.1
    assert not results[-1].reactions["peg"].any()
    moved = np.linalg.norm(results[-1].positions - simulation.mesh.vertices, axis=1)
    assert moved.max() < 1e-3 * simulation.mesh.size
