# SPDX-License-Identifier: Apache-2.0
"""Slender bars with loads, cables and growth, against beam theory at large deflection."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_bvp

from gdfe_ros import Simulation
from gdfe_ros.errors import GdfeError
from gdfe_ros.scene import load_scene
from gdfe_ros.simulation import Command
from test.written import advance, scene_of

LENGTH, SIDE, YOUNG = 0.5, 0.02, 1e6
AREA, INERTIA = SIDE**2, SIDE**4 / 12
BEAM = f"""
mesh: {{bar: {{size: [{LENGTH}, {SIDE}, {SIDE}], cells: [50, 2, 2]}}}}
materials: {{m: {{law: linear, young: {YOUNG}, poisson: 0.0, density: 1000.0}}}}
handles: {{base: {{where: {{face: x-}}, fixed: true}}}}
probes: {{tip: [{LENGTH}, 0, 0]}}
solver: {{tolerance: 1.0e-6, max_iterations: 20000}}
"""


def elastica(end: float, spread: float) -> tuple[float, float]:
    """Return the tip's x and drop, both over the length, of an inextensible clamped beam with dead loads.

    ``end`` is F L^2 / E I, ``spread`` is w L^3 / E I: theta'' = -(end + spread (1 - s)) cos(theta).
    """

    def rates(s: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.stack([y[1], -(end + spread * (1 - s)) * np.cos(y[0]), np.cos(y[0]), np.sin(y[0])])

    def ends(start: np.ndarray, stop: np.ndarray) -> np.ndarray:
        return np.array([start[0], stop[1], start[2], start[3]])

    s = np.linspace(0, 1, 200)
    solution = solve_bvp(rates, ends, s, np.stack([s, 1 - s, s, 0.5 * s]), tol=1e-8, max_nodes=20000)
    assert solution.success
    return float(solution.y[2, -1]), float(solution.y[3, -1])


@pytest.mark.parametrize(("end", "spread"), [(3.0, 0.0), (0.0, 8.0)])
def test_cantilever_follows_the_elastica(end: float, spread: float) -> None:
    """A cantilever with a tip force or gravity, bent by more than half its length, follows the elastica within 1 %."""
    force = end * YOUNG * INERTIA / LENGTH**2
    gravity = spread * YOUNG * INERTIA / LENGTH**3 / (1000.0 * AREA)
    loads = f"""
loads:
  tip: {{surface: {{where: {{face: x+}}, force: [0, 0, {-force}]}}}}
  weight: {{gravity: [0, 0, {-gravity}]}}
"""
    simulation = Simulation(scene_of(BEAM + loads))
    result = advance(simulation)
    x, drop = elastica(end, spread)
    tip = simulation.probe_positions()["tip"] / LENGTH
    assert drop > 0.5
    assert np.hypot(tip[0] - x, -tip[2] - drop) < 0.01 * drop
    np.testing.assert_allclose(result.reactions["base"][2], force + gravity * 1000 * AREA * LENGTH, rtol=2e-3)


def edge_cable(command: str) -> str:
    """Return the actuator text of a cable along the upper edge."""
    points = [[round(LENGTH * i / 50, 6), 0, SIDE / 2] for i in range(51)]
    return f"actuators: {{cable: {{cable: {{points: {points}, command: {command}}}}}}}\n"


def test_cable_along_the_edge_bends_to_a_circle() -> None:
    """A cable along the edge bends the bar to curvature T a / E I and compresses it by T / E A, within 2 %."""
    tension = 0.006 * YOUNG * AREA
    simulation = Simulation(scene_of(BEAM + edge_cable("tension")))
    assert simulation.step(Command(actuators={"cable": tension})).converged
    curvature = tension * SIDE / 2 / (YOUNG * INERTIA)
    arc = LENGTH * (1 - 0.006)
    exact = np.array([np.sin(curvature * arc), 1 - np.cos(curvature * arc)]) / curvature
    tip = simulation.probe_positions()["tip"][[0, 2]]
    assert np.linalg.norm(tip - exact) < 0.02 * np.linalg.norm(exact - [LENGTH, 0])
    length = simulation.actuator_states()["cable"].extent
    assert length == pytest.approx(arc * (1 - curvature * SIDE / 2), rel=2e-3)


def test_cable_by_shortening_finds_the_same_state() -> None:
    """A cable commanded to the shortening of a tension has that tension within 1 %; lengthened, it becomes slack."""
    by_tension = Simulation(scene_of(BEAM + edge_cable("tension")))
    by_tension.step(Command(actuators={"cable": 1.2}))
    state = by_tension.actuator_states()["cable"]
    simulation = Simulation(scene_of(BEAM + edge_cable("shortening")))
    simulation.step(Command(actuators={"cable": LENGTH - state.extent}))
    found = simulation.actuator_states()["cable"]
    assert found.effort == pytest.approx(1.2, rel=0.01)
    assert found.extent == pytest.approx(state.extent, abs=1e-6)
    assert simulation.step(Command(actuators={"cable": -0.01})).converged
    assert simulation.actuator_states()["cable"].effort == 0.0
    np.testing.assert_allclose(simulation.positions, simulation.mesh.vertices, atol=1e-4 * LENGTH)


def test_bilayer_curves_as_timoshenko_says() -> None:
    """A bilayer with one layer grown by 0.2 % has curvature 3/2 eps / h within 3 %."""
    strain = 0.002
    growth = f"actuators: {{heat: {{growth: {{stretch: [{1 + strain}, 1, 1], where: {{box: {{z: [0, 1]}}}}}}}}}}\n"
    simulation = Simulation(scene_of(BEAM + growth))
    assert simulation.step(Command(actuators={"heat": 1.0})).converged
    tip = simulation.probe_positions()["tip"]
    curvature = 1.5 * strain / SIDE
    exact = (1 - np.cos(curvature * LENGTH)) / curvature
    assert -tip[2] == pytest.approx(exact, rel=0.03)


def test_work_of_a_cable_is_the_strain_energy() -> None:
    """The integral of a cable's tension over its shortening is the strain energy within 0.5 %."""
    simulation = Simulation(scene_of(BEAM + edge_cable("tension")))
    path = [(0.0, LENGTH)]
    for tension in np.linspace(0, 2.0, 31)[1:]:
        result = simulation.step(Command(actuators={"cable": tension}))
        path.append((tension, result.actuators["cable"].extent))
    tensions, lengths = np.array(path).T
    work = -np.sum(0.5 * (tensions[1:] + tensions[:-1]) * np.diff(lengths))
    assert result.energy == pytest.approx(work, rel=0.005)


def test_a_jacobian_can_be_interrupted() -> None:
    """An interrupted Jacobian ends at once with an error that gives the reason, and the simulation is unchanged."""
    simulation, asked = Simulation(load_scene("tendon_finger")), []
    simulation.step()
    before = simulation.positions.copy()

    def interrupted() -> bool:
        asked.append(True)
        return len(asked) > 2

    with pytest.raises(GdfeError, match="the derivatives were ended before they were found"):
        simulation.jacobian(interrupted=interrupted)
    assert len(asked) == 3
    np.testing.assert_array_equal(simulation.positions, before)
