# SPDX-License-Identifier: Apache-2.0
"""Joints that yield: springs between the motors and the links, in balance with the soft body."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve
from scipy.signal import find_peaks

from gdfe_ros import Command, Pose, Simulation, load_scene
from gdfe_ros.checkpoint import load_state, save_state
from gdfe_ros.errors import GdfeError, SceneError
from test.written import advance

BLOCK = 1200.0 * 0.04 * 0.02 * 0.02
"""Mass of the soft block [kg]."""
FINE = 1e-4 / 0.2
"""Promised accuracy of a joint's position [rad], over the body's size: the tolerance at a lever of 0.2 m [1/m]."""
BOTH = "{lift: {stiffness: 200, damping: 5}, bend: {stiffness: 100}}"


@pytest.fixture
def yielding(held_block: Path) -> Callable[..., Simulation]:
    """Return a function that makes the simulation of the held block with given springs and further keys."""

    def make(compliance: str, more: str = "", young: float = 3.0e6) -> Simulation:
        text = held_block.read_text(encoding="utf-8").rstrip()
        text = text.removesuffix("}").replace("young: 3.0e5", f"young: {young}")
        held_block.write_text(f"{text}, compliance: {compliance}}}\n{more}", encoding="utf-8")
        return Simulation(load_scene(held_block))

    return make


def test_joints_sag_under_links_and_body(yielding: Callable) -> None:
    """At an equilibrium, joints sag as two rigid pendulums on springs with the weights of the links and the block."""
    simulation = yielding(BOTH)
    assert simulation.step().converged
    assert simulation.step().skipped == {"solve": 1}

    def gap(angles: np.ndarray) -> list[float]:
        lift, both = angles[0], angles.sum()
        inner = 9.81 * (2.0 * 0.2 + (1.0 + BLOCK) * 0.4) * np.sin(lift)
        outer = 9.81 * (1.0 * 0.1 + BLOCK * 0.22) * np.sin(both)
        return [inner + outer - 200.0 * (angles[0] - np.pi / 2.0), outer - 100.0 * angles[1]]

    expected = fsolve(gap, [np.pi / 2.0, 0.0])
    np.testing.assert_allclose(list(simulation.joint_positions.values()), expected, atol=FINE * simulation.mesh.size)


def test_efforts_are_those_of_the_springs(yielding: Callable) -> None:
    """The effort of a joint, from the wrench of the body and the weights of the links, is the torque of its spring."""
    simulation = yielding(BOTH)
    simulation.step(Command(joints={"bend": 0.5}))
    for stiffness, reading in zip((200.0, 100.0), simulation.joint_states().values(), strict=True):
        torque = stiffness * (reading.goal - reading.position)
        assert reading.effort == pytest.approx(torque, abs=stiffness * FINE * simulation.mesh.size)


def test_stiff_joints_are_rigid(yielding: Callable, held_block: Path) -> None:
    """Joints with a stiffness of 1e9 N m/rad carry the body to where rigid joints carry it."""
    rigid = Simulation(load_scene(held_block))
    stiff = yielding("{lift: {stiffness: 1.0e9}, bend: {stiffness: 1.0e9}}", young=3.0e5)
    for simulation in (rigid, stiff):
        assert simulation.step(Command(joints={"bend": 0.5})).converged
    np.testing.assert_allclose(stiff.positions, rigid.positions, atol=1e-4 * rigid.mesh.size)


def test_one_joint_yields_and_the_other_does_not(yielding: Callable) -> None:
    """A joint without a spring is at its commanded position."""
    simulation = yielding("{lift: {stiffness: 200}}")
    simulation.step(Command(joints={"bend": 0.5}))
    assert simulation.joint_positions["bend"] == 0.5
    assert simulation.joint_positions["lift"] > np.pi / 2.0 + 0.01


def test_a_push_on_the_hand_moves_the_arm(yielding: Callable) -> None:
    """A plane that presses on the block turns the joint until its spring balances the moment of the contact force."""
    plane = "obstacles: {press: {plane: [0, 0, -1], at: [0, 0, 0.02]}}\n"
    simulation = yielding("{lift: {stiffness: 200}}, links: []", plane)
    advance(simulation)
    after = advance(simulation, Command(handles={"press": Pose(translation=(0.0, 0.0, -0.06))}))
    touch = after.contacts["press"]
    moment = -(touch.forces[:, 2] * (touch.places[:, 0] + 0.6)).sum()
    q = simulation.joint_positions["lift"]
    weights = 9.81 * (2.0 * 0.2 + 1.0 * 0.5) * np.sin(q) + _moment_of_body(simulation)
    assert moment > 1.0
    assert 200.0 * (q - np.pi / 2.0) == pytest.approx(moment + weights, rel=2e-3)


def _moment_of_body(simulation: Simulation) -> float:
    """Return the moment [N m] of the block's weight about the first joint."""
    corners = simulation.positions[simulation.mesh.cells]
    return 9.81 * BLOCK * float(corners.mean(axis=(0, 1))[0] + 0.6)


