# SPDX-License-Identifier: Apache-2.0
"""The discretised body: all data of a scene that stay constant during a simulation, and growth.

Growth changes the operators of the cells' rest shape, and has no energy of its own. Let F be the deformation gradient,
G the growth, and F_e = F G^-1 the elastic part of F. Cells that grow get the operators of their grown rest shape
(`CellType.grown`). The element kernels then compute F_e in place of F.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.actuators.actuator import Actuator, ActuatorState, Growth
from gdfe_ros.constraints import Handle
from gdfe_ros.constraints.obstacle import SelfContact
from gdfe_ros.constraints.rigid_body import RigidBody, rigid_among
from gdfe_ros.materials.material import Material
from gdfe_ros.materials.table import YOUNG, MaterialTable, pack
from gdfe_ros.mesh.cells.faces import cells_across
from gdfe_ros.mesh.cells.filling import Filling
from gdfe_ros.mesh.cells.operators import ShapeOperators
from gdfe_ros.mesh.cells.tet_operators import TetOperators
from gdfe_ros.mesh.touching import Touching
from gdfe_ros.solver.elements.blocks import Blocks, Operators, in_lanes
from gdfe_ros.solver.elements.cell_type import CELL_TYPES, CellType, cell_type_of
from gdfe_ros.solver.matrix.unknowns import Unknowns, number_unknowns
from gdfe_ros.solver.settings import Torsion
from gdfe_ros.solver.vectors import Array


@dataclass(frozen=True)
class Body:
    """Rest shape, operators, packed materials and the numbering of the unknowns.

    Attributes:
        rest: (n, 3) float64 rest vertices [m]: first those of the mesh, then those of rigid bodies.
        shape: operators of the elements.
        blocks: the elements in the layout of the kernels.
        materials: the materials; their order defines their indices.
        material: (m,) int32 index of each element's material.
        table: the materials packed for the kernels.
        handles: vertex sets that are fixed or moved by commands.
        unknowns: numbering of the free vertices and free motions.
        size: reference length of relative tolerances [m]: `HexMesh.size`.
        self_contact: faces that may touch each other; None for no self-contact.
        skin: contact points of embedded skins, used instead of faces; None if all contact is between faces.
    """

    rest: Array
    shape: ShapeOperators | TetOperators
    blocks: Blocks
    materials: tuple[Material, ...]
    material: NDArray[np.int32]
    table: MaterialTable
    handles: tuple[Handle, ...]
    unknowns: Unknowns
    size: float
    self_contact: SelfContact | None = None
    skin: Touching | None = None

    @classmethod
    def build(
        cls,
        rest: Array,
        cells: NDArray[np.int32],
        materials: Sequence[Material],
        material: NDArray[np.int32],
        handles: Sequence[Handle],
        filling: Filling | None = None,
        self_contact: SelfContact | None = None,
        *,
        torsion: Torsion = Torsion.CELL,
        size: float | None = None,
        skin: Touching | None = None,
    ) -> Body:
        """Compute operators and numbering from rest vertices (n, 3) [m] and cells (m, c) of one type.

        ``filling`` is the filled fraction of cut cells. ``size`` [m] becomes the body's reference length; None stands
        for the diagonal of the cells' bounding box.
        """
        material = np.ascontiguousarray(material, dtype=np.int32)
        kind = CELL_TYPES[cells.shape[1]]
        shape, table = kind.operators(rest, cells, filling), kind.table(pack(materials))
        if torsion is Torsion.SECTION and kind.softens:
            shape = shape._replace(across=cells_across(cells, material, shape.parallel).min(axis=1))
        return cls(
            rest,
            shape,
            kind.blocks(shape, material, table, np.arange(len(material), dtype=np.int32)),
            tuple(materials),
            material,
            table,
            tuple(handles),
            number_unknowns(rest, cells, handles),
            float(np.linalg.norm(np.ptp(rest[: cells.max() + 1], axis=0))) if size is None else size,
            self_contact,
            skin,
        )

    @cached_property
    def count(self) -> int:
        """Number of vertices of the mesh; the vertices of rigid bodies follow them in all arrays."""
        return int(self.cells.max()) + 1

    @cached_property
    def strain_energy_scale(self) -> float:
        """Sum over the elements of Young's modulus times volume: about the energy [J] of a strain of one."""
        return float(self.table.parameters[self.material][:, YOUNG] @ self.shape.volume)

    @property
    def rigid_bodies(self) -> tuple[RigidBody, ...]:
        """The rigid bodies among the handles, in their order."""
        return rigid_among(self.handles)

    @property
    def cell_type(self) -> CellType:
        """The cell type of the elements."""
        return cell_type_of(self.shape)

    def blocks_of(self, elements: NDArray[np.int32]) -> Blocks:
        """Return the elements with the indices ``elements`` (k,), in the layout of the kernels."""
        return self.cell_type.blocks(self.shape, self.material, self.table, elements)

    @property
    def cells(self) -> NDArray[np.int32]:
        """Vertices (m, c) of the elements."""
        return self.shape.cells


class Growths:
    """All growths of a body.

    Args:
        body: the body, whose operators are not modified.
        actuators: actuators of the scene; only growths are used.

    Attributes:
        growths: the growths.
        cells: (k,) cells that can grow.
        ungrown: operators without growth.
    """

    def __init__(self, body: Body, actuators: Sequence[Actuator]) -> None:
        self._body = body
        self.growths = tuple(item for item in actuators if isinstance(item, Growth))
        none = np.zeros(0, dtype=np.intp)
        self.cells = np.unique(np.concatenate([none, *(growth.cells for growth in self.growths)])).astype(np.intp)
        self._rows = [np.searchsorted(self.cells, growth.cells) for growth in self.growths]
        self.ungrown = Operators(body.shape, body.blocks, self._stretch({growth.name: 0.0 for growth in self.growths}))

    def __bool__(self) -> bool:
        """Return whether any cell can grow."""
        return bool(self.growths)

    def at(self, commands: Mapping[str, float], last: Operators) -> Operators:
        """Return the operators at these commands; ``last`` itself if the growth is the same."""
        if not self.growths:
            return last
        stretch = self._stretch(commands)
        if np.array_equal(stretch, last.stretch):
            return last
        if np.array_equal(stretch, self.ungrown.stretch):
            return self.ungrown
        kind = self._body.cell_type
        grown, blocks = kind.grown(self._body.shape, self.cells, stretch), self._body.blocks
        return Operators(grown, blocks._replace(geometry=in_lanes(kind.geometry(grown), blocks.element)), stretch)

    def state(self, growth: Growth, commands: Mapping[str, float], grown: Operators) -> ActuatorState:
        """Return the state of a growth: its command and the mean det G of its cells."""
        rows = self._rows[self.growths.index(growth)]
        weights = self._body.shape.volume[self.cells[rows]]
        mean = float(np.average(np.linalg.det(grown.stretch[rows]), weights=weights))
        return ActuatorState(growth.mode, commands[growth.name], mean, 0.0)

    def _stretch(self, commands: Mapping[str, float]) -> Array:
        stretch = np.tile(np.eye(3), (len(self.cells), 1, 1))
        for growth, rows in zip(self.growths, self._rows, strict=True):
            stretch[rows] += commands[growth.name] * (growth.stretch - np.eye(3))
        return stretch
