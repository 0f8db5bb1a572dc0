# SPDX-License-Identifier: Apache-2.0
"""Simulations: commands in, results out, one deterministic state."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gdfe_ros.constraints import Pose, nearest_turn
from gdfe_ros.errors import CommandError
from gdfe_ros.results.step_result import StepResult
from gdfe_ros.scene import load_scene, scene_from_text
from gdfe_ros.simulation import Command, Simulation
from gdfe_ros.simulation_parts.steppers import RELATIVE_STEPS
from gdfe_ros.solver.settings import Policy, SolverSettings, Torsion
from test.written import advance, scene_of

SCENE = """\
name: small
mesh:
  bar: {size: [0.2, 0.05, 0.05], cells: [8, 2, 2]}
materials:
  hard: {law: neo_hookean, young: 2.0e5, poisson: 0.45}
  soft: {law: neo_hookean, young: 1.0e5, poisson: 0.45}
regions:
  - {material: hard}
  - {material: soft, where: {box: {x: [0.1, 0.2]}}}
handles:
  base: {where: {face: x-}, fixed: true}
  tip: {where: {face: x+}, free: [x]}
program:
  duration: 2.0
  handles:
    tip:
      - {time: 0.0}
      - {time: 1.0, translation: [0, 0, 0.04]}
      - {time: 2.0, translation: [0, 0, 0.04], rotation_deg: [90, 0, 0]}
solver: {policy: energy, tolerance: 1.0e-5}
"""
MakeSimulation = Callable[..., Simulation]


@pytest.fixture
def simulate() -> MakeSimulation:
    """Return a function that simulates a small bar; keywords override scene keys, double underscores stand for dots."""

    def make(*, settings: SolverSettings | None = None, **overrides: object) -> Simulation:
        return Simulation(scene_of(SCENE, **overrides), settings=settings)

    return make


def tip(x: float = 0.0, y: float = 0.0, z: float = 0.0, *, turn: tuple[float, float, float] = (0, 0, 0)) -> Command:
    """Return a command of the tip's pose; ``turn`` is a rotation vector in degrees."""
    return Command(handles={"tip": Pose((x, y, z), tuple(np.deg2rad(turn)))})


def same(first: StepResult, second: StepResult) -> bool:
    """Return whether two results have bitwise equal positions."""
    return bool(np.array_equal(first.positions, second.positions))


# --- commands ---


@pytest.mark.exact("it compares with the vertices of the mesh to the bit")
def test_a_command_moves_the_handle_and_the_body_follows(simulate: MakeSimulation) -> None:
    """A lifted tip is at its target, the base stays, and the middle is between."""
    simulation = simulate()
    result = advance(simulation, tip(z=0.04), dt=0.1)
    rest = simulation.mesh.vertices
    rise = (result.positions - rest)[:, 2]
    np.testing.assert_allclose(rise[rest[:, 0] == 0.2], 0.04, atol=1e-15)
    np.testing.assert_array_equal(rise[rest[:, 0] == 0.0], 0.0)
    assert 0.01 < rise[rest[:, 0] == 0.1].mean() < 0.03
    np.testing.assert_array_equal(simulation.positions, result.positions)


def test_time_advances_by_dt(simulate: MakeSimulation) -> None:
    """With and without commands, the time is the sum of all dt."""
    simulation = simulate()
    times = [simulation.step(command, dt=dt).time for command, dt in ((tip(z=0.01), 0.1), (None, 0.25), (None, 0.0))]
    np.testing.assert_allclose(times, [0.1, 0.35, 0.35])
    assert simulation.time == times[-1]


