# SPDX-License-Identifier: Apache-2.0
"""The inverse of the initial matrix between the rows that contacts need: it is what solutions with unit loads give."""

from __future__ import annotations

import numpy as np
import pytest

from gdfe_ros import Command
from gdfe_ros.solver.contact.kept_columns import HalvedColumns
from gdfe_ros.solver.matrix.substitution import solve_unturned
from test.written import advance, simulate

SCENE = """
mesh: {bar: {size: [0.1, 0.02, 0.02], cells: [10, 4, 4]}}
materials: {m: {law: neo_hookean, young: 1.0e6, poisson: 0.45}}
handles: {base: {where: {face: x-}, fixed: true}TIP}
actuators:
  wire: {cable: {points: [[0, 0, 0.008], [0.05, 0, 0.008], [0.1, 0, 0.008]], command: shortening}}
"""
TIPS = {
    "clamped once": "",
    "a handle that slides and turns": ", tip: {where: {face: x+}, free: [x, z, ry]}",
    "a roller": ", floor: {where: {face: z-}, slide: [x, y]}",
}


@pytest.mark.parametrize("tip", TIPS.values(), ids=TIPS)
def test_the_tangents_inverse_is_that_of_solutions(tip: str) -> None:
    """Between free and rigid rows, with the cable's spring, each column is the solution for a unit load."""
    simulation = simulate(SCENE.replace("TIP", tip))
    advance(simulation, Command(actuators={"wire": 5e-4}))
    kept = simulation.stepper.equilibrium.model.minimiser.level.kept
    count = len(kept.order)
    some, rigid = np.random.default_rng(0).permutation(count)[:60], np.arange(count, count + len(kept.schur) // 3)
    rows = np.concatenate([np.sort(some), rigid])
    columns = HalvedColumns(kept)
    columns.include(rows)
    entries, places = ((3 * each[:, None] + np.arange(3)).ravel() for each in (rows, columns.place[rows]))
    found = columns.between[np.ix_(places, places)]
    assert len(kept.springs) == 1
    for place in range(0, len(entries), 7):
        unit, solved = np.zeros(3 * count + len(kept.schur)), np.empty(3 * count + len(kept.schur))
        unit[entries[place]] = 1.0
        solve_unturned(kept, unit[None], solved[None])
        expected = solved[entries]
        np.testing.assert_allclose(found[:, place], expected, rtol=0, atol=1e-12 * np.abs(found).max())
