# SPDX-License-Identifier: Apache-2.0
"""Compiled response of all elements, and the list of elements near folding: only these have fold barriers.

Barriers act below a volume ratio J_0, which sound bodies never reach. A minimisation therefore keeps a list of watched
elements, and evaluates barriers for these alone. At its beginning it examines all elements, and watches those with a
corner below `NEARLY_FOLDED`. Every other corner stays above J_0 while no vertex moves by more than a distance d. With
edges of lengths A, B, C and t = 2 d,

    |J' - J| <= r ((A + t)(B + t)(C + t) - A B C) <= 3 r t (A B + B C + C A)    for t <= A, B, C

where 1 / r is the undeformed triple product. While no vertex has moved farther than the least of these d, every corner
outside of the list is above J_0. After a longer motion, all elements are examined again. The minimised energy thus
always contains all barriers that act, and sound bodies need one examination per solve.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import prange
from numpy.typing import NDArray

from gdfe_ros.compiled import internal, kernel, parallel_kernel
from gdfe_ros.solver.elements.barrier import add_walls, room
from gdfe_ros.solver.elements.cell_type import evaluate_blocks
from gdfe_ros.solver.vectors import Array


class Watch(NamedTuple):
    """The watched elements of a solve; minimisations extend the list.

    Attributes:
        elements: (m,) int32; the first ``count`` are watched.
        count: (1,) int64 number of watched elements.
        member: (m,) bool, whether each element is watched.
        room: (2,) distances [m] that vertices may move before all elements must be examined again: the first from the
            last accepted positions of the minimisation, the second from the positions of the last evaluation.
    """

    elements: NDArray[np.int32]
    count: NDArray[np.int64]
    member: NDArray[np.bool_]
    room: Array

    @classmethod
    def over(cls, elements: int) -> Watch:
        """Return an empty list for a body with this number of ``elements``."""
        numbers, none = np.zeros(elements, dtype=np.int32), np.zeros(elements, dtype=np.bool_)
        return cls(numbers, np.zeros(1, dtype=np.int64), none, np.full(2, -1.0))

    @property
    def watched(self) -> NDArray[np.int32]:
        """The watched elements (k,)."""
        return self.elements[: self.count[0]]


@internal
def look(x, shape, blocks, watch):
    """Add the nearly folded elements of ``blocks`` to the list; return the least `room` [m] of the others at ``x``."""
    scratch, least = np.empty((shape.cells.shape[1], 3)), math.inf
    for block in range(len(blocks.element)):
        for lane in range(blocks.used[block]):
            e = blocks.element[block, lane]
            if watch.member[e]:
                continue
            found = room(x, shape, e, scratch)
            if found > 0.0:
                least = min(least, found)
                continue
            watch.member[e] = True
            watch.elements[watch.count[0]] = e
            watch.count[0] += 1
    return least


@parallel_kernel
def evaluate_in_threads(threads, x, shape, blocks, material, pressure, scale, table, force, energy):
    """Evaluate all blocks by `evaluate_blocks`, with the blocks divided equally among ``threads``."""
    count = len(blocks.element)
    for part in prange(threads):
        first, last = part * count // threads, (part + 1) * count // threads
        evaluate_blocks(first, last, x, shape, blocks, material, pressure, scale, table, force, energy)


@kernel
def evaluate(x, shape, blocks, material, pressure, scale, table, watched, force, energy, threads):
    """Write the corner forces (m, c, 3) [N] and energies (m,) [J] of all elements; return the sum of the energies.

    ``x`` (n, 3) [m] are the positions, and ``pressure`` (m,) [Pa] the multipliers of the volumes. ``scale`` (m,)
    multiplies the initial hourglass stiffness. ``watched`` (k,) int32 are the elements with fold barriers. ``threads``
    is the number of threads; None stands for one thread, without compiling the parallel version. The result is the
    same, bit by bit, for any number of threads.
    """
    if threads is None:
        evaluate_blocks(0, len(blocks.element), x, shape, blocks, material, pressure, scale, table, force, energy)
    else:
        evaluate_in_threads(threads, x, shape, blocks, material, pressure, scale, table, force, energy)
    if len(watched):
        add_walls(x, watched, shape, material, table, force, energy)
    total = 0.0
    for e in range(len(energy)):
        total += energy[e]
    return total
