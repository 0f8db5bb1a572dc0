# SPDX-License-Identifier: Apache-2.0
"""Work that a scene does not need is skipped, counted by name, and gives the same result when it is done."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from gdfe_ros import Command, Pose, Simulation
from gdfe_ros.constraints import Handle
from gdfe_ros.materials import Linear, Material, NeoHookean
from gdfe_ros.mesh import bar
from gdfe_ros.results.step_result import StepResult
from gdfe_ros.scene.scene import Scene
from gdfe_ros.solver.settings import Policy, Skip, SolverSettings
from test.written import advance

MESH = bar([0.3, 0.1, 0.1], [9, 3, 3])
"""A mesh of 81 elements; its last two layers, 18 elements, lie inside the tip's handle."""
HYPERELASTIC = NeoHookean(young=1e5, poisson=0.495)


def without(*skips: Skip) -> SolverSettings:
    """Return settings without the given skips, so that this work is always done."""
    return SolverSettings(skip=tuple(set(Skip) - set(skips)))


def scene(material: Material, settings: SolverSettings) -> Scene:
    """Return a bar held at one end, with a thick handle at the other."""
    x = MESH.vertices[:, 0]
    base = Handle("base", np.flatnonzero(x < 1e-9).astype(np.int32), fixed=True)
    tip = Handle("tip", np.flatnonzero(x > 0.3 - 2.5 * 0.3 / 9).astype(np.int32))
    return Scene(
        name="skipping",
        mesh=MESH,
        materials={"one": material},
        cell_material=np.zeros(MESH.n_cells, np.int32),
        handles=(base, tip),
        solver=settings,
    )


def lifted(material: Material, settings: SolverSettings) -> tuple[Simulation, StepResult]:
    """Lift and turn the handle in two steps; return the simulation and the last result."""
    simulation = Simulation(scene(material, settings))
    simulation.step(Command(handles={"tip": Pose(translation=(0.0, 0.0, 0.02))}))
    result = advance(
        simulation, Command(handles={"tip": Pose(translation=(0.0, 0.0, 0.04), rotation=(0.0, -0.3, 0.0))})
    )
    return simulation, result


def test_elements_inside_a_handle_are_left_out() -> None:
    """Eighteen elements that a handle moves rigidly are not evaluated, and results stay the same."""
    simulation, result = lifted(HYPERELASTIC, SolverSettings())
    busy, full = lifted(HYPERELASTIC, without(Skip.HANDLES))
    assert result.skipped["elements inside handles"] == 18
    assert "elements inside handles" not in full.skipped
    np.testing.assert_allclose(result.positions, full.positions, atol=1e-9 * MESH.size)
    np.testing.assert_allclose(result.reactions["tip"], full.reactions["tip"], rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(simulation.fields().eps_eq, busy.fields().eps_eq, atol=1e-6)
    assert result.energy == pytest.approx(full.energy, rel=1e-9)


def test_two_handles_in_one_element_are_not_one() -> None:
    """The elements between two handles deform and are evaluated."""
    plain = scene(HYPERELASTIC, SolverSettings())
    x, tip = MESH.vertices[:, 0], plain.handles[1].vertices
    end = x[tip] > 0.3 - 1e-9
    halves = Handle("inner", tip[~end]), Handle("outer", tip[end])
    simulation = Simulation(dataclasses.replace(plain, handles=(plain.handles[0], *halves)))
    result = simulation.step(Command(handles={"outer": Pose(translation=(0.005, 0.0, 0.0))}))
    assert result.skipped["elements inside handles"] == 9
    assert result.reactions["outer"][0] > 1.0


@pytest.mark.parametrize(
    ("skip", "material", "count"),
    [
        (Skip.SHAPE_FACTORS, Linear(young=1e5, poisson=0.495), 63),
        (Skip.PRESSURES, NeoHookean(young=1e5, poisson=0.3), 63),
    ],
)
def test_updates_that_change_nothing_are_left_out(skip: Skip, material: Material, count: int) -> None:
    """A linear law skips shape factor updates, a moderate nu pressure updates; positions stay within a tolerance."""
    _, result = lifted(material, SolverSettings())
    _, full = lifted(material, without(skip))
    assert result.skipped[skip.value] == count
    assert skip.value not in full.skipped
    np.testing.assert_allclose(result.positions, full.positions, atol=SolverSettings().tolerance * MESH.size)


@pytest.mark.parametrize("policy", list(Policy))
def test_nothing_new_is_not_solved(policy: Policy) -> None:
    """A repeated command is skipped without an iteration; with that skip switched off, its solve hardly moves the body.

    With the policy ``relative`` it moves, since each solve captures new shapes.
    """
    material = Linear(young=1e5, poisson=0.3)
    for skip in (True, False):
        settings = SolverSettings(policy=policy, skip=tuple(Skip) if skip else ())
        simulation, result = lifted(material, settings)
        again = simulation.step()
        assert (again.skipped == {"solve": 1}) is skip
        moved = np.abs(again.positions - result.positions).max()
        assert moved <= 2.0 * settings.tolerance * MESH.size or (policy is Policy.RELATIVE and not skip)
        woken = simulation.step(Command(handles={"tip": Pose(translation=(0.0, 0.0, 0.01))}))
        assert "solve" not in woken.skipped
        assert woken.iterations > 0


def test_an_unknown_skip_is_refused() -> None:
    """An unknown name in ``skip`` is refused."""
    with pytest.raises(ValueError, match="tea"):
        SolverSettings(skip=("tea",))