def test_targets_stay_until_commanded_again(simulate: MakeSimulation) -> None:
    """The last target is kept in a step without a command or without that handle."""
    simulation = simulate()
    simulation.step(tip(z=0.02))
    assert simulation.targets == {"base": Pose(), "tip": Pose((0.0, 0.0, 0.02))}
    simulation.step(Command())
    assert simulation.targets["tip"] == Pose((0.0, 0.0, 0.02))


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("nose", r"no handle 'nose' in scene 'small'; handles: base, tip"),
        ("base", r"'base' is fixed .*takes no commands; remedy: put handles.base.fixed=false"),
    ],
)
def test_impossible_commands_change_nothing(simulate: MakeSimulation, name: str, message: str) -> None:
    """A command of an unknown or fixed handle beside a valid one is refused, and state, time and targets stay."""
    simulation = simulate()
    simulation.step(tip(z=0.02), dt=0.1)
    before = simulation.positions.copy(), simulation.time, dict(simulation.targets), simulation.result
    command = Command(handles={"tip": Pose((0.0, 0.0, 0.03)), name: Pose((0.0, 0.0, 0.01))})
    with pytest.raises(CommandError, match=message):
        simulation.step(command, dt=0.1)
    np.testing.assert_array_equal(simulation.positions, before[0])
    assert (simulation.time, simulation.targets, simulation.result) == before[1:]
    assert simulation.step(tip(z=0.03), dt=0.1).converged


@pytest.mark.parametrize("far", [1e3, 1e30, 1e200])
def test_absurd_commands_leave_a_usable_state(simulate: MakeSimulation, far: float) -> None:
    """A pose light years away is refused, or ends finite and not converged; after a reset the simulation works."""
    simulation = simulate(settings=SolverSettings(max_iterations=200))
    try:
        result = simulation.step(tip(z=far))
    except CommandError as error:
        assert "tip" in str(error)  # noqa: PT017 - either answer is sound
    else:
        assert not result.converged
        assert result.message
        assert np.isfinite(result.positions).all()
    simulation.reset()
    assert simulation.step(tip(z=0.02)).converged


# --- results ---


def test_results_say_what_was_done(simulate: MakeSimulation) -> None:
    """A result has every number that a user needs to judge it."""
    result = simulate().step(tip(z=0.04), dt=0.1)
    assert result.converged is True  # records are JSON, which has no bool of NumPy
    assert result.message == ""
    assert 0.0 <= result.error_estimate <= 1e-5
    assert result.iterations > 0
    assert result.substeps == 1
    assert result.energy > 0.0
    assert 0.5 < result.min_det <= 1.1
    assert result.wall_time > 0.0
    assert result.policy is Policy.ENERGY
    assert {name: value.shape for name, value in result.reactions.items()} == {"base": (6,), "tip": (6,)}


def test_results_are_snapshots(simulate: MakeSimulation) -> None:
    """A kept result does not change in later steps."""
    simulation = simulate()
    first = simulation.step(tip(z=0.02))
    kept = first.positions.copy(), {name: value.copy() for name, value in first.reactions.items()}
    simulation.step(tip(z=0.04))
    np.testing.assert_array_equal(first.positions, kept[0])
    for name, value in first.reactions.items():
        np.testing.assert_array_equal(value, kept[1][name])


def test_a_snapshot_is_solved_on_to_a_smaller_tolerance(simulate: MakeSimulation) -> None:
    """An equilibrium with tolerance 1e-3, restored where 1e-11 is set, is not settled; the next step reaches 1e-11."""
    rough, fine = simulate(solver__tolerance=1e-3), simulate(settings=SolverSettings(tolerance=1e-11))
    rough.step(tip(z=0.02))
    given = replace(rough.snapshot(), scene=fine.snapshot().scene)
    fine.restore(given)
    assert not fine.settled
    result = advance(fine)
    assert result.error_estimate <= 1e-11


@pytest.mark.parametrize("other", [{"policy": Policy.RELATIVE}, {"torsion": Torsion.SECTION}], ids=str)
def test_a_snapshot_of_another_method_is_refused(simulate: MakeSimulation, other: dict) -> None:
    """A snapshot of another policy or torsion is refused, since its equilibria are different."""
    one, two = simulate(), simulate(settings=SolverSettings(tolerance=1e-5, **other))
    one.step(tip(z=0.02))
    with pytest.raises(CommandError, match="policy or torsion; remedy"):
        two.restore(replace(one.snapshot()))
    assert two.time == 0.0


def test_time_is_kept_in_double_precision(simulate: MakeSimulation) -> None:
    """Time steps in single precision are summed in double precision."""
    simulation = simulate()
    advance(simulation, dt=np.float32(0.1), count=3)
    assert type(simulation.time) is float
    assert simulation.time == pytest.approx(3 * float(np.float32(0.1)), abs=1e-15)


