# SPDX-License-Identifier: Apache-2.0
"""The inverse of the initial matrix between the rows that contacts need: it is what solutions with unit loads give."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from gdfe_ros import Command, Simulation
from gdfe_ros.scene import scene_from_text
from gdfe_ros.solver.contact.kept_columns import ConstantColumns, HalvedColumns
from gdfe_ros.solver.matrix.constant_matrix import apply_inverse
from gdfe_ros.solver.matrix.substitution import Kept, solve_unturned

SCENE = """
name: strip
mesh: {bar: {size: [0.1, 0.02, 0.02], cells: [10, 4, 4]}}
materials: {m: {law: neo_hookean, young: 1.0e6, poisson: 0.45}}
regions: [{material: m}]
handles: {base: {where: {face: x-}, fixed: true}TIP}
actuators:
  wire: {cable: {points: [[0, 0, 0.008], [0.05, 0, 0.008], [0.1, 0, 0.008]], command: shortening}}
"""
TIPS = {
    "clamped once": "",
    "a handle that slides and turns": ", tip: {where: {face: x+}, free: [x, z, ry]}",
    "a roller": ", floor: {where: {face: z-}, slide: [x, y]}",
}


def moved(tip: str) -> Simulation:
    """Return a strip that has been pulled by its cable, so that a tangent is kept."""
    simulation = Simulation(scene_from_text(SCENE.replace("TIP", tip)))
    assert simulation.step(Command(actuators={"wire": 5e-4})).converged
    return simulation


def kept_of(simulation: Simulation) -> Kept:
    """Return the kept factor of a simulation's tangent."""
    return simulation.stepper.equilibrium.model.minimiser.level.kept


def rows_of(count: int, total: int) -> NDArray[np.int64]:
    """Return some free rows, and all rigid rows."""
    return np.concatenate([np.random.default_rng(0).permutation(count)[:60], np.arange(count, total)])


@pytest.mark.parametrize("tip", TIPS.values(), ids=TIPS)
def test_the_tangents_inverse_is_that_of_solutions(tip: str) -> None:
    """Between free and rigid rows, with the cable's spring, each column is the solution for a unit load."""
    kept = kept_of(moved(tip))
    count = len(kept.order)
    rows = np.sort(rows_of(count, count + len(kept.schur) // 3))
    columns = HalvedColumns(kept)
    columns.include(rows)
    found, entries = columns.between(rows), (3 * rows[:, None] + np.arange(3)).ravel()
    assert len(kept.springs) == 1
    for place in range(0, len(entries), 7):
        unit, solved = np.zeros(3 * count + len(kept.schur)), np.empty(3 * count + len(kept.schur))
        unit[entries[place]] = 1.0
        solve_unturned(kept, unit, solved)
        expected = solved[entries]
        np.testing.assert_allclose(found[:, place], expected, rtol=0, atol=1e-12 * np.abs(found).max())


def test_the_order_of_questions_changes_no_bit() -> None:
    """Rows asked for at once, one by one, and from the last to the first give the same bits."""
    kept = kept_of(moved(TIPS["a handle that slides and turns"]))
    rows = rows_of(len(kept.order), len(kept.order) + len(kept.schur) // 3)
    parts = {
        "at once": [rows],
        "one by one": rows[:, None],
        "in reverse": rows[::-1, None],
        "by ten": rows[:50].reshape(5, 10),
    }
    found = []
    for order in parts.values():
        columns = HalvedColumns(kept)
        for part in order:
            columns.include(part)
        columns.include(rows)
        found.append(columns.between(np.sort(rows)))
    for other in found[1:]:
        np.testing.assert_array_equal(other, found[0])
    np.testing.assert_array_equal(found[0], found[0].T)


@pytest.mark.parametrize("tip", TIPS.values(), ids=TIPS)
def test_the_constant_matrix_inverse_is_that_of_solutions(tip: str) -> None:
    """One solution finds the columns of three rows; with rigid rows, they are those of unit loads."""
    simulation = moved(tip)
    coupling = simulation.stepper.equilibrium.matrix.coupling
    count, rigid = len(simulation.stepper.equilibrium.body.unknowns.free), len(coupling.inverse_schur) // 3
    rows = np.sort(rows_of(count, count + rigid))
    columns = ConstantColumns(coupling, rows[rows < count], count)
    columns.include(rows[::2])
    columns.include(rows)
    found, entries = columns.between(rows), (3 * rows[:, None] + np.arange(3)).ravel()
    for place in range(0, len(entries), 7):
        unit, solved = np.zeros(3 * (count + rigid)), np.zeros(3 * (count + rigid))
        unit[entries[place]] = 1.0
        unit[coupling.fixed] = 0.0  # no load acts on a component that a roller holds
        apply_inverse(unit, coupling, solved)
        atol = 1e-6 * np.abs(found).max()  # the factor is kept in single precision
        np.testing.assert_allclose(found[:, place], solved[entries], rtol=0, atol=atol)
