# SPDX-License-Identifier: Apache-2.0
"""Symbolic elimination of a sparse symmetric matrix: its elimination tree and supernodes, and orders of its vertices.

Successive columns of the factor with the same row pattern form one supernode, a dense rectangle (Liu, Ng and Peyton
1993). A supernode contributes to its ancestors in the elimination tree (Liu 1990). Rows and columns are vertices.
Their order gives a narrow band, or little fill.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray
from scipy.sparse.csgraph import reverse_cuthill_mckee
from scipy.sparse.linalg import spilu

from gdfe_ros.compiled import kernel
from gdfe_ros.solver.vectors import Array, copy_part

SLACK, NARROW = 0.05, 2
"""Largest fraction of zeros in a supernode; supernodes of at most the second number of columns may have more zeros.
Fewer and broader supernodes are faster if the matrix is factored often.
"""
FRONT = 2000
"""Fixed cost of each supernode, as a number of multiplications."""


class Elimination(NamedTuple):
    """Supernodes of a matrix (f, f), children before their parents.

    Attributes:
        order: (f,) vertices in the order of their elimination.
        first: (s + 1,) position in the order at which each supernode begins.
        rows: (r,) positions in the order of the rows of all supernodes; ascending for each supernode, so that its own
            vertices come first.
        row_start: (s + 1,) index at which each supernode's rows begin.
        parent: (s,) index of each supernode's parent, the first supernode to which it contributes; -1 for none.
    """

    order: NDArray[np.int64]
    first: NDArray[np.int64]
    rows: NDArray[np.int64]
    row_start: NDArray[np.int64]
    parent: NDArray[np.int64]

    @property
    def entries(self) -> int:
        """Number of entries of the factor."""
        return int(self.widths @ self.heights)

    @property
    def work(self) -> int:
        """Number of multiplications of a factorisation, up to a constant factor."""
        return int(self.widths @ self.heights**2)

    @property
    def widths(self) -> NDArray[np.int64]:
        """Number (s,) of own vertices, or columns, of each supernode."""
        return np.diff(self.first)

    @property
    def heights(self) -> NDArray[np.int64]:
        """Number (s,) of each supernode's rows."""
        return np.diff(self.row_start)

    @property
    def owner(self) -> NDArray[np.int64]:
        """Index (r,) of the supernode of each row in ``rows``."""
        return np.repeat(np.arange(len(self.parent)), self.heights)

    def stand(self, nodes: NDArray[np.int64], rows: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the index (k,) of each of ``rows`` (k,) among all rows of its supernode, given in ``nodes`` (k,)."""
        size = len(self.order)
        return np.searchsorted(self.owner * size + self.rows, nodes * size + rows) - self.row_start[nodes]

    def parts(self, graph: sparse.csr_matrix) -> tuple[NDArray[np.int64], ...]:
        """Return the entries of the matrix' upper triangle, sorted by the supernode that assembles them.

        Returns:
            For each entry (k,), its index among the graph's entries, and its row and column in the supernode's front;
            then the offset of each supernode's entries (s + 1,).
        """
        rank = np.argsort(self.order)
        row, column = rank[np.repeat(np.arange(graph.shape[0]), np.diff(graph.indptr))], rank[graph.indices]
        taken = np.flatnonzero(row <= column)
        owner = np.searchsorted(self.first, row[taken], side="right") - 1
        by_owner = np.argsort(owner, kind="stable")
        taken, owner = taken[by_owner], owner[by_owner]
        begin = np.searchsorted(owner, np.arange(len(self.first)))
        return taken, row[taken] - self.first[owner], self.stand(owner, column[taken]), begin

    def inside(self) -> NDArray[np.int64]:
        """Return the index of each row (r,) among the rows of its supernode's parent; -1 for a supernode's own rows."""
        owner = self.owner
        upper = self.parent[owner]
        beyond = (self.rows >= self.first[owner + 1]) & (upper >= 0)
        found = np.full(len(self.rows), -1)
        found[beyond] = self.stand(upper[beyond], self.rows[beyond])
        return found


@kernel
def elimination_tree(indptr, indices, order, rank):
    """Return the parent (f,) of each column in the elimination tree; -1 for a root. ``rank`` inverts ``order``."""
    parent, ancestor = np.full(len(order), -1), np.full(len(order), -1)
    for column in range(len(order)):
        vertex = order[column]
        for k in range(indptr[vertex], indptr[vertex + 1]):
            row = rank[indices[k]]
            while row != -1 and row < column:
                above = ancestor[row]
                ancestor[row] = column
                if above == -1:
                    parent[row] = column
                row = above
    return parent


@kernel
def postorder(parent):
    """Return the columns (f,) in postorder: each subtree's columns are consecutive, children first."""
    count = len(parent)
    child, sibling = np.full(count, -1), np.full(count, -1)
    for column in range(count - 1, -1, -1):
        if parent[column] >= 0:
            sibling[column] = child[parent[column]]
            child[parent[column]] = column
    order, stack, found = np.empty(count, np.int64), np.empty(count, np.int64), 0
    for root in range(count):
        if parent[root] >= 0:
            continue
        depth = 1
        stack[0] = root
        while depth > 0:
            column = stack[depth - 1]
            if child[column] >= 0:
                stack[depth] = child[column]
                child[column] = sibling[child[column]]
                depth += 1
            else:
                depth -= 1
                order[found] = column
                found += 1
    return order


@kernel
def column_heights(indptr, indices, order, rank, parent):
    """Return the number (f,) of entries of each column of the factor, its diagonal included."""
    height, mark = np.ones(len(order), np.int64), np.full(len(order), -1)
    for row in range(len(order)):
        mark[row] = row
        for k in range(indptr[order[row]], indptr[order[row] + 1]):
            column = rank[indices[k]]
            while column < row and mark[column] != row:
                height[column] += 1
                mark[column] = row
                column = parent[column]
    return height


@kernel
def merge(parent, height, slack, narrow):
    """Return the first column of each supernode (s + 1,), and its number of rows (s,).

    A supernode is merged with its parent if the supernode directly precedes the parent and the result stores few zeros.
    """
    count = len(parent)
    first, last = np.empty(count, np.int64), np.empty(count, np.int64)
    rows, full = np.empty(count, np.int64), np.empty(count, np.int64)
    found, column = 0, 0
    while column < count:
        first[found], rows[found], full[found] = column, height[column], height[column]
        while column + 1 < count and parent[column] == column + 1 and height[column + 1] == height[column] - 1:
            column += 1
            full[found] += height[column]
        last[found] = column
        found += 1
        column += 1
        while found > 1:
            low, high = found - 2, found - 1
            if parent[last[low]] < first[high] or parent[last[low]] > last[high]:
                break
            width = last[high] - first[low] + 1
            tall = last[low] - first[low] + 1 + rows[high]
            stored = width * tall - width * (width - 1) // 2
            if width > narrow and stored - full[low] - full[high] > slack * stored:
                break
            last[low], rows[low], full[low] = last[high], tall, full[low] + full[high]
            found -= 1
    starts = np.empty(found + 1, np.int64)
    copy_part(starts, 0, first, 0, found)
    starts[found] = count
    return starts, rows[:found].copy()


def supernodes(
    graph: sparse.csr_matrix, order: NDArray[np.int64], slack: float
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Return the supernodes of a symmetric graph (f, f) whose vertices are eliminated in an order (f,).

    Returns:
        The order, in which subtrees of the elimination tree are now consecutive; the parent (f,) of each column in this
        tree, -1 for a root; the position (s + 1,) at which each supernode begins; the number (s,) of its rows.
    """
    indptr, indices = graph.indptr.astype(np.int64), graph.indices.astype(np.int64)
    order = order[postorder(elimination_tree(indptr, indices, order, np.argsort(order)))]
    rank = np.argsort(order)
    parent = elimination_tree(indptr, indices, order, rank)
    return order, parent, *merge(parent, column_heights(indptr, indices, order, rank, parent), slack, NARROW)


def find_elimination(
    graph: sparse.csr_matrix, orders: Sequence[NDArray[np.int64]], *, slack: float = SLACK
) -> Elimination:
    """Return the elimination of a symmetric graph (f, f) in the order (f,) with the least cost, out of several orders.

    Two supernodes are merged if at most the fraction ``slack`` of the merged entries are zeros.
    """

    def cost(found: tuple[NDArray[np.int64], ...]) -> int:
        _, _, first, heights = found
        return int(np.diff(first) @ heights**2) + FRONT * len(heights)

    order, parent, first, heights = min((supernodes(graph, order, slack) for order in orders), key=cost)
    rank, ends, sorted_graph = np.argsort(order), first[1:], graph[order]
    upper = parent[ends - 1]
    above = np.where(upper < 0, -1, np.searchsorted(ends, upper, side="right"))
    rows: list[NDArray[np.int64]] = []
    children: dict[int, list[int]] = defaultdict(list)
    for node, (begin, end) in enumerate(pairwise(first)):
        near = sorted_graph.indices[sorted_graph.indptr[begin] : sorted_graph.indptr[end]]
        below = [rows[child] for child in children.pop(node, [])]
        own = np.unique(np.concatenate([np.arange(begin, end), rank[near], *below]))
        rows.append(own[own >= begin])
        children[int(above[node])].append(node)
    row_start = np.concatenate([[0], np.cumsum(heights)])
    return Elimination(order, first, np.concatenate([np.zeros(0, np.int64), *rows]), row_start, above)


LEAF, DIGITS = 60, 6
"""`dissect` does not divide a part with at most the first number of vertices. `narrow_orders` rounds coordinates,
divided by the largest of them, to the second number of decimal digits, so that the vertices of a cross-section have
equal coordinates.
"""


def narrow_orders(graph: sparse.csr_matrix, points: Array) -> list[NDArray[np.int64]]:
    """Return orders (f,) of the vertices with a small bandwidth.

    The first order follows the cross-sections along the longest principal axis; the second is reverse Cuthill-McKee.
    For straight bodies, the first order has half the bandwidth of the second.

    Args:
        graph: (f, f), an entry for every two vertices that share an element.
        points: (f, 3) [m].
    """
    if not len(points):
        return []
    centred = points - points.mean(axis=0)
    along = centred @ np.linalg.svd(centred, full_matrices=False)[2].T
    along = np.round(along / max(float(np.abs(along).max()), 1e-300), DIGITS)
    return [np.lexsort(along.T[::-1]), reverse_cuthill_mckee(graph, symmetric_mode=True).astype(np.int64)]


def least_degree(graph: sparse.csr_matrix) -> NDArray[np.int64]:
    """Return the minimum-degree order (f,) of SuperLU; it suits bodies that branch.

    The order comes from an incomplete factorisation that drops all entries. A complete factorisation has the same order
    at many times the cost.
    """
    links = sparse.csr_matrix((np.ones(len(graph.indices)), graph.indices, graph.indptr), shape=graph.shape)
    definite = (sparse.diags_array(np.diff(graph.indptr) + 1.0) - links).tocsc()
    dropped = {"drop_tol": math.inf, "drop_rule": "basic", "fill_factor": 1.0}
    given = {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}}
    return np.argsort(spilu(definite, **dropped, **given).perm_c)


def dissect(graph: sparse.csr_matrix, points: Array) -> NDArray[np.int64]:
    """Return an order (f,) by nested dissection (George 1973): both halves first, then their separator.

    A body is halved across its longest axis. In each half, some vertices have neighbours in the other half. The smaller
    of these two sets is the separator. With quadratic cells, one set may be twice as large as the other. If a
    cross-section has thousands of vertices, this order causes far less fill than a narrow order.

    Args:
        graph: (f, f), an entry for every two vertices that share an element.
        points: (f, 3) [m].
    """
    order, side = np.empty(len(points), np.int64), np.zeros(len(points), np.int8)
    links = sparse.csr_matrix((np.ones(len(graph.indices), np.int32), graph.indices, graph.indptr), shape=graph.shape)
    parts = [(np.arange(len(points)), 0)]
    while parts:
        ids, begin = parts.pop()
        along = points[ids, np.argmax(np.ptp(points[ids], axis=0))] if len(ids) > LEAF else np.zeros(len(ids))
        low = along < np.median(along) if len(ids) else np.zeros(0, bool)
        if not low.any():
            order[begin : begin + len(ids)] = ids[np.lexsort(points[ids].T)]
            continue
        lower, upper = ids[low], ids[~low]
        side[lower], side[upper] = 1, -1
        above, below = links[upper] @ (side > 0) > 0, links[lower] @ (side < 0) > 0
        side[ids] = 0
        if below.sum() < above.sum():
            middle, lower = lower[below], lower[~below]
        else:
            middle, upper = upper[above], upper[~above]
        end = begin + len(ids)
        order[end - len(middle) : end] = middle
        parts += [(lower, begin), (upper, begin + len(lower))]
    return order