def test_reactions_are_in_newtons_and_balance(simulate: MakeSimulation) -> None:
    """For a lifted tip, reactions are up at the tip, down at the base, zero along the free axis, and in balance."""
    simulation = simulate(solver__tolerance=1e-8)
    result = simulation.step(tip(z=0.02))
    up, down = result.reactions["tip"], result.reactions["base"]
    assert up[2] > 0.0 > down[2]
    scale = abs(up[2])
    np.testing.assert_allclose(up[:3] + down[:3], 0.0, atol=1e-4 * scale)
    assert abs(up[0]) < 1e-4 * scale
    centres = [simulation.positions[simulation.mesh.vertices[:, 0] == x].mean(axis=0) for x in (0.2, 0.0)]
    moments = [r[3:] + np.cross(c, r[:3]) for r, c in zip((up, down), centres, strict=True)]
    np.testing.assert_allclose(sum(moments), 0.0, atol=1e-4 * scale * 0.2)


@pytest.mark.parametrize("law", ["linear", "neo_hookean"])
def test_work_of_the_handle_is_the_energy_stored(simulate: MakeSimulation, law: str) -> None:
    """In forty steps of lifting, force times displacement sums to the strain energy within half a percent.

    The linear law has this accuracy on any mesh. For other laws the hourglass stiffness follows the tangent modulus.
    This costs 1 % of the energy with two elements over the thickness; `test_hourglass.py` has a larger deformation.
    """
    soft, hard = (f"{{law: {law}, young: {young}, poisson: 0.45}}" for young in ("1.0e5", "2.0e5"))
    simulation = simulate(
        solver__tolerance=1e-7, materials__soft=soft, materials__hard=hard, mesh__bar__cells=[16, 4, 4]
    )
    forces = [0.0]
    for lift in np.linspace(0.0, 0.06, 41)[1:]:
        result = simulation.step(tip(z=float(lift)))
        forces.append(result.reactions["tip"][2])
    assert np.trapezoid(forces, dx=0.06 / 40) == pytest.approx(result.energy, rel=5e-3)


def test_fields_are_those_of_the_present_state(simulate: MakeSimulation) -> None:
    """After a step the fields have one value per element, strains, and a shape factor of 1 in the stiffest element."""
    simulation = simulate()
    rest = simulation.fields()
    np.testing.assert_allclose(rest.eps_eq, 0.0, atol=1e-7)
    result = simulation.step(tip(z=0.04))
    fields = simulation.fields()
    assert fields.eps_eq.shape == (32,)
    assert fields.eps_eq.max() > 0.01
    assert fields.J.min() >= result.min_det > 0.8, "a corner gives more than the mean"
    assert fields.omega.max() == 1.0
    volume = 0.2 * 0.05 * 0.05 / 32
    assert fields.energy_density.sum() * volume == pytest.approx(result.energy, rel=1e-3)


@pytest.mark.exact("it compares with the vertices of the mesh to the bit")
def test_sliding_handles_report_where_they_are(simulate: MakeSimulation) -> None:
    """A tip that slides along x has the commanded z and rotation in its pose, and the x of the equilibrium."""
    simulation = simulate()
    simulation.step(tip(z=0.06, turn=(30, 0, 0)))
    pose = simulation.handle_pose("tip")
    assert pose.translation[2] == pytest.approx(0.06, abs=1e-15)
    assert -0.03 < pose.translation[0] < -0.001
    assert pose.rotation == pytest.approx(np.deg2rad([30.0, 0.0, 0.0]))
    assert simulation.handle_pose("base") == Pose()
    with pytest.raises(CommandError, match="no handle 'nose'"):
        simulation.handle_pose("nose")


# --- what is skipped, cut short or cut up ---


def test_an_idle_step_is_skipped(simulate: MakeSimulation) -> None:
    """A step without a new target is not solved and has the same state; a new target is solved."""
    simulation = simulate()
    first = simulation.step(tip(z=0.02), dt=0.1)
    idle = simulation.step(tip(z=0.02), dt=0.1)
    assert idle.skipped == {"solve": 1}
    assert (idle.iterations, idle.converged) == (0, True)
    assert idle.time == pytest.approx(0.2)
    assert same(idle, first)
    assert simulation.step(None, dt=0.1).skipped == {"solve": 1}
    moved = simulation.step(tip(z=0.03), dt=0.1)
    assert "solve" not in moved.skipped
    assert moved.iterations > 0