@pytest.mark.parametrize("scheme", ["newmark", "bdf2", "generalised_alpha"])
def test_a_released_arm_swings_at_its_frequency(yielding: Callable, scheme: str) -> None:
    """A horizontal arm on a spring swings about its sag with the period of its inertia."""
    simulation = yielding("{lift: {stiffness: 400}}", f"dynamics: {{scheme: {scheme}, step: 0.0025}}\n")
    arm = simulation.scene.arms[0]
    inertia = arm.dynamics.mass_matrix(arm.start)[0, 0] + BLOCK * (0.62**2 + (0.04**2 + 0.02**2) / 12.0)
    period = 2.0 * np.pi * np.sqrt(inertia / 400.0)
    angles = []
    for _ in range(240):
        assert simulation.step().converged
        angles.append(simulation.joint_positions["lift"] - np.pi / 2.0)
    angles = np.array(angles)
    peaks = np.array([_vertex(angles, i) for i in find_peaks(angles)[0]])
    late = (2.0 * np.pi * 0.0025 / period) ** 2 / (3.0 if scheme == "bdf2" else 12.0)
    assert np.diff(peaks).mean() * 0.0025 == pytest.approx(period * (1.0 + late), rel=2e-3)
    assert angles.max() == pytest.approx(2.0 * 8.9458 / 400.0, rel=5e-3)


@pytest.mark.parametrize("scheme", ["bdf2", "generalised_alpha", "newmark"])
def test_a_released_arm_falls_with_errors_of_second_order(yielding: Callable, scheme: str) -> None:
    """Half the step has at most a third of the error of a released arm's motion, also in the first steps."""
    motion, worst = f"dynamics: {{scheme: {scheme}, step: 0.02}}\n", []
    simulation = yielding("{lift: {stiffness: 400}}, links: []", motion)
    arm, lever = simulation.scene.arms[0], 2.0 * 0.2 + 1.0 * 0.5 + BLOCK * 0.62
    inertia = arm.dynamics.mass_matrix(arm.start)[0, 0] + BLOCK * (0.62**2 + (0.04**2 + 0.02**2) / 12.0)

    def fall(_: float, y: np.ndarray) -> list[float]:
        return [y[1], (9.81 * lever * np.cos(y[0]) - 400.0 * y[0]) / inertia]

    for count in (12, 24):
        simulation.reset()
        times = np.linspace(0.0, 0.12, count + 1)
        exact = solve_ivp(fall, (0.0, 0.12), [0.0, 0.0], t_eval=times, rtol=1e-9, atol=1e-12).y[0]
        gaps = []
        for expected in exact[1:]:
            assert simulation.step(dt=0.12 / count).converged
            gaps.append(simulation.joint_positions["lift"] - np.pi / 2.0 - expected)
        worst.append(np.abs(gaps).max())
    assert worst[1] < worst[0] / 3.0


