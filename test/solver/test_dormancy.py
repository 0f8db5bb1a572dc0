# SPDX-License-Identifier: Apache-2.0
"""Frozen parts of a body: elements that the commands do not reach are not solved, until forces reach them."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import numpy as np
import pytest

from benchmarks.brush import Brush
from gdfe_ros import Simulation
from gdfe_ros.actuators import PointLoad, embed
from gdfe_ros.checkpoint import load_state, save_state
from gdfe_ros.materials import Linear
from gdfe_ros.simulation import Command
from gdfe_ros.solver.settings import Skip, SolverSettings
from gdfe_ros.solver.tangent import level

BRUSH = Brush(rows=(4, 2), length=20)
"""Eight bristles, 1728 free vertices."""
AWAKE = SolverSettings(skip=tuple(set(Skip) - {Skip.DORMANT}))
STEPS = 40


@pytest.fixture(scope="module", autouse=True)
def _dear() -> Iterator[None]:
    """Let tangents be too expensive: only bodies without a tangent are frozen in part."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(level, "OPERATIONS", 0)
        yield


def bend(simulation: Simulation, moved: list[int], first: int = 0, last: int = STEPS) -> list[int]:
    """Bend bristles in small steps; return the number of dormant elements in each step."""
    found = []
    for step in range(first + 1, last + 1):
        result = simulation.step(BRUSH.bent(moved, step / STEPS), dt=0.01)
        assert result.converged, result.message
        found.append(result.skipped.get("dormant elements", 0))
    return found


def distance(one: Simulation, other: Simulation) -> float:
    """Return the largest distance between two states' vertices divided by the body's size."""
    return float(np.linalg.norm(one.positions - other.positions, axis=1).max() / one.mesh.size)


@pytest.fixture(scope="module")
def exact() -> Simulation:
    """Return a simulation with a bent bristle, a tolerance a hundred times tighter, and no dormancy."""
    simulation = Simulation(BRUSH.scene(8, settings=dataclasses.replace(AWAKE, tolerance=1e-6)))
    bend(simulation, [0])
    return simulation


def test_what_is_not_reached_is_left_alone(exact: Simulation) -> None:
    """With one of eight bristles moved, in most steps more than 25 % of the elements are dormant; accuracy stays."""
    sleeping, awake = Simulation(BRUSH.scene(8)), Simulation(BRUSH.scene(8, settings=AWAKE))
    skipped = bend(sleeping, [0])
    assert not any(bend(awake, [0]))
    assert np.median(skipped) > 0.25 * sleeping.mesh.n_cells
    assert distance(sleeping, exact) < distance(awake, exact) + 2.0 * sleeping.settings.tolerance
    force, reference = sleeping.result.reactions["tip_0"][:3], exact.result.reactions["tip_0"][:3]
    assert np.linalg.norm(force - reference) < 0.02 * np.linalg.norm(reference)


def test_the_error_is_bounded_while_a_part_sleeps() -> None:
    """The largest error at every third step is at most two tolerances larger with dormancy than without."""
    worst = []
    for settings in (SolverSettings(), AWAKE):
        simulation, errors = Simulation(BRUSH.scene(8, settings=settings)), []
        for step in range(3, 25, 3):
            bend(simulation, [0], step - 3, step)
            near = Simulation(simulation.scene, settings=dataclasses.replace(AWAKE, tolerance=1e-6))
            near.step(BRUSH.bent([0], step / STEPS))
            errors.append(distance(simulation, near))
        worst.append(max(errors))
    assert worst[0] < worst[1] + 2.0 * SolverSettings().tolerance


def test_forces_at_the_border_wake_the_rest() -> None:
    """With a bristle bent twice as far, one to five single steps between dormant ones solve the whole body."""
    skipped = bend(Simulation(BRUSH.scene(8)), [0], last=2 * STEPS)
    asleep = np.flatnonzero(skipped)
    assert asleep[0] < 8
    woken = np.flatnonzero(np.diff(asleep) == 2)
    assert 1 <= len(woken) <= 5


def test_a_handle_wakes_what_it_moves() -> None:
    """Moving another bristle, which is dormant, solves the whole body in that step and bends that bristle."""
    sleeping, awake = Simulation(BRUSH.scene(8)), Simulation(BRUSH.scene(8, settings=AWAKE))
    for simulation in (sleeping, awake):
        last = bend(simulation, [0], last=12)[-1]
        assert bool(last) is (simulation is sleeping)
        assert "dormant elements" not in simulation.step(BRUSH.bent([7], 0.3)).skipped
    assert distance(sleeping, awake) < 2.0 * sleeping.settings.tolerance


def test_a_load_wakes_what_it_pulls() -> None:
    """A load on the palm beside a dormant bristle solves the whole body in that step."""
    plain = BRUSH.scene(8)
    point = embed(plain.mesh, [plain.mesh.bounds[1] * [0.1, 1.0, 1.0]], what="weight")
    load = PointLoad(name="weight", point=point, force=np.array([0.0, 0.0, 2.0]))
    simulation = Simulation(dataclasses.replace(plain, loads=(load,)))
    simulation.step(Command(loads={"weight": 0.0}))
    assert bend(simulation, [0], last=12)[-1] > 0
    assert "dormant elements" not in simulation.step(Command(loads={"weight": 1.0})).skipped


def test_a_saved_state_sleeps_on() -> None:
    """A state saved with a dormant part, once loaded, continues with the same bits."""
    simulation = Simulation(BRUSH.scene(8))
    assert bend(simulation, [0], last=12)[-1] > 0
    data = save_state(simulation)
    bend(simulation, [0], 12, 20)
    first = simulation.positions.copy()
    load_state(simulation, data)
    assert bend(simulation, [0], 12, 20)[0] > 0
    assert np.array_equal(simulation.positions, first)


def test_reset_wakes_everything() -> None:
    """After a reset the next step solves the whole body, and repeats the first step."""
    simulation = Simulation(BRUSH.scene(8))
    bend(simulation, [0], last=12)
    first = simulation.positions.copy()
    simulation.reset()
    assert bend(simulation, [0], last=12)[0] == 0
    assert np.array_equal(simulation.positions, first)


def test_linear_bodies_sleep_as_well() -> None:
    """A linear material, whose forces need no updates between descents, has dormant elements as well."""
    material = Linear(young=1e5, poisson=0.3)
    sleeping = Simulation(BRUSH.scene(8, material=material))
    awake = Simulation(BRUSH.scene(8, material=material, settings=AWAKE))
    assert max(bend(sleeping, [0], last=16)) > 0
    bend(awake, [0], last=16)
    assert distance(sleeping, awake) < 2.0 * sleeping.settings.tolerance


def test_small_bodies_stay_awake() -> None:
    """A body of few vertices is always solved as a whole."""
    small = Brush(rows=(2, 1), palm=2, length=8)
    simulation = Simulation(small.scene(2))
    for step in range(20):
        assert "dormant elements" not in simulation.step(small.bent([0], 0.05 * step)).skipped


def test_a_command_of_nothing_new_is_no_step() -> None:
    """Repeating a command while a part is dormant solves nothing."""
    simulation = Simulation(BRUSH.scene(8))
    bend(simulation, [0], last=12)
    assert simulation.step(Command()).skipped == {"solve": 1}