def test_an_unfinished_step_is_not_skipped(simulate: MakeSimulation) -> None:
    """An unfinished step says why, with an unknown error; steps without a command continue until convergence."""
    simulation = simulate(solver__max_iterations=8)
    results = [simulation.step(tip(z=0.04))]
    assert (results[0].converged, results[0].iterations, results[0].error_estimate) == (False, 8, np.inf)
    assert "stopped after 8 iterations" in results[0].message
    assert "not known" in results[0].message
    assert np.isfinite(results[0].positions).all()
    while not results[-1].converged:
        results.append(simulation.step())
        assert len(results) < 40
    exact = simulate().step(tip(z=0.04))
    np.testing.assert_allclose(results[-1].positions, exact.positions, atol=2e-5 * simulation.mesh.size)


@pytest.mark.parametrize("policy", list(Policy))
def test_a_deadline_returns_a_finite_state_that_goes_on_later(simulate: MakeSimulation, policy: Policy) -> None:
    """A step with a deadline of zero ends finite and unconverged, with a reason; the next step reaches the target."""
    simulation = simulate(solver__policy=policy.value)
    hurried = simulation.step(tip(z=0.04), dt=0.1, deadline=0.0)
    assert not hurried.converged
    assert np.isfinite(hurried.positions).all()
    assert hurried.error_estimate > 1e-5
    assert "the deadline passed" in hurried.message
    assert hurried.iterations <= 30
    assert hurried.time == pytest.approx(0.1)
    result = advance(simulation)
    exact = simulate(solver__policy=policy.value).step(tip(z=0.04))
    np.testing.assert_allclose(result.positions, exact.positions, atol=2e-5 * simulation.mesh.size)


def test_a_generous_deadline_changes_nothing(simulate: MakeSimulation) -> None:
    """A deadline of a minute gives the same bits as no deadline."""
    assert same(simulate().step(tip(z=0.04), deadline=60.0), simulate().step(tip(z=0.04)))


@pytest.mark.parametrize(("degrees", "substeps"), [(90, 1), (180, 2), (360, 4), (-360, 4)])
def test_large_turns_are_cut_into_substeps(simulate: MakeSimulation, degrees: float, substeps: int) -> None:
    """A tip turned by up to a whole turn in one step is twisted by that angle, not by the shorter rotation."""
    simulation = simulate()
    result = advance(simulation, tip(turn=(degrees, 0, 0)))
    assert result.substeps == substeps
    quarter = simulate().step(tip(turn=(90, 0, 0))).energy
    assert result.energy / quarter == pytest.approx((degrees / 90.0) ** 2, rel=0.15)
    torque = result.reactions["tip"][3]
    assert np.sign(torque) == np.sign(degrees)


def test_a_turn_past_buckling_is_said(simulate: MakeSimulation) -> None:
    """A short bar turned by one and a half turns leaves the straight shape, and the step says that it jumped."""
    result = simulate().step(tip(turn=(540, 0, 0)))
    assert not result.converged
    assert "jumped to another equilibrium" in result.message
    assert np.isfinite(result.positions).all()


def test_a_full_turn_of_the_papers_bar_is_not_undone() -> None:
    """twist90's tip turned by 360 degrees stays twisted or reports a failure; it does not unwind."""
    scene = load_scene("twist90", overrides={"program.handles.tip.1.rotation_deg": [360, 0, 0]})
    result = list(Simulation(scene).play())[-1]
    quarter = list(Simulation(load_scene("twist90")).play())[-1]
    assert not result.converged or result.energy > 10.0 * quarter.energy


# --- programs ---


def test_a_program_is_played_keyframe_by_keyframe(simulate: MakeSimulation) -> None:
    """With the energy policy, a program is played with one step for each keyframe, and reaches its end."""
    simulation = simulate()
    results = list(simulation.play())
    assert [result.time for result in results] == [1.0, 2.0]
    assert simulation.targets["tip"] == Pose((0.0, 0.0, 0.04), (np.pi / 2.0, 0.0, 0.0))
    assert all(result.converged for result in results)


def test_a_program_is_played_in_as_many_steps_as_wanted(simulate: MakeSimulation) -> None:
    """A program played in five steps, set by argument or by the scene, has equal time steps and the same final bits."""
    by_argument = list(simulate().play(5))
    by_scene = list(simulate(solver__steps=5).play())
    np.testing.assert_allclose([result.time for result in by_argument], [0.4, 0.8, 1.2, 1.6, 2.0])
    assert same(by_argument[-1], by_scene[-1])


