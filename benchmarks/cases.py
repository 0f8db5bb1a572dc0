# SPDX-License-Identifier: Apache-2.0
"""The benchmark scenes as plain data: bars of segments, with one clamped face and one moved face.

These definitions repeat those of ``config/scenes`` on purpose. The peers and the reference
solutions read only this module. Therefore a mistake in our scene loader or in our materials cannot
change their results.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
import numpy.typing as npt

from benchmarks.grids import Grid

Array = npt.NDArray[np.float64]


class CaseName(Enum):
    """Scenes that have a reference solution."""

    BEND5 = "bend5"
    TWIST90 = "twist90"
    TENSILE = "tensile"
    TWIST90_UNIFORM = "twist90_uniform"


@dataclass(frozen=True, kw_only=True)
class LogNeoHooke:
    """Compressible neo-Hookean law in its logarithmic form.

    ``W = mu/2 (tr F^T F - 3) - mu ln J + lame/2 (ln J)^2`` [J/m^3].

    Attributes:
        young: initial Young's modulus [Pa].
        poisson: initial Poisson's ratio [-].
    """

    young: float
    poisson: float

    @property
    def mu(self) -> float:
        """Initial shear modulus [Pa]."""
        return self.young / (2.0 * (1.0 + self.poisson))

    @property
    def lame(self) -> float:
        """Initial first Lame constant [Pa]."""
        return self.young * self.poisson / ((1.0 + self.poisson) * (1.0 - 2.0 * self.poisson))

    @property
    def bulk(self) -> float:
        """Initial bulk modulus [Pa]."""
        return self.lame + 2.0 * self.mu / 3.0


@dataclass(frozen=True, kw_only=True)
class OgdenSeries:
    """Ogden series in the Abaqus convention (the paper's Eq. 11), isochoric stretches.

    ``W = sum_i 2 mu_i / alpha_i^2 (sum_k (J^(-1/3) lambda_k)^alpha_i - 3) + bulk/2 (J - 1)^2``.

    Attributes:
        mu: moduli ``mu_i`` [Pa]; their sum is the initial shear modulus.
        alpha: exponents ``alpha_i`` [-].
        poisson: initial Poisson's ratio [-]; it determines the bulk modulus.
    """

    mu: tuple[float, ...]
    alpha: tuple[float, ...]
    poisson: float

    @property
    def bulk(self) -> float:
        """Bulk modulus ``2 mu0 (1 + nu) / (3 (1 - 2 nu))`` [Pa]."""
        return 2.0 * sum(self.mu) * (1.0 + self.poisson) / (3.0 * (1.0 - 2.0 * self.poisson))


Law = LogNeoHooke | OgdenSeries


@dataclass(frozen=True, kw_only=True)
class Case:
    """One scene: a bar along x from 0, centred on 0 in y and z, clamped at ``x = 0``.

    Attributes:
        name: name of the scene.
        size: lengths of the bar along x, y, z [m].
        cells: hexahedra along x, y, z of the paper's own mesh.
        laws: one law for each segment; the segments divide the length equally, from the left.
        translation: displacement of the right face at full load [m].
        rotation: rotation vector of the right face about its rest centre at full load [rad].
        slides: whether the right face, which stays plane and parallel, may slide along x without force.
        slide: x displacement [m] that is prescribed if a solver cannot leave the handle free: the
            value of the reference solution; zero unless ``slides``.
        reaction_index: entry of (force, moment) that is compared, 0 to 5.
    """

    name: CaseName
    size: tuple[float, float, float]
    cells: tuple[int, int, int]
    laws: tuple[Law, ...]
    translation: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rotation: tuple[float, float, float] = (0.0, 0.0, 0.0)
    slides: bool = False
    slide: float = 0.0
    reaction_index: int = 0

    def grid(self, cells: tuple[int, int, int] | None = None, *, order: int = 1) -> Grid:
        """Return the grid of the bar, by default the paper's; see `Grid`.

        Raises:
            ValueError: if a border between segments is not a border between cells along x.
        """
        cells = cells or self.cells
        if cells[0] % len(self.laws):
            raise ValueError(
                f"{self.name.value}: {cells[0]} cells along x cannot follow {len(self.laws)} equal segments; "
                f"give a multiple of {len(self.laws)}"
            )
        return Grid(size=self.size, cells=cells, order=order)

    def cell_law(self, grid: Grid) -> npt.NDArray[np.int32]:
        """Return the index into ``laws`` of every cell of ``grid``, shape (m,), int32."""
        position = np.arange(grid.n_cells) % grid.cells[0]
        return (position * len(self.laws) // grid.cells[0]).astype(np.int32)

    def handle_displacement(self, points: Array, *, load: float = 1.0) -> Array:
        """Return the prescribed displacement of points of the right face.

        Args:
            points: rest positions on the right face, shape (k, 3), float64 [m].
            load: fraction of the motion, 0 to 1; the x displacement of a sliding handle is
                proportional to its square.

        Returns:
            Displacement, shape (k, 3), float64 [m]. If the handle slides, its x column contains
            `slide` times ``load``^2; a solver that can leave x free ignores this column.
        """
        centre = np.array([self.size[0], 0.0, 0.0])
        arms = points - centre
        turned = arms @ rotation_matrix(load * np.asarray(self.rotation)).T
        move = load * np.asarray(self.translation) + np.array([load**2 * self.slide, 0.0, 0.0])
        return turned - arms + move


def rotation_matrix(vector: Array) -> Array:
    """Return the rotation matrix of a rotation vector [rad], shape (3, 3) (Rodrigues)."""
    angle = float(np.linalg.norm(vector))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = np.asarray(vector) / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross


CHEETAH = OgdenSeries(mu=(-5.497378e6, 2.499418e6, 12.259373e6), alpha=(3.303409, 3.722506, -4.762911), poisson=0.495)
NINJAFLEX = OgdenSeries(mu=(0.187297e6, 0.091893e6, 3.397167e6), alpha=(1.940480, 4.009788, -1.512803), poisson=0.495)

CASES: dict[CaseName, Case] = {
    case.name: case
    for case in (
        Case(
            name=CaseName.BEND5,
            size=(0.50, 0.05, 0.05),
            cells=(50, 5, 5),
            laws=tuple(LogNeoHooke(young=young, poisson=0.45) for young in (100e3, 80e3, 60e3, 40e3, 20e3)),
            translation=(0.0, 0.0, 0.20),
            slides=True,
            slide=-0.0490,
            reaction_index=2,
        ),
        Case(
            name=CaseName.TWIST90,
            size=(0.20, 0.05, 0.05),
            cells=(20, 5, 5),
            laws=(CHEETAH, NINJAFLEX),
            rotation=(np.pi / 2, 0.0, 0.0),
            reaction_index=3,
        ),
        Case(
            name=CaseName.TENSILE,
            size=(0.04, 0.01, 0.01),
            cells=(20, 5, 5),
            laws=(CHEETAH, NINJAFLEX),
            translation=(0.04, 0.0, 0.0),
        ),
        Case(
            name=CaseName.TWIST90_UNIFORM,
            size=(0.20, 0.05, 0.05),
            cells=(20, 5, 5),
            laws=(LogNeoHooke(young=200e3, poisson=0.45),),
            rotation=(np.pi / 2, 0.0, 0.0),
            reaction_index=3,
        ),
    )
}
