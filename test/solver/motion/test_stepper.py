# SPDX-License-Identifier: Apache-2.0
"""Steps in time: their results, the state after a failure, and bodies at rest."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from gdfe_ros import Command, Pose
from gdfe_ros.checkpoint import load_state, save_state
from gdfe_ros.errors import CommandError
from gdfe_ros.mesh.cells.filling import CORNERS
from gdfe_ros.solver.motion.inertia import mass_matrix
from test.written import advance

HELD = {"base": {"where": {"face": "x-"}, "fixed": True}}
WEIGHT = {"weight": {"gravity": [0, 0, -9.81]}}


def test_reactions_contain_inertia(moving: Callable) -> None:
    """The reaction of a shaken base equals the rate of change of the bar's momentum in every step."""
    bar = moving()
    mass = mass_matrix(bar.mesh.vertices, bar.mesh.cells, np.full(bar.mesh.n_cells, 1000.0))
    before, last = np.zeros(3), np.zeros(3)
    for number in range(1, 30):
        z = 0.01 * np.sin(40.0 * 0.002 * number)
        result = bar.step(Command(handles={"base": Pose((0.0, 0.0, float(z)))}))
        momentum = (mass @ result.velocities).sum(axis=0)
        if number > 3:  # a handle that starts at once has a velocity that jumps
            force = 0.5 * (result.reactions["base"][:3] + last)
            assert force == pytest.approx((momentum - before) / 0.002, abs=0.05)
        before, last = momentum, result.reactions["base"][:3].copy()
    assert np.abs(before).max() > 0.0


def test_a_settled_body_is_where_the_equilibrium_is_and_sleeps(moving: Callable) -> None:
    """A damped bar comes to rest at the static equilibrium, and is not solved again until a command changes."""
    damped = {"dynamics__damping": {"viscosity": 3e4}, "dynamics__scheme": "bdf2", "dynamics__step": 0.01}
    bar, still = moving(handles=HELD, loads=WEIGHT, **damped), moving(handles=HELD, loads=WEIGHT, dynamics=None)
    while not bar.settled:
        assert bar.step().converged
        assert bar.time < 20.0
    assert bar.step().skipped == {"solve": 1}
    static = still.step().positions
    assert np.abs(bar.positions - static).max() < 3e-4 * bar.mesh.size
    woken = bar.step(Command(loads={"weight": 0.5}))
    assert woken.iterations > 0
    assert not bar.settled


def test_long_steps_are_cut_into_internal_ones(moving: Callable) -> None:
    """A step of 7 ms gives the same bits as its four internal steps."""
    whole, parts = moving(handles=HELD, loads=WEIGHT), moving(handles=HELD, loads=WEIGHT)
    result = whole.step(dt=0.007)
    assert result.substeps == 4
    advance(parts, dt=0.00175, count=4)
    np.testing.assert_array_equal(whole.positions, parts.positions)
    assert parts.step(dt=0.0).iterations == 0


def test_a_deadline_tells_how_far_it_came(moving: Callable) -> None:
    """A cut step reports the simulated time; a step with the same ``cut_after`` ends at the same positions."""
    cut, again = moving(handles=HELD, loads=WEIGHT), moving(handles=HELD, loads=WEIGHT)
    result = cut.step(dt=0.2, cut_after=7)
    assert not result.converged
    assert 0.0 < result.time == cut.time < 0.2
    assert result.message.startswith(f"simulated {result.time:.6g} of 0.2 s")
    np.testing.assert_array_equal(again.step(dt=0.2, cut_after=7).positions, result.positions)
    assert cut.step(dt=0.002).converged
    assert "0.2 s: interrupted: " in cut.step(dt=0.2, interrupted=lambda: True).message


@pytest.mark.parametrize("queries", [1, 3, 10, 40, 150])
def test_an_interruption_is_repeated(moving: Callable, queries: int) -> None:
    """A step interrupted after some queries, also in an internal step, is repeated by its recorded ``cut_after``."""
    ends = {"base": {"where": {"face": "x-"}}, "tip": {"where": {"face": "x+"}}}
    jerk, left = Command(handles={"tip": Pose((-0.05, 0.0, 0.02))}), iter(range(queries))
    result = moving(handles=ends).step(jerk, dt=0.2, interrupted=lambda: next(left, None) is None)
    again = moving(handles=ends).step(jerk, dt=0.2, cut_after=result.cut_after)
    assert result.cut_after is not None
    assert (again.iterations, again.substeps, again.time) == (result.iterations, result.substeps, result.time)
    np.testing.assert_array_equal(again.positions, result.positions)
    np.testing.assert_array_equal(again.velocities, result.velocities)


def test_a_deadline_makes_no_energy(moving: Callable) -> None:
    """A step whose deadline passes at once makes one internal step, with the same bits as without deadline."""
    hurried, calm = (moving(handles=HELD, loads=WEIGHT) for _ in range(2))
    for _ in range(20):
        result = hurried.step(dt=0.01, deadline=1e-9)
        assert not result.converged
        assert "simulated 0.002 of 0.01 s: the deadline passed" in result.message
        np.testing.assert_array_equal(result.positions, calm.step().positions)


def test_a_step_that_fails_keeps_the_last_sound_state(moving: Callable) -> None:
    """A jerk of the tip by 30 body lengths in one step fails and says so, keeps a sound state, and motion continues.

    A third of that jerk is not enough for the test: with three of eleven roundings its first part succeeds.
    """
    bar = moving(handles={"base": {"where": {"face": "x-"}}, "tip": {"where": {"face": "x+"}}})
    bar.step()
    before = bar.positions.copy()
    result = bar.step(Command(handles={"tip": Pose((-3.0, 0.0, 0.0))}))
    assert not result.converged
    assert "those before it; remedy: slower commands" in result.message
    assert result.min_det > 0.0
    assert result.time < 0.004
    bar.step(Command(handles={"tip": Pose((0.0, 0.0, 0.0))}))
    result = advance(bar, count=200)
    assert np.isfinite(result.positions).all()
    assert np.abs(before).max() < 1.0


