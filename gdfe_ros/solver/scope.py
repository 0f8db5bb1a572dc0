# SPDX-License-Identifier: Apache-2.0
"""How much of a body a solve looks at: all that can move, or the part of it that the commands reach."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.materials.material import Law
from gdfe_ros.materials.table import CARRIED
from gdfe_ros.solver.blocks import Blocks, make_blocks
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.descent import Descent, allocate, allocate_part
from gdfe_ros.solver.global_matrix import Factorisation, GlobalMatrix
from gdfe_ros.solver.settings import Skip
from gdfe_ros.solver.unknowns import Unknowns

LEAST_BLOCKS = 25
"""Blocks of elements that a thread has to have for it to pay."""


@dataclass(frozen=True, eq=False)
class Movable:
    """What a solve moves.

    Attributes:
        unknowns: what moves.
        held: int32 free vertices that stay where they are all the same.
        matrix: the constant matrix of the unknowns.
    """

    unknowns: Unknowns
    held: NDArray[np.int32]
    matrix: GlobalMatrix

    @classmethod
    def all_of(cls, unknowns: Unknowns, matrix: GlobalMatrix) -> Movable:
        """Hold nothing."""
        return cls(unknowns, np.zeros(0, np.int32), matrix)


@dataclass(frozen=True, eq=False)
class Scope(Movable):
    """What a solve moves, and the elements that it evaluates.

    Attributes:
        elements: (k,) int32, evaluated; the forces of all others stay as they are.
        carried: int32, of these, the elements whose pressures are updated.
        softening: int32, of these, the elements whose shares are updated.
        blocks: the elements for the kernels.
        descent: work; a part shares positions and forces with the whole.
    """

    elements: NDArray[np.int32]
    carried: NDArray[np.int32]
    softening: NDArray[np.int32]
    blocks: Blocks
    descent: Descent

    @classmethod
    def whole(cls, body: Body, matrix: GlobalMatrix, memory: int, *, rigid: bool, skip: Collection[Skip]) -> Scope:
        """Take everything in that can move.

        Args:
            body: the discretised body.
            matrix: the constant matrix.
            memory: pairs in the history of a descent.
            rigid: elements inside of plates keep zero force: nothing grows there.
            skip: what to leave out.
        """
        elements = np.arange(len(body.material), dtype=np.int32)
        blocks = body.blocks
        if rigid and Skip.PLATES in skip:
            inside = elements_inside_plates(body)
            if inside.any():
                elements = elements[~inside]
                blocks = make_blocks(body.shape, body.material, body.table, elements)
        descent = allocate(body.unknowns.rows, body.rest, len(body.material), memory)
        none = np.zeros(0, np.int32)
        return cls(body.unknowns, none, matrix, elements, *_updated(body, elements, skip), blocks, descent)

    def part(self, body: Body, active: NDArray[np.bool_], skip: Collection[Skip]) -> Scope:
        """Take in only the ``active`` (n,) of the free vertices and the elements around them."""
        elements = self.elements[active[body.cells[self.elements]].any(axis=1)]
        free = self.unknowns.free
        unknowns = self.unknowns._replace(free=free[active[free]])
        return Scope(
            unknowns,
            free[~active[free]],
            self.matrix.part(unknowns),
            elements,
            *_updated(body, elements, skip),
            make_blocks(body.shape, body.material, body.table, elements),
            allocate_part(unknowns.rows, self.descent),
        )

    def place(self, start: NDArray[np.float64], base: NDArray[np.float64]) -> None:
        """Put the unknowns to ``start`` (n, 3) [m], the plates to ``base`` plus what they have slid in ``start``."""
        descent, unknowns = self.descent, self.unknowns
        count = len(unknowns.free)
        descent.x[unknowns.free] = start[unknowns.free]
        descent.x[unknowns.prescribed] = base[unknowns.prescribed]
        u = descent.u.reshape(-1, 3)
        u[:count] = start[unknowns.free]
        first = unknowns.plate_vertices[unknowns.plate_start[:-1]]
        u[count:] = (start[first] - base[first]) * unknowns.plate_axes

    def threads(self, most: int) -> int | None:
        """Tell in how many threads it pays to evaluate the elements; None: in this one."""
        if self.matrix.kind is Factorisation.DENSE:
            return None
        count = min(most, len(self.blocks.element) // LEAST_BLOCKS)
        return count if count > 1 else None

    def skipped(self, body: Body, whole: Scope) -> dict[str, int]:
        """Count the work that a solve in this scope leaves out, by name: elements, or 1."""
        counts = {
            Skip.PLATES: len(body.material) - len(whole.elements),
            Skip.DORMANT: len(whole.elements) - len(self.elements),
            Skip.SHAPE_FACTORS: len(self.elements) - len(self.softening),
            Skip.PRESSURES: len(self.elements) - len(self.carried),
            Skip.EIGENVALUES: int((body.table.law[body.material[self.elements]] != Law.OGDEN).sum()),
        }
        return {skip.value: count for skip, count in counts.items() if count}


def elements_inside_plates(body: Body) -> NDArray[np.bool_]:
    """Tell of which elements (m,) all vertices belong to one plate: they are moved rigidly for good."""
    inside = np.zeros(len(body.material), dtype=bool)
    for handle in body.handles:
        held = np.zeros(len(body.rest), dtype=bool)
        held[handle.vertices] = True
        inside |= held[body.cells].all(axis=1)
    return inside


def _updated(
    body: Body, elements: NDArray[np.int32], skip: Collection[Skip]
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Return the elements whose pressures and those whose shares are updated between descents."""
    material = body.material[elements]
    carried = body.table.parameters[material, CARRIED] == 1.0
    softening = body.table.law[material] != Law.LINEAR
    return (
        elements[carried] if Skip.PRESSURES in skip else elements,
        elements[softening] if Skip.SHAPE_FACTORS in skip else elements,
    )
