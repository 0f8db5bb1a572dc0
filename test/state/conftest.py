# SPDX-License-Identifier: Apache-2.0
"""A soft bar that bends by growth and by a cable, and helpers for all tests of the state."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from gdfe_ros import Command, Pose, Simulation
from gdfe_ros.mesh import HexMesh
from gdfe_ros.results.step_result import StepResult
from gdfe_ros.scene.scene import Scene
from test.written import scene_of

FIXED = "base: {where: {face: x-}, fixed: true}"
GROWTH = "heat: {growth: {stretch: [0.9, 1, 1], where: {box: {z: [0, 1]}}}}"
CABLE = "pull: {cable: {points: [[0, 0, 0.008], [0.1, 0, 0.008]], command: tension}}"
BAR = """\
mesh: {{bar: {{size: [0.1, 0.02, 0.02], cells: [10, 2, 2]}}}}
materials: {{rubber: {{law: neo_hookean, young: 1.0e6, poisson: 0.45, density: 1000}}}}
handles: {{{handles}}}
actuators: {{{actuators}}}
probes: {{tip: [0.1, 0, 0]}}
{more}
"""
CORNERS = np.array([[x, y, z] for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))])
"""Corners of a cell in its own coordinates, in the order of a cell's vertices."""


class Lab:
    """Scenes, commands and comparisons under short names."""

    def scene(
        self, *, handles: str = FIXED, actuators: str = f"{GROWTH}, {CABLE}", more: str = "", **keys: object
    ) -> Scene:
        """Make the scene of the bar; keywords override scene keys, double underscores stand for dots."""
        overrides = {key.replace("__", "."): value for key, value in keys.items()}
        return scene_of(BAR.format(handles=handles, actuators=actuators, more=more), overrides=overrides)

    def bar(self, **how: object) -> Simulation:
        """Make a simulation of the bar, with the arguments of `scene`."""
        return Simulation(self.scene(**how))

    def go(self, simulation: Simulation, pose: Pose | None = None, **actuators: float) -> StepResult:
        """Make a step with commands of actuators, and with a pose of the handle ``tip`` if it is given."""
        return simulation.step(Command(handles={} if pose is None else {"tip": pose}, actuators=actuators))

    def fresh(self, simulation: Simulation, *commands: Command, tolerance: float = 1e-9) -> Simulation:
        """Make another simulation of the scene with a far tighter tolerance, and make steps with these commands."""
        settings = replace(simulation.settings, tolerance=tolerance, max_iterations=20000)
        other = Simulation(simulation.scene, settings=settings)
        for command in commands:
            assert other.step(command).converged
        return other

    def distance(self, one: NDArray[np.float64], other: NDArray[np.float64], mesh: HexMesh) -> float:
        """Return the largest distance between two states' vertices divided by the body's size."""
        return float(np.linalg.norm(one - other, axis=1).max() / mesh.size)

    def least_corner(self, mesh: HexMesh, positions: NDArray[np.float64]) -> float:
        """Return the least determinant of the trilinear map over all cells' corners, relative to the undeformed one."""

        def determinants(points: NDArray[np.float64]) -> NDArray[np.float64]:
            nodes = points[mesh.cells]
            edges = []
            for axis in range(3):
                low, high = CORNERS.copy(), CORNERS.copy()
                low[:, axis], high[:, axis] = 0, 1
                find = [[int(np.flatnonzero((c == CORNERS).all(axis=1))[0]) for c in side] for side in (low, high)]
                edges.append(nodes[:, find[1]] - nodes[:, find[0]])
            return np.linalg.det(np.stack(edges, axis=-1))

        return float((determinants(positions) / determinants(mesh.vertices)).min())


@pytest.fixture(scope="session")
def lab() -> Lab:
    """Return the helpers for the bar."""
    return Lab()
