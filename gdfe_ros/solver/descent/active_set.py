# SPDX-License-Identifier: Apache-2.0
"""How much of a body a solve looks at: all that can move, or the part of it that the commands reach."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.materials.material import Law
from gdfe_ros.materials.table import CARRIED
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.descent.history import HistoryKeeper
from gdfe_ros.solver.descent.workspace import Workspace, allocate, allocate_part
from gdfe_ros.solver.elements.blocks import Blocks, make_blocks
from gdfe_ros.solver.matrix.constant_matrix import ConstantMatrix, Factorisation
from gdfe_ros.solver.matrix.unknowns import Unknowns
from gdfe_ros.solver.settings import Skip

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
    matrix: ConstantMatrix

    @classmethod
    def all_of(cls, unknowns: Unknowns, matrix: ConstantMatrix) -> Movable:
        """Hold nothing."""
        return cls(unknowns, np.zeros(0, np.int32), matrix)


@dataclass(frozen=True, eq=False)
class ActiveSet(Movable):
    """What a solve moves, the elements that it evaluates, and the workspace for that.

    Attributes:
        elements: (k,) int32, evaluated; the forces of all others stay as they are.
        carried: int32, of these, the elements whose pressures are updated.
        softening: int32, of these, the elements whose hourglass scales are updated.
        blocks: the elements for the kernels, ungrown.
        workspace: of its descents; a part shares positions and forces with the whole.
        keeper: of the workspace's history.
    """

    elements: NDArray[np.int32]
    carried: NDArray[np.int32]
    softening: NDArray[np.int32]
    blocks: Blocks
    workspace: Workspace
    keeper: HistoryKeeper

    @classmethod
    def whole(
        cls, body: Body, matrix: ConstantMatrix, memory: int, *, rigid: bool, skip: Collection[Skip]
    ) -> ActiveSet:
        """Take everything in that can move.

        Args:
            body: the discretised body.
            matrix: the constant matrix.
            memory: pairs in the history of a descent.
            rigid: elements inside of handles keep zero force: nothing grows there.
            skip: what to leave out.
        """
        elements = np.arange(len(body.material), dtype=np.int32)
        blocks = body.blocks
        if rigid and Skip.HANDLES in skip:
            inside = elements_inside_handles(body)
            if inside.any():
                elements = elements[~inside]
                blocks = make_blocks(body.shape, body.material, body.table, elements)
        work = allocate(body.unknowns.rows, body.rest, len(body.material), memory)
        none = np.zeros(0, np.int32)
        updated = _updated(body, elements, skip)
        return cls(body.unknowns, none, matrix, elements, *updated, blocks, work, HistoryKeeper(work))

    def part(self, body: Body, awake: NDArray[np.bool_], skip: Collection[Skip]) -> ActiveSet:
        """Take in only those of the free vertices that are ``awake`` (n,) and the elements around them."""
        elements = self.elements[awake[body.cells[self.elements]].any(axis=1)]
        free = self.unknowns.free
        unknowns = self.unknowns.restricted(free[awake[free]])
        work = allocate_part(unknowns.rows, self.workspace)
        return ActiveSet(
            unknowns,
            free[~awake[free]],
            self.matrix.part(unknowns),
            elements,
            *_updated(body, elements, skip),
            make_blocks(body.shape, body.material, body.table, elements),
            work,
            HistoryKeeper(work),
        )

    def place(
        self,
        positions: NDArray[np.float64],
        base: NDArray[np.float64],
        slides: NDArray[np.float64],
        turns: NDArray[np.float64],
    ) -> None:
        """Put the unknowns to a start.

        Args:
            positions: (n, 3) [m] of the free vertices, those that are held included.
            base: (n, 3) [m], of which the handles' vertices are read.
            slides: (p, 3) translations [m] of the handles with a free axis.
            turns: (p, 3) their rotation vectors [rad].
        """
        work, unknowns = self.workspace, self.unknowns
        count = len(unknowns.free)
        work.x[...] = positions
        work.x[unknowns.prescribed] = base[unknowns.prescribed]
        u = work.u.reshape(-1, 3)
        np.take(positions, unknowns.free, axis=0, out=u[:count], mode="clip")
        u[count : count + len(slides)] = slides * unknowns.slides
        turning = unknowns.turn_row >= 0
        if not turning.any():
            return
        u[unknowns.turn_row[turning]] = (turns * unknowns.turns * unknowns.radius[:, None])[turning]

    def rigid_motion(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return translations [m] and rotation vectors [rad], (p, 3) each, of the handles with a free axis."""
        unknowns, u = self.unknowns, self.workspace.u.reshape(-1, 3)
        count = len(unknowns.free)
        slides, turns = u[count : count + len(unknowns.slides)].copy(), np.zeros_like(unknowns.turns)
        turning = unknowns.turn_row >= 0
        turns[turning] = u[unknowns.turn_row[turning]] / unknowns.radius[turning, None]
        return slides, turns

    def threads(self, most: int) -> int | None:
        """Tell in how many threads it pays to evaluate the elements; None: in this one."""
        if self.matrix.kind is Factorisation.DENSE:
            return None
        count = min(most, len(self.blocks.element) // LEAST_BLOCKS)
        return count if count > 1 else None

    def skipped(self, body: Body, whole: ActiveSet) -> dict[str, int]:
        """Count the work that a solve of this set leaves out, by name: elements, or 1."""
        counts = {
            Skip.HANDLES: len(body.material) - len(whole.elements),
            Skip.DORMANT: len(whole.elements) - len(self.elements),
            Skip.SHAPE_FACTORS: len(self.elements) - len(self.softening),
            Skip.PRESSURES: len(self.elements) - len(self.carried),
            Skip.EIGENVALUES: int((body.table.law[body.material[self.elements]] != Law.OGDEN).sum()),
        }
        return {skip.value: count for skip, count in counts.items() if count}


def elements_inside_handles(body: Body) -> NDArray[np.bool_]:
    """Tell of which elements (m,) all vertices belong to one handle: they are moved rigidly for good."""
    inside = np.zeros(len(body.material), dtype=bool)
    for handle in body.handles:
        held = np.zeros(len(body.rest), dtype=bool)
        held[handle.vertices] = True
        inside |= held[body.cells].all(axis=1)
    return inside


def _updated(
    body: Body, elements: NDArray[np.int32], skip: Collection[Skip]
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Return the elements whose pressures and those whose hourglass scales are updated between descents."""
    material = body.material[elements]
    carried = body.table.parameters[material, CARRIED] == 1.0
    softening = body.table.law[material] != Law.LINEAR
    return (
        elements[carried] if Skip.PRESSURES in skip else elements,
        elements[softening] if Skip.SHAPE_FACTORS in skip else elements,
    )