def test_a_stuck_body_is_tried_again_only_when_something_changes(moving: Callable) -> None:
    """A failed step is not tried again, here or from a checkpoint, until the step is longer or the command changes."""
    ends = {"base": {"where": {"face": "x-"}}, "tip": {"where": {"face": "x+"}}}
    bar, other = moving(handles=ends), moving(handles=ends)
    bar.step()
    before, jerk = bar.snapshot(), Command(handles={"tip": Pose((-3.0, 0.0, 0.0))})
    tried = bar.step(jerk)
    assert bar.settled
    load_state(other, save_state(bar))
    for stuck in (bar.step(), other.step(), bar.step()):
        assert tried.iterations > stuck.iterations == stuck.substeps == 0
        assert stuck.skipped == {"solve": 1}
        assert stuck.message == tried.message
        assert (stuck.converged, stuck.error_estimate) == (False, np.inf)
        np.testing.assert_array_equal(stuck.positions, tried.positions)
    assert bar.settled
    assert bar.step(dt=0.004).substeps > 0
    assert bar.step(Command(handles={"tip": Pose()})).substeps > 0
    for place in range(0, 400, 10):  # what a deadline cut short was not tried to its end
        bar.restore(before)
        cut = bar.step(jerk, dt=0.002, cut_after=place).cut_after is not None
        assert bar.settled != cut


@pytest.mark.parametrize("scheme", ["bdf2", "newmark", "generalised_alpha"])
@pytest.mark.parametrize("shape", ["mirrored", "crumpled"])
def test_positions_inside_out_end_finite_and_are_told(moving: Callable, scheme: str, shape: str) -> None:
    """From inverted elements, steps end finite; a failure says why and is not tried again, and a reset helps."""
    bar = moving(handles=HELD, dynamics__scheme=scheme)
    given = bar.mesh.vertices * [1.0, -1.0, 1.0]
    if shape == "crumpled":
        given = bar.mesh.vertices + np.random.default_rng(0).normal(scale=0.01, size=given.shape)
    bar.set_positions(given)
    results = [bar.step() for _ in range(5)]
    for result in results:
        assert np.isfinite(result.positions).all()
        assert np.isfinite(result.velocities).all()
        assert result.converged == (result.min_det > 0.0) == (result.message == "")
    if not results[-1].converged:
        assert "where elements are inside out already" in results[-1].message
        assert results[-1].iterations == 0
    bar.reset()
    assert bar.step().converged


def test_given_positions_start_without_velocity(moving: Callable) -> None:
    """A bar released from a bent shape starts without velocity and swings back through its undeformed shape."""
    bar = moving(handles=HELD)
    bent = bar.mesh.vertices.copy()
    bent[:, 2] += 0.02 * (bent[:, 0] / 0.1) ** 2
    bar.set_positions(bent)
    heights = [bar.step().positions[-1, 2]]
    assert heights[0] > 0.0099 + CORNERS[-1, 2] * 0.01
    while len(heights) < 60 and heights[-1] >= 0.01:
        heights.append(bar.step().positions[-1, 2])
    assert heights[-1] < 0.01


@pytest.mark.parametrize("short", [1e-17, 1e-9, 1e-6])
def test_a_step_too_short_is_made_up_for_by_the_next(moving: Callable, short: float) -> None:
    """Very short steps between those of a swing add their time, and the swing continues as without them."""
    plain, nudged = moving(handles=HELD, loads=WEIGHT), moving(handles=HELD, loads=WEIGHT)
    for _ in range(20):
        advance(nudged, dt=short, count=5)
        one, two = plain.step(dt=0.002), nudged.step(dt=0.002)
    assert two.time == pytest.approx(one.time + 100 * short, rel=1e-12)
    assert two.converged
    assert np.abs(one.positions - two.positions).max() < 1e-3 * plain.mesh.size
    balance = two.energies["kinetic"] + two.energies["elastic"] + two.energies["potential"]
    assert abs(balance) < 0.01 * two.energies["kinetic"]


def test_a_snapshot_of_another_scene_is_refused(moving: Callable) -> None:
    """A snapshot of another body, of the body without dynamics, or with another modulus is refused."""
    bar = moving(handles=HELD)
    with pytest.raises(CommandError, match="one of another scene: its vertices are"):
        bar.restore(moving(handles=HELD, mesh__bar__cells=[4, 1, 1]).snapshot())
    with pytest.raises(CommandError, match="its terms are"):
        bar.restore(moving(handles=HELD, dynamics=None).snapshot())
    with pytest.raises(CommandError, match="one of another scene than"):
        bar.restore(moving(handles=HELD, materials__rubber__young=2.0e6).snapshot())


@pytest.mark.parametrize(("cable", "told"), [({}, True), ({"stiffness": 1e4}, False), ({"command": "tension"}, False)])
def test_what_newmark_has_ring_is_remarked(moving: Callable, cable: dict, told: bool) -> None:
    """A cable that holds a length without a stiffness gives a remark with a remedy, by newmark only."""
    points = [[0.0, 0.0, 0.008], [0.05, 0.0, 0.008], [0.09, 0.0, 0.008]]
    actuators = {"pull": {"cable": {"points": points, "command": "shortening", **cable}}}
    rings = "newmark does not damp the force that holds the commanded length or volume of pull"
    assert any(rings in text for text in moving(actuators=actuators).remarks()) is told
    assert moving(actuators=actuators, dynamics__scheme="bdf2").remarks() == []
