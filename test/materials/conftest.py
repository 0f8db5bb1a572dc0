# SPDX-License-Identifier: Apache-2.0
"""The laws under test, and one cube of material under any deformation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from gdfe_ros.materials import (
    ArrudaBoyce,
    Curve,
    CurveData,
    Gent,
    Law,
    Linear,
    Material,
    MooneyRivlin,
    NeoHookean,
    Ogden,
    StableNeoHookean,
    Yeoh,
    preset,
)
from gdfe_ros.mesh import bar
from gdfe_ros.results.element_fields import corner_forces, strain_energies, volume_pressures
from gdfe_ros.solver.body import Body

MEASURED = CurveData.table(
    [0.0, 0.05, 0.1, 0.2, 0.4, 0.7, 1.0, 1.5, 2.0], [0.0, 0.9e5, 1.6e5, 2.6e5, 4.0e5, 5.3e5, 6.4e5, 8.6e5, 11.9e5]
)
LAWS: dict[str, Material] = {
    "linear": Linear(young=1e5, poisson=0.3),
    "linear-0.49": Linear(young=1e5, poisson=0.49),
    "neo-hookean": NeoHookean(young=1e5, poisson=0.3),
    "neo-hookean-0.495": NeoHookean(young=1e5, poisson=0.495),
    "stable-neo-hookean": StableNeoHookean(young=1e5, poisson=0.3),
    "stable-neo-hookean-0.495": StableNeoHookean(young=1e5, poisson=0.495),
    "ogden": preset("ninjaflex", law=Law.OGDEN, poisson=0.4),
    "ogden-0.495": preset("cheetah", law=Law.OGDEN, poisson=0.495),
    "ogden-one-term": Ogden(mu=(3e4,), alpha=(2.0,), poisson=0.45),
    "yeoh": Yeoh(c10=1.1e5, c20=2e4, c30=500.0, poisson=0.4),
    "yeoh-softening": Yeoh(c10=7.2e3, c20=370.0, c30=-24.0, poisson=0.495),
    "mooney-rivlin": MooneyRivlin(c10=1.4e5, c01=6e4, poisson=0.4),
    "mooney-rivlin-0.495": MooneyRivlin(c10=1.4e5, c01=6e4, poisson=0.495),
    "arruda-boyce": ArrudaBoyce(mu=2e5, lambda_m=2.8, poisson=0.45),
    "gent": Gent(mu=3e4, jm=40.0, poisson=0.4),
    "gent-0.495": Gent(mu=3e4, jm=12.0, poisson=0.495),
    "curve-polynomial": preset("cheetah", law=Law.CURVE, poisson=0.4),
    "curve-polynomial-0.495": preset("ninjaflex", law=Law.CURVE, poisson=0.495),
    "curve-table": Curve(data=MEASURED, poisson=0.45),
}


@pytest.fixture(params=LAWS.values(), ids=LAWS)
def law(request: pytest.FixtureRequest) -> Material:
    """Give each stress-strain law in turn."""
    return request.param


@pytest.fixture(params=["linear", "linear-0.49", "curve-polynomial", "curve-table"])
def corotated_law(request: pytest.FixtureRequest) -> Material:
    """Give each law whose stress is computed with the rotation of F."""
    return LAWS[request.param]


@dataclass(frozen=True)
class Cube:
    """A cube of one element and one material, 0.1 m long, deformed by any F."""

    material: Material
    body: Body
    side: float = 0.1

    def positions(self, gradient: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the vertices (8, 3) [m] under the deformation gradient F."""
        return np.ascontiguousarray(self.body.rest @ np.asarray(gradient).T)

    def energy(self, x: NDArray[np.float64]) -> float:
        """Return the energy [J] with vertices at ``x`` (8, 3) [m]."""
        return float(strain_energies(self.body, x)[0])

    def forces(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the force (8, 3) [N] on each vertex with vertices at ``x`` (8, 3) [m]."""
        corners = corner_forces(self.body, x, volume_pressures(self.body, x))[0][0]
        return corners[np.argsort(self.body.cells[0])]

    def density(self, gradient: NDArray[np.float64]) -> float:
        """Return the energy density [J/m^3] under F."""
        return self.energy(self.positions(gradient)) / self.side**3

    def stress(self, gradient: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the nominal stress (3, 3) [Pa]: forces on the faces x+, y+, z+ over undeformed areas, as columns."""
        forces, rest = self.forces(self.positions(gradient)), self.body.rest
        faces = (rest[:, axis] > rest[:, axis].mean() for axis in range(3))
        return np.stack([forces[face].sum(axis=0) for face in faces], axis=1) / self.side**2


@pytest.fixture(scope="session")
def cube() -> Callable[[Material], Cube]:
    """Return a function that makes a cube of a material."""
    mesh = bar([0.1, 0.1, 0.1], [1, 1, 1])

    def make(material: Material) -> Cube:
        return Cube(material, Body.build(mesh.vertices, mesh.cells, [material], np.zeros(1, np.int32), ()))

    return make
