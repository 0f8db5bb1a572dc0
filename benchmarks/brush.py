# SPDX-License-Identifier: Apache-2.0
"""A brush: bristles on an elastic palm, of which a few are moved."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.constraints import Handle, Pose
from gdfe_ros.materials import Material, NeoHookean
from gdfe_ros.mesh import HexMesh, bar
from gdfe_ros.scene.scene import Scene
from gdfe_ros.simulation import Command
from gdfe_ros.solver.settings import SolverSettings

CELL = 0.004
"""Edge of the cubic cells [m]."""
THICK, PITCH = 2, 3
"""Number of cells across a bristle, and from one bristle to the next."""
RUBBER = NeoHookean(young=1e5, poisson=0.45)


@dataclass(frozen=True, kw_only=True)
class Brush:
    """Bristles along x on a palm whose back is fixed.

    Attributes:
        rows: number of bristles along y and z.
        palm: number of cells of the palm along x.
        length: number of cells of a bristle along x.
    """

    rows: tuple[int, int] = (20, 5)
    palm: int = 5
    length: int = 40

    @property
    def bristles(self) -> int:
        """Number of bristles."""
        return self.rows[0] * self.rows[1]

    def mesh(self) -> HexMesh:
        """Return the mesh: a block of cells from which the gaps between the bristles are removed."""
        counts = (self.palm + self.length, *(PITCH * row - PITCH + THICK for row in self.rows))
        block = bar([CELL * count for count in counts], counts)
        place = np.floor((block.centroids - block.bounds[0]) / CELL).astype(int)
        kept = (place[:, 0] < self.palm) | (place[:, 1:] % PITCH < THICK).all(axis=1)
        used, cells = np.unique(block.cells[kept], return_inverse=True)
        return HexMesh(block.vertices[used], cells.reshape(-1, 8).astype(np.int32))

    def scene(self, held: int, *, material: Material = RUBBER, settings: SolverSettings | None = None) -> Scene:
        """Return the scene in which the tips of the first ``held`` bristles are handles."""
        mesh = self.mesh()
        back = Handle("back", np.flatnonzero(mesh.vertices[:, 0] < 0.5 * CELL).astype(np.int32), fixed=True)
        tips = [Handle(f"tip_{i}", self._tip(mesh.vertices, i)) for i in range(held)]
        return Scene(
            name="brush",
            description="bristles on a palm",
            mesh=mesh,
            materials={"rubber": material},
            cell_material=np.zeros(mesh.n_cells, np.int32),
            handles=(back, *tips),
            solver=settings or SolverSettings(),
        )

    def bent(self, moved: Sequence[int], amount: float) -> Command:
        """Return the command that moves the tips with numbers ``moved`` sideways by 0.2 ``amount`` bristle lengths."""
        reach = 0.5 * CELL * self.length
        pose = Pose(translation=(-0.05 * reach * amount**2, 0.0, 0.4 * reach * amount))
        return Command(handles={f"tip_{i}": pose for i in moved})

    def _tip(self, vertices: NDArray[np.float64], index: int) -> NDArray[np.int32]:
        low = vertices.min(axis=0)
        place = np.round((vertices - low) / CELL).astype(int)
        y, z = PITCH * (index % self.rows[0]), PITCH * (index // self.rows[0])
        inside = (place[:, 1] >= y) & (place[:, 1] <= y + THICK) & (place[:, 2] >= z) & (place[:, 2] <= z + THICK)
        return np.flatnonzero(inside & (place[:, 0] == self.palm + self.length)).astype(np.int32)
