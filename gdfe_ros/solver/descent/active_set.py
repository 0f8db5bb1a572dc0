# SPDX-License-Identifier: Apache-2.0
"""The unknowns that a solve changes, the elements that it evaluates, and its work arrays."""

from __future__ import annotations

from collections.abc import Collection
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.materials.material import Law
from gdfe_ros.materials.table import CARRIED
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.descent.lbfgs_workspace import allocate
from gdfe_ros.solver.matrix.constant_matrix import ConstantMatrix
from gdfe_ros.solver.outcome import Outcome
from gdfe_ros.solver.settings import Skip
from gdfe_ros.solver.vectors import Array

_OUTCOMES = tuple(Outcome)


class ActiveSet:
    """Unknowns of a body's solves, the elements that solves evaluate, and their workspace.

    Args:
        body: the discretised body.
        matrix: the constant matrix of the unknowns.
        rigid: whether elements inside of handles never have forces. This holds if no cell can grow.
        skip: kinds of work to leave out.
        softening: whether hourglass scales follow the strain.

    Attributes:
        unknowns: numbering of the unknowns.
        matrix: the argument.
        elements: (k,) int32 evaluated elements; all others are inside of handles and have no forces.
        carried: int32 evaluated elements whose pressures are updated.
        softening: int32 evaluated elements whose hourglass scales are updated.
        blocks: the evaluated elements in the layout of the kernels, for a body without growth.
        skipped: dict from kind of work to the number of elements for which it is left out.
        workspace: work arrays of the minimisations.
    """

    LEAST_BLOCKS = 25
    """Least number of element blocks per thread. For small bodies, fewer threads are used."""

    def __init__(
        self, body: Body, matrix: ConstantMatrix, *, rigid: bool, skip: Collection[Skip], softening: bool
    ) -> None:
        self.unknowns, self.matrix, self.blocks = body.unknowns, matrix, body.blocks
        self.elements = elements = np.arange(len(body.material), dtype=np.int32)
        if rigid and Skip.HANDLES in skip and (inside := elements_inside_handles(body)).any():
            self.elements = elements = elements[~inside]
            self.blocks = body.blocks_of(elements)
        material = body.material[elements]
        law, carried = body.table.law[material], body.table.parameters[material, CARRIED] == 1.0
        self.carried = elements[carried] if Skip.PRESSURES in skip else elements
        softened = elements[law != Law.LINEAR] if Skip.SHAPE_FACTORS in skip else elements
        softened = softened if body.cell_type.softens else elements[:0]
        self.softening = softened if softening else elements[:0]
        counts = {
            Skip.HANDLES: len(body.material) - len(elements),
            Skip.SHAPE_FACTORS: len(elements) - len(softened),
            Skip.PRESSURES: len(elements) - len(self.carried),
            Skip.EIGENVALUES: int((law != Law.OGDEN).sum()),
        }
        self.skipped = {kind.value: count for kind, count in counts.items() if count}
        self.workspace = allocate(body.unknowns.rows, body.rest, body.cells.shape)

    @cached_property
    def status(self) -> np.void:
        """The workspace's status record."""
        return self.workspace.status[0]

    @property
    def ended(self) -> Outcome:
        """Why the last minimisation could not continue."""
        return _OUTCOMES[self.status["ended"]]

    @cached_property
    def turning(self) -> NDArray[np.bool_] | None:
        """Whether each handle with a free axis also rotates freely (p,); None if no handle does."""
        turning = self.unknowns.turn_row >= 0
        return turning if turning.any() else None

    def place(self, positions: Array, base: Array, slides: Array, turns: Array) -> None:
        """Set the unknowns to the start of a minimisation.

        Args:
            positions: (n, 3) [m] of the free vertices.
            base: (n, 3) [m]; only the rows of handle vertices are read.
            slides: (p, 3) translations [m] of the handles with a free axis.
            turns: (p, 3) rotation vectors [rad] of these handles.
        """
        work, unknowns = self.workspace, self.unknowns
        count = len(unknowns.free)
        work.x[...] = positions
        work.x[unknowns.prescribed] = base[unknowns.prescribed]
        u = work.u.reshape(-1, 3)
        np.take(positions, unknowns.free, axis=0, out=u[:count], mode="clip")
        row, axis = np.divmod(unknowns.fixed, 3)
        u[row, axis] = base[unknowns.free[row], axis]
        u[count : count + len(slides)] = slides * unknowns.slides
        turning = self.turning
        if turning is None:
            return
        u[unknowns.turn_row[turning]] = (turns * unknowns.turns * unknowns.radius[:, None])[turning]

    def rigid_motion(self) -> tuple[Array, Array]:
        """Return the present translations [m] and rotation vectors [rad], (p, 3) each, of handles with a free axis."""
        unknowns, u = self.unknowns, self.workspace.u.reshape(-1, 3)
        count = len(unknowns.free)
        slides, turns = u[count : count + len(unknowns.slides)].copy(), np.zeros_like(unknowns.turns)
        if (turning := self.turning) is not None:
            turns[turning] = u[unknowns.turn_row[turning]] / unknowns.radius[turning, None]
        return slides, turns

    def threads(self, most: int) -> int | None:
        """Return the fastest number of threads, at most ``most``; None stands for the calling thread alone."""
        count = min(most, len(self.blocks.element) // self.LEAST_BLOCKS)
        return count if count > 1 else None


def elements_inside_handles(body: Body) -> NDArray[np.bool_]:
    """Return whether each element (m,) has all its vertices in one handle; such elements move rigidly."""
    inside = np.zeros(len(body.material), dtype=bool)
    for handle in (each for each in body.handles if each.slide is None):
        held = np.zeros(len(body.rest), dtype=bool)
        held[handle.vertices] = True
        inside |= held[body.cells].all(axis=1)
    return inside
