# SPDX-License-Identifier: Apache-2.0
"""Newton steps along arcs: elements rotate instead of stretching, and slender bodies take long steps."""

from __future__ import annotations

import numpy as np
import pytest

from gdfe_ros import Simulation
from gdfe_ros.solver.descent import arc
from gdfe_ros.solver.equilibrium.solve import Solve
from test.written import scene_of

LENGTH = 0.1
STRIP = """
mesh: {bar: {size: [0.1, 0.01, 0.01], cells: [20, 2, 2]}}
materials: {m: {law: neo_hookean, young: 1.0e6, poisson: 0.45, density: 1000}}
handles: {base: {where: {face: x-}, fixed: true}}
loads: {weight: {gravity: [0, 0, -1.0]}}
"""


def bent(angle: float) -> tuple[float, np.ndarray, np.ndarray]:
    """Bend the strip at rest to first order, its tip by ``angle`` [rad]; return factor, d and c at the tip's middle."""
    equilibrium = Simulation(scene_of(STRIP)).stepper.equilibrium
    body, minimiser = equilibrium.body, equilibrium.minimiser
    task = Solve.at(equilibrium.model, equilibrium.at_rest()).evaluate()
    work, (x, y, z) = task.active.workspace, body.rest.T
    moved = angle / LENGTH * np.stack([-x * z, 0.0 * x, 0.5 * x * x], axis=1)
    work.direction[...] = moved[body.unknowns.free].ravel()
    minimiser.begin(task.active, None)
    arc.follow_arc_once(task.problem, work, minimiser.metric(equilibrium.whole))
    tip = np.flatnonzero((x == LENGTH) & (y == 0.0) & (z == 0.0))[0]
    row = body.unknowns.free.tolist().index(tip)
    linear = work.direction.reshape(-1, 3)[row]
    return float(linear[2] / moved[tip, 2]), linear, work.curve.reshape(-1, 3)[row]


@pytest.mark.parametrize("angle", [0.03, 0.09])
def test_a_bent_strip_ends_on_a_circle(angle: float) -> None:
    """A step that bends a strip to first order keeps its tip's x; c shortens it by L (1 - sin(a) / a), as a circle."""
    factor, linear, curve = bent(angle)
    assert factor == pytest.approx(1.0)
    assert linear[0] == 0.0
    assert curve[0] == pytest.approx(LENGTH * (np.sin(angle) / angle - 1.0), rel=0.02)
    assert abs(curve[2]) < 0.2 * abs(curve[0])


def test_a_step_turns_no_element_by_more_than_the_limit() -> None:
    """A step of five times the limit is shortened to a fifth, and its arc is that of the shortened step."""
    factor, linear, curve = bent(5.0 * arc.MOST_TURN)
    assert factor == pytest.approx(0.2, rel=0.03)
    _, short, bow = bent(5.0 * factor * arc.MOST_TURN)
    np.testing.assert_allclose(np.concatenate([linear, curve]), np.concatenate([short, bow]), atol=1e-9)