def test_the_relative_policy_takes_twenty_steps(simulate: MakeSimulation) -> None:
    """With the relative policy a program is played in twenty steps, and all converge."""
    results = list(simulate(solver__policy="relative").play())
    assert len(results) == RELATIVE_STEPS == 20
    assert all(result.converged for result in results)


def test_a_program_is_played_from_the_present_time_on(simulate: MakeSimulation) -> None:
    """Steps that end before the present time are left out; a program that has ended is not played."""
    simulation = simulate()
    duration = simulation.scene.program.duration
    simulation.step(dt=0.5 * duration)
    assert [result.time / duration for result in simulation.play(4)] == pytest.approx([0.75, 1.0])
    with pytest.raises(CommandError, match=r"has ended at .* s; remedy"):
        next(simulation.play(4))


@pytest.mark.parametrize("steps", [0, -3, 2.5, "a"])
def test_a_number_of_steps_that_is_none_is_refused(simulate: MakeSimulation, steps: object) -> None:
    """A number of steps must be a whole number from 1 on."""
    with pytest.raises(CommandError, match="allowed: whole numbers from 1 on"):
        next(simulate().play(steps))


def test_a_scene_without_a_program_cannot_be_played() -> None:
    """Playing a scene without a program raises an error with the missing key."""
    text = SCENE[: SCENE.index("program:")] + SCENE[SCENE.index("solver:") :]
    with pytest.raises(CommandError, match=r"'small' has no program to play; add the key 'program'"):
        next(Simulation(scene_from_text(text)).play())


def test_settings_may_replace_the_scenes(simulate: MakeSimulation) -> None:
    """Settings given to the simulation replace the scene's."""
    simulation = simulate(settings=SolverSettings(policy=Policy.RELATIVE, tolerance=1e-3))
    assert simulation.policy is Policy.RELATIVE
    assert simulation.step(tip(z=0.01)).policy is Policy.RELATIVE


# --- turns beyond half a turn, from quaternions ---


def quaternion(vector: tuple[float, float, float]) -> np.ndarray:
    """Return the quaternion (x, y, z, w) of a rotation vector in degrees."""
    return Rotation.from_rotvec(np.deg2rad(vector)).as_quat()


@pytest.mark.parametrize(
    ("reference", "turn", "expected"),
    [
        ((355, 0, 0), (0, 0, 0), (360, 0, 0)),
        ((0, 355, 0), (0, 0, 0), (0, 360, 0)),
        ((0, 0, -725), (0, 0, 0), (0, 0, -720)),
        ((0, 360, 0), (0, 0, 0), (0, 360, 0)),
        ((0, 0, 720), (0, 0, 0), (0, 0, 720)),
    ],
)
def test_nearest_turn_goes_on_from_where_the_handle_is(
    reference: tuple[float, float, float], turn: tuple[float, float, float], expected: tuple[float, float, float]
) -> None:
    """No rotation, past 355 and 720 degrees, is a number of whole turns about the axis of the last pose."""
    found = nearest_turn(quaternion(turn), Pose(rotation=tuple(np.deg2rad(reference))))
    np.testing.assert_allclose(np.rad2deg(found), expected, atol=1e-6)


def test_nearest_turn_is_the_nearest_of_all() -> None:
    """For random quaternions of both signs, no other vector of the rotation is nearer to the pose."""
    random = np.random.default_rng(0)
    for _ in range(200):
        reference, turn = random.uniform(-14.0, 14.0, 3), Rotation.random(random_state=random.integers(1 << 30))
        vector = turn.as_rotvec()
        angle = np.linalg.norm(vector)
        candidates = [(angle + 2.0 * np.pi * k) * vector / angle for k in range(-6, 7)]
        found = nearest_turn(turn.as_quat(), Pose(rotation=tuple(reference)))
        best = min(candidates, key=lambda candidate: np.linalg.norm(candidate - reference))
        np.testing.assert_allclose(found, best, atol=1e-9)
        np.testing.assert_allclose(nearest_turn(-turn.as_quat(), Pose(rotation=tuple(reference))), found, atol=1e-9)
