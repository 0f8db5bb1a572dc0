# SPDX-License-Identifier: Apache-2.0
"""Group 8: shallow arches and domes, loaded until they snap through, and unloaded. Only the jumps may be reported."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from benchmarks.torture.bodies import Driver, distance, make_scene
from benchmarks.torture.case import Case, Finding, Group
from gdfe_ros.actuators.load import Gravity
from gdfe_ros.constraints import Handle
from gdfe_ros.materials import Curve, CurveData, Linear, Material, NeoHookean
from gdfe_ros.mesh import HexMesh, bar
from gdfe_ros.scene.scene import Scene
from gdfe_ros.solver.settings import Policy

TOLERANCE = 1e-7
BOUND = 1e-4
JUMPED = "jumped to another equilibrium"
STEPS = 40
LAWS: dict[str, Callable[[], Material]] = {
    "linear": lambda: Linear(young=1e6, poisson=0.3),
    "neo-hookean": lambda: NeoHookean(young=1e6, poisson=0.45),
    "curve": lambda: Curve(data=CurveData.table([0.2, 1.0, 3.0], [2e5, 8e5, 3e6]), poisson=0.45),
}


@dataclass(frozen=True)
class Shell:
    """A shallow shell that a body force pushes through its plane.

    Attributes:
        size, cells: size [m] and numbers of cells of the plate before bending.
        rise: height of the middle above the edge [m].
        edges: axes at whose two ends the shell is clamped.
        weight: largest acceleration [m/s^2], with 1000 kg/m^3; it is far beyond the limit point.
    """

    size: tuple[float, float, float]
    cells: tuple[int, int, int]
    rise: float
    edges: tuple[int, ...]
    weight: float

    def scene(self, material: Material, tolerance: float) -> Scene:
        """Return the scene; its load `push` acts downward."""
        flat = bar(self.size, self.cells)
        vertices, held = flat.vertices.copy(), np.zeros(flat.n_vertices, dtype=bool)
        lift = np.full(flat.n_vertices, self.rise)
        for axis in self.edges:
            low, high = flat.bounds[:, axis]
            place = (2.0 * vertices[:, axis] - low - high) / (high - low)
            lift *= 1.0 - place**2
            held |= np.abs(place) > 1.0 - 1e-9
        vertices[:, 2] += lift
        push = Gravity(name="push", acceleration=np.array([0.0, 0.0, -1.0]), density=np.full(flat.n_cells, 1e3))
        clamp = Handle("clamp", np.flatnonzero(held).astype(np.int32), fixed=True)
        mesh = HexMesh(vertices, flat.cells)
        return make_scene(mesh, material, policy=Policy.ENERGY, tolerance=tolerance, handles=[clamp], loads=[push])


SHELLS: dict[str, Shell] = {
    "an arch": Shell((0.10, 0.01, 0.002), (20, 1, 1), 0.008, (0,), 200.0),
    "a dome": Shell((0.10, 0.10, 0.002), (10, 10, 1), 0.010, (0, 1), 600.0),
}


def _there_and_back(shell: Shell, law: str) -> Finding:
    """Load and unload in small steps: jumps must be reported, all other steps converge, the end must be undeformed."""
    driver = Driver(shell.scene(LAWS[law](), TOLERANCE))
    height, flaws = driver.simulation.mesh.vertices[:, 2].mean(), []
    for share in (*np.linspace(0.0, 1.0, STEPS + 1)[1:], *np.linspace(1.0, 0.0, STEPS + 1)[1:]):
        result = driver.step(loads={"push": share * shell.weight})
        if not result.converged and JUMPED not in result.message:
            flaws.append(f"at {share:.3g}: {result.message}")
        if not result.converged:
            result = driver.step()
    told = [result.message for result in driver.results if JUMPED in result.message]
    lowest = min(result.positions[:, 2].mean() for result in driver.results)
    if not lowest < -0.3 * height:
        flaws.append("it did not go through: the case is too weak")
    vertices, size = driver.simulation.mesh.vertices, driver.simulation.mesh.size
    error = distance(result.positions, vertices, size) if result.energy < 1e-9 else np.nan
    return Finding(tuple(driver.results), error, driver.rise, tuple(told), tuple(flaws))


def _at_once(shell: Shell, law: str) -> Finding:
    """Load in one step; return the distance from the final state of small steps."""
    slow, driver = (Driver(shell.scene(LAWS[law](), TOLERANCE)) for _ in range(2))
    for share in np.linspace(0.0, 1.0, STEPS + 1)[1:]:
        expected = slow.step(loads={"push": share * shell.weight})
        if not expected.converged:
            expected = slow.step()
    result = driver.step(loads={"push": shell.weight})
    if JUMPED in result.message:
        result = driver.step()
    error = distance(result.positions, expected.positions, driver.simulation.mesh.size)
    return Finding(tuple(driver.results), error, driver.rise)


def cases() -> list[Case]:
    """Return the cases with snap-through."""
    case = partial(Case, group=Group.ACTUATORS, policy=Policy.ENERGY)
    found = []
    for name, shell in SHELLS.items():
        for law in LAWS:
            run = partial(_there_and_back, shell, law)
            found.append(case(name=f"{name} through and back", law=law, run=run, bound=np.inf, remark=JUMPED))
            run = partial(_at_once, shell, law)
            found.append(case(name=f"{name} at once", law=law, run=run, bound=BOUND))
    return found