def _vertex(values: np.ndarray, i: int) -> float:
    """Return the place of the largest value of the parabola through three values."""
    a, b, c = values[i - 1 : i + 2]
    return i + 0.5 * (a - c) / (a - 2.0 * b + c)


def test_damping_brings_an_arm_to_rest(yielding: Callable) -> None:
    """With a damper, the arm stops at its sag, and further steps are not solved."""
    motion = "dynamics: {scheme: bdf2, step: 0.01, damping: {viscosity: 2000}}\n"
    simulation = yielding("{lift: {stiffness: 400, damping: 12}}", motion)
    result = advance(simulation, count=400)
    assert result.skipped == {"solve": 1}
    assert simulation.settled
    reading = simulation.joint_states()["lift"]
    assert reading.effort == pytest.approx(400.0 * (reading.goal - reading.position), rel=1e-4)
    assert reading.velocity == pytest.approx(0.0, abs=1e-4)


def test_a_long_step_is_coupled_in_its_internal_steps(yielding: Callable) -> None:
    """A step of four internal steps ends where four steps end, while the motor moves."""
    motion = "dynamics: {scheme: bdf2, step: 0.005}\n"
    simulation = yielding(BOTH, motion)
    simulation.step()
    start = simulation.snapshot()
    result = simulation.step(dt=0.02)
    once = dict(simulation.joint_positions)
    assert (result.substeps, result.time) == (4, pytest.approx(0.025))
    simulation.restore(start)
    advance(simulation, dt=0.005, count=4)
    np.testing.assert_allclose(list(once.values()), list(simulation.joint_positions.values()), atol=5e-6)


def test_a_saved_swing_continues_with_the_same_bits(yielding: Callable) -> None:
    """A snapshot and an archive contain the motion of the links."""
    simulation = yielding(BOTH, "dynamics: {step: 0.005}\n")
    advance(simulation, count=5)
    saved, snapshot = save_state(simulation), simulation.snapshot()
    ends = []
    for restore in (lambda: None, lambda: simulation.restore(snapshot), lambda: load_state(simulation, saved)):
        restore()
        advance(simulation, Command(joints={"bend": 0.2}), count=5)
        ends.append((simulation.positions.copy(), list(simulation.joint_positions.values())))
    for positions, joints in ends[1:]:
        np.testing.assert_array_equal(positions, ends[0][0])
        assert joints == ends[0][1]


def test_a_deadline_ends_a_coupled_step_and_replays(yielding: Callable) -> None:
    """A step that a deadline ended is repeated bit by bit with the recorded number of queries."""
    simulation = yielding(BOTH, "dynamics: {step: 0.005}\n")
    simulation.step()
    start = simulation.snapshot()
    cut = simulation.step(dt=0.05, deadline=1e-9)
    assert not cut.converged
    assert cut.time < 0.055
    positions, joints = simulation.positions.copy(), simulation.joint_positions
    simulation.restore(start)
    simulation.step(dt=0.05, cut_after=cut.cut_after)
    np.testing.assert_array_equal(simulation.positions, positions)
    assert simulation.joint_positions == joints
    assert simulation.step(dt=0.05).converged


def test_derivatives_are_refused(yielding: Callable) -> None:
    """Derivatives assume that the flange does not move: they are refused with the reason."""
    simulation = yielding(BOTH)
    simulation.step()
    for call in (simulation.sensitivities, simulation.jacobian, simulation.follow):
        with pytest.raises(GdfeError, match="yielding joints of arm 'arm'"):
            call()


