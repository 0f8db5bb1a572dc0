# SPDX-License-Identifier: Apache-2.0
"""Compiled sparse Cholesky factors A = U^T U of symmetric matrices of one pattern: multifrontal (Liu 1992).

Each supernode assembles its entries of the matrix and its children's update matrices in a dense front. It eliminates
its own vertices there, and passes the remaining update matrix to its parent. Six columns (two vertices) are eliminated
at a time, always in the same order. A matrix thus has the same factor, bit by bit, with any number of threads. Inner
loops count in unsigned numbers: a possibly negative index would cost a test in each iteration and prevent SIMD.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse
from numpy import uint64
from numpy.typing import NDArray

from gdfe_ros.compiled import inlined, internal, kernel, vector_internal
from gdfe_ros.solver.matrix.elimination import SLACK, dissect, find_elimination, least_degree, narrow_orders
from gdfe_ros.solver.matrix.panels import PANEL, TILE, dot_six, six
from gdfe_ros.solver.matrix.rotation import make_unrotated
from gdfe_ros.solver.matrix.substitution import Kept, Plan, solve_unturned
from gdfe_ros.solver.vectors import Array, clear_part, copy_part


@internal
def gather(blocks, parts, begin, end, front, width):
    """Write a supernode's blocks, out of ``blocks`` (k, s, s), into its front (width, width).

    ``parts`` has, from ``begin`` up to ``end``, the index of each of these blocks, and its row and column in the front.
    """
    for k in range(begin, end):
        block, at = blocks[parts[k, 0]], parts[k, 1] * width + parts[k, 2]
        for i in range(len(block)):
            for j in range(len(block)):
                front[at + i * width + j] = block[i, j]


@vector_internal
def extend(update, start, stride, size, places, ends, front, width):
    """Add the upper triangle of a child's update matrix to the rows and columns of ``places`` (p,) in a front.

    The first row of the update matrix begins at ``start``, and each further one ``stride`` entries later. Consecutive
    places are added as one piece of a row. ``ends`` is scratch: the index at which the piece of each vertex ends.
    """
    count = len(places)
    for a in range(count - 1, -1, -1):
        ends[a] = ends[a + 1] if a + 1 < count and places[a + 1] == places[a] + 1 else a + 1
    for a in range(count):
        first = a
        while first < count:
            for i in range(size):
                begin = size * first + (i if first == a else 0)
                length, to = size * ends[first] - begin, begin + size * (places[first] - first)
                at, line = start + (size * a + i) * stride + begin, (size * places[a] + i) * width + to
                row, sums = update[at : at + length], front[line : line + length]
                for j in range(uint64(length)):
                    sums[j] += row[j]
            first = ends[first]


@vector_internal
def eliminate(front, width, own, panel):
    """Eliminate the first ``own`` columns of a front (upper triangle); return whether all pivots are positive.

    Each row of the factor contains the inverse of its diagonal entry in place of this entry.
    """
    for first in range(0, own, PANEL):
        last = min(first + PANEL, own)
        for k in range(first, last):
            row = front[k * width : (k + 1) * width]
            for above in range(first, k):
                other = front[above * width : (above + 1) * width]
                weight = other[k]
                for j in range(uint64(k), uint64(width)):
                    row[j] -= weight * other[j]
            if not row[k] > 0.0:
                return False
            scale = front.dtype.type(1.0) / np.sqrt(row[k])
            for j in range(uint64(k + 1), uint64(width)):
                row[j] *= scale
            row[k] = scale
        subtract(front, width, first, last, panel)
    return True


@inlined
def column(front, at, width, count):
    """Return six numbers: ``count`` entries of a column of the front from the index ``at`` downward, then zeros."""
    none = front.dtype.type(0.0)
    return (
        front[at],
        front[at + width] if count > 1 else none,
        front[at + 2 * width] if count > 2 else none,
        front[at + 3 * width] if count > 3 else none,
        front[at + 4 * width] if count > 4 else none,
        front[at + 5 * width] if count > 5 else none,
    )


@vector_internal
def subtract(front, width, first, last, panel):
    """Update the rows below the factor's rows from ``first`` up to ``last``: subtract their products, tile by tile.

    Two rows are updated at a time, because they share the loads of the factor's rows. Entries below the diagonal are
    changed, too, but never used.
    """
    next_row, count = uint64(TILE), last - first
    for begin in range(last, width, TILE):
        end = min(begin + TILE, width)
        for k in range(PANEL):
            if first + k < last:
                copy_part(panel, k * TILE, front, (first + k) * width + begin, end - begin)
            else:
                clear_part(panel, k * TILE, end - begin)
        for i in range(last, end, 2):
            at, pair = first * width + i, i + 1 < end
            upper, under = column(front, at, width, count), column(front, at + pair, width, count)
            row = front[i * width + begin : i * width + end]
            low = front[(i + 1) * width + begin : (i + 1) * width + end] if pair else panel[PANEL * TILE :]
            for j in range(uint64(max(i, begin) - begin), uint64(end - begin)):
                taken = six(panel, j, next_row)
                row[j] -= dot_six(upper, taken)
                low[j] -= dot_six(under, taken)


@kernel
def factor_fronts(blocks, parts, plan, fronts, panel, ends, stack, values):
    """Write the factor's rows to ``values``; return whether the matrix is positive definite.

    The update matrix of a supernode stays in its front if the parent is factored next; otherwise it is kept on the
    ``stack`` until the parent uses it.
    """
    top, before, wide, done, size = 0, fronts[0], 0, 0, blocks.shape[1]
    for node in range(len(plan.first) - 1):
        width = size * (plan.row_start[node + 1] - plan.row_start[node])
        own = size * (plan.first[node + 1] - plan.first[node])
        front = fronts[node % 2]
        for i in range(width):
            clear_part(front, i * width + i, width - i)
        gather(blocks, parts, plan.part_start[node], plan.part_start[node + 1], front, width)
        for k in range(plan.child_start[node + 1] - 1, plan.child_start[node] - 1, -1):
            child = plan.children[k]
            beyond = plan.row_start[child] + plan.first[child + 1] - plan.first[child]
            places = plan.inside[beyond : plan.row_start[child + 1]]
            if child == node - 1:
                extend(before, done * wide + done, wide, size, places, ends, front, width)
            else:
                top -= (size * len(places)) ** 2
                extend(stack, top, size * len(places), size, places, ends, front, width)
        if not eliminate(front, width, own, panel):
            return False
        at, left = plan.value_start[node], width - own
        copy_part(values, at, front, 0, own * width)
        before, wide, done = front, width, own
        if plan.parent[node] != node + 1:
            for i in range(left):
                copy_part(stack, top + i * left + i, front, (own + i) * width + own + i, left - i)
            top += left * left
    return True


class Fronts:
    """Factors matrices of one pattern in succession, and solves with the last factor.

    Args:
        graph: (f, f) symmetric pattern with an entry for each block (s, s) of the matrices, in the order of the blocks.
        points: (f, 3) positions of the vertices [m].
        size: number s of a vertex' rows: 3, or 1 for a matrix that acts on x, y and z alike.
        slack: largest fraction of zeros in a supernode.
        kind: precision in which the factor is stored; the factor is always computed in double precision.

    Attributes:
        price: cost of a factorisation, divided by the cost of a solution with the factor.
        operations: number of multiplications of a factorisation.
        memory: bytes of the factor and of the scratch arrays.
        kept: the last factor.
    """

    def __init__(
        self,
        graph: sparse.csr_matrix,
        points: Array,
        *,
        size: int = 3,
        slack: float = SLACK,
        kind: type[np.floating] = np.float32,
    ) -> None:
        orders = *narrow_orders(graph, points), least_degree(graph), dissect(graph, points)
        found = find_elimination(graph, orders, slack=slack)
        widths, heights = found.widths, found.heights
        self.price = round(size * found.work / max(1, 8 * found.entries))
        room = size * int(heights.max(initial=0))
        inner = found.parent >= 0
        children = np.argsort(found.parent, kind="stable")[np.sum(~inner) :]
        taken, row, place, part_start = found.parts(graph)
        self._parts = np.stack([taken, size * row, size * place], axis=1)
        self._plan = Plan(
            found.first,
            found.row_start,
            found.rows,
            found.inside(),
            children,
            _starts(np.bincount(found.parent[inner], minlength=len(widths))),
            found.parent,
            part_start,
            _starts(size**2 * widths * heights),
        )
        left = (size * (heights - widths)) ** 2
        taken = np.bincount(found.parent[inner], weights=left[inner], minlength=len(widths)).astype(np.int64)
        self._room, self._height = room, int(np.cumsum(left - taken).max(initial=0))
        self.operations = size**3 * int(found.work)
        self._kind = np.dtype(kind)
        self.memory = self._kind.itemsize * int(self._plan.value_start[-1]) + 8 * (2 * room**2 + self._height)
        self._ends = np.empty(room, np.int64)
        count = len(found.order)
        given = {"plan": self._plan, "order": found.order, "values": np.empty(0, kind)}
        self.kept = Kept.none()._replace(**given, harmonic=np.zeros((3 * count, 0)), frames=make_unrotated(count))
        self._fronts = self._panel = self._stack = np.empty(0)

    def factor(self, blocks: Array) -> bool:
        """Factor a matrix of blocks (k, s, s); return whether it is positive definite: otherwise, it has no factor."""
        if not len(self.kept.values):
            # Zeros, because parts that are never written are copied and cast, too.
            self._fronts, self._panel = np.zeros((2, self._room**2)), np.zeros((PANEL + 1) * TILE)
            self._stack = np.zeros(self._height)
            self.kept = self.kept._replace(values=np.zeros(self._plan.value_start[-1], self._kind))
        return factor_fronts(
            blocks, self._parts, self._plan, self._fronts, self._panel, self._ends, self._stack, self.kept.values
        )

    def spare(self) -> None:
        """Give the next factorisation new arrays, so that it does not overwrite the last factor."""
        self.kept = self.kept._replace(values=np.empty(0, self._kind), frames=self.kept.frames.copy())


def unturned_solutions(kept: Kept, right: Array) -> Array:
    """Return the solutions (3 f + q, k) for right-hand sides (3 f + q, k), computed by `solve_unturned`."""
    solutions = np.empty(right.shape[::-1])
    solve_unturned(kept, np.ascontiguousarray(right.T), solutions)
    return solutions.T


def _starts(counts: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
