# SPDX-License-Identifier: Apache-2.0
"""Convergence with the element size against closed forms: displacements converge at second order.

A hollow sphere of incompressible neo-Hookean rubber under inner pressure. With A, B the undeformed radii and a, b those
under pressure, r^3 = R^3 + a^3 - A^3 everywhere, and a follows from the balance of forces (Green and Zerna 1954):
p = mu [f(b/B) - f(a/A)] with f(q) = 2/q + 1/(2 q^4).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from gdfe_ros import Command, Simulation
from test.written import advance, scene_of

INNER, OUTER, YOUNG, PRESSURE = 0.010, 0.015, 1.0e6, 1.0e5
SCENE = """
mesh: {{sphere: {{inner: {inner}, outer: {outer}, cells: {cells}}}}}
materials: {{m: {{law: neo_hookean, young: {young}, poisson: 0.5}}}}
handles: {{base: {{where: {{vertices: [0]}}, fixed: true}}}}
actuators: {{air: {{chamber: {{command: pressure}}}}}}
solver: {{tolerance: 1.0e-6}}
"""


def _exact(rest: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the exact displacements (n, 3) [m] of undeformed points given relative to the centre."""

    def surplus(inner: float) -> float:
        outer = np.cbrt(OUTER**3 + inner**3 - INNER**3)
        near, far = inner / INNER, outer / OUTER
        return YOUNG / 3.0 * (2.0 / far + 0.5 / far**4 - 2.0 / near - 0.5 / near**4) - PRESSURE

    inner = brentq(surplus, INNER, 1.3 * INNER, xtol=1e-15)
    radius = np.linalg.norm(rest, axis=1, keepdims=True)
    return rest * (np.cbrt(radius**3 + inner**3 - INNER**3) / radius - 1.0)


def _error(cells: list[int]) -> float:
    """Return the root mean square error of the displacements divided by their root mean square."""
    text = SCENE.format(inner=INNER, outer=OUTER, young=YOUNG, cells=cells)
    simulation = Simulation(scene_of(text))
    result = advance(simulation, Command(actuators={"air": PRESSURE}))
    exact = _exact(simulation.mesh.vertices)
    found = result.positions - result.positions.mean(axis=0) - simulation.mesh.vertices
    return float(np.linalg.norm(found - exact) / np.linalg.norm(exact))


def test_displacements_converge_with_order_two() -> None:
    """Each of two halvings of the elements of a pressed sphere reduces the displacement error to a quarter."""
    errors = [_error(cells) for cells in ([3, 2], [6, 4], [12, 8])]
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(rates, 2.0, atol=0.1)
    assert errors[-1] < 4e-3