@pytest.mark.parametrize(
    ("compliance", "expected"),
    [
        ("{lft: {stiffness: 10}}", "arm.compliance.lft (line 8): there is no such joint; did you mean 'lift'?"),
        ("{lift: {stiffness: 0}}", "0 < stiffness, in N m/rad or N/m <= 1e+12"),
        ("{lift: {stiffness: 10, damping: -1}}", "0 <= viscous damping"),
        ("{lift: {damping: 1}}", "arm.compliance.lift.stiffness"),
        ("{lift: {stiffness: .nan}}", "arm.compliance.lift.stiffness"),
    ],
)
def test_wrong_springs_are_explained(yielding: Callable, compliance: str, expected: str) -> None:
    """Unknown joints and impossible numbers are refused with the key, the value and the range."""
    with pytest.raises(SceneError) as caught:
        yielding(compliance)
    assert expected in str(caught.value)


def test_the_relative_policy_is_refused(yielding: Callable) -> None:
    """The policy ``relative`` has no forces that could move a joint."""
    with pytest.raises(SceneError, match=r"cannot take weight, .*compliance of arm"):
        yielding(BOTH, "solver: {policy: relative}\n")


def test_a_swinging_hand_bounces_off_a_wall(yielding: Callable) -> None:
    """A released arm hits a table with its soft hand: each step converges, the joint rebounds, no energy is made."""
    table = "obstacles: {table: {box: {size: [0.03, 0.06, 0.02]}, at: [0.045, 0, -0.032], fixed: true}}\n"
    simulation = yielding("{lift: {stiffness: 400}}, links: []", f"{table}dynamics: {{step: 0.0025}}\n", young=3.0e5)
    arm, angles, energies, pressed = simulation.scene.arms[0], [], [], 0.0
    for _ in range(80):
        result = advance(simulation)
        reading = simulation.joint_states()["lift"]
        q = np.array([reading.position, 0.0])
        angles.append(reading.position - np.pi / 2.0)
        own = arm.dynamics.kinetic_energy(q, np.array([reading.velocity, 0.0]))
        own += arm.dynamics.potential_energy(q, np.array([0.0, 0.0, -9.81])) + 200.0 * angles[-1] ** 2
        energies.append(own + sum(result.energies[name] for name in ("kinetic", "elastic", "potential")))
        pressed = max(pressed, result.contacts["table"].presses.sum(initial=0.0))
    assert pressed > 5.0
    assert max(angles) < 0.043
    assert min(angles[50:]) < 0.5 * max(angles)
    assert max(energies) <= energies[0] + 5e-3 * 200.0 * max(angles) ** 2


def test_a_hand_pressed_on_a_floor_stays_in_balance(yielding: Callable) -> None:
    """A commanded joint presses the hand on a floor with friction and lifts it again: each step converges."""
    floor = "obstacles: {floor: {plane: [0, 0, 1], at: [0, 0, -0.03], friction: 0.5, fixed: true}}\n"
    springs = "{lift: {stiffness: 800, damping: 2}, bend: {stiffness: 50, damping: 0.1}}"
    motion = "dynamics: {scheme: bdf2, step: 0.005, damping: {viscosity: 100}}\n"
    simulation, pressed = yielding(springs, f"{floor}{motion}", young=3.0e5), []
    for number in range(160):
        goal = np.interp(0.005 * number, [0.0, 0.4, 0.7], [np.pi / 2.0, 1.65, 1.5])
        result = advance(simulation, Command(joints={"lift": float(goal)}))
        pressed.append(result.contacts["floor"].presses.sum())
    assert max(pressed) > 10.0


def test_a_following_joint_has_no_spring(held_block: Path) -> None:
    """A spring of a joint that mimics another one is refused with the name of the other joint."""
    urdf = held_block.parent / "two.urdf"
    follows = '<axis xyz="0 1 0"/><mimic joint="lift"/>'.join(urdf.read_text().rsplit('<axis xyz="0 1 0"/>', 1))
    urdf.write_text(follows)
    text = held_block.read_text().rstrip().removesuffix("}")
    held_block.write_text(f"{text}, compliance: {{bend: {{stiffness: 10}}}}}}\n")
    with pytest.raises(SceneError, match="this joint follows 'lift'"):
        load_scene(held_block)
