# SPDX-License-Identifier: Apache-2.0
"""Orders of a body's vertices that give its matrices a narrow band, or little fill."""

from __future__ import annotations

import math

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray
from scipy.sparse.csgraph import reverse_cuthill_mckee
from scipy.sparse.linalg import spilu

LEAF = 60
"""A part with at most this number of vertices is not divided further."""
DIGITS = 6
"""Coordinates, divided by the largest of them, are rounded to this number of decimal digits. The vertices of one
cross-section thus have equal coordinates.
"""


def narrow_order(graph: sparse.csr_matrix, points: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return an order (f,) of the vertices with a small bandwidth.

    Two kinds of orders are compared, and the order of least bandwidth is returned: by cross-sections along a principal
    axis, and reverse Cuthill-McKee. For straight bodies, the first has half the bandwidth of the second.

    Args:
        graph: (f, f), an entry for every two vertices that share an element.
        points: (f, 3) [m].
    """
    if not len(points):
        return np.zeros(0, np.int64)
    centred = points - points.mean(axis=0)
    along = centred @ np.linalg.svd(centred, full_matrices=False)[2].T
    along = np.round(along / max(float(np.abs(along).max()), 1e-300), DIGITS)
    orders = [np.lexsort((along[:, (k + 2) % 3], along[:, (k + 1) % 3], along[:, k])) for k in range(3)]
    orders.append(reverse_cuthill_mckee(graph, symmetric_mode=True).astype(np.int64))
    return min(orders, key=lambda order: spread(graph, order))


def least_degree(graph: sparse.csr_matrix) -> NDArray[np.int64]:
    """Return the minimum-degree order (f,) of SuperLU; it suits bodies that branch.

    The incomplete factorisation drops all entries: its order is that of the complete one, which costs many times as
    much.
    """
    links = sparse.csr_matrix((np.ones(len(graph.indices)), graph.indices, graph.indptr), shape=graph.shape)
    definite = (sparse.diags_array(np.diff(graph.indptr) + 1.0) - links).tocsc()
    dropped = {"drop_tol": math.inf, "drop_rule": "basic", "fill_factor": 1.0}
    given = {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}}
    return np.argsort(spilu(definite, **dropped, **given).perm_c)


def dissected(graph: sparse.csr_matrix, points: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return an order (f,) by nested dissection (George 1973): both halves first, then their separator.

    A body is halved across its longest axis. The separator consists of those vertices of one half that have neighbours
    in the other half; of these two sets it is the smaller one. With quadratic cells, one of them may be twice as large.
    If a cross-section has thousands of vertices, this order causes far less fill than a narrow order.

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


def spread(graph: sparse.csr_matrix, order: NDArray[np.int64]) -> int:
    """Return the half bandwidth of an order: the largest difference of the positions of two neighbours in it."""
    rank = np.empty(len(order), np.int64)
    rank[order] = np.arange(len(order))
    rows = np.repeat(np.arange(len(order)), np.diff(graph.indptr))
    return int(np.abs(rank[rows] - rank[graph.indices]).max(initial=0))
