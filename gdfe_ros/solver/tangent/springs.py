# SPDX-License-Identifier: Apache-2.0
"""Springs between touching parts of a body in a kept tangent: there are few, and they may connect any vertices.

The length of a spring is linear in the positions: d = a . x. A spring of stiffness k adds k a a^T to the tangent. These
entries may couple any vertices, and would fill the factor. The rows sqrt(k) a of all springs therefore form a separate
matrix G, with which `substitution` corrects the solutions of the factor without springs.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.solver.matrix.unknowns import Unknowns


class Springs(NamedTuple):
    """Springs between vertices.

    Attributes:
        ends: (m, c) int32 vertices that each spring connects.
        ways: (m, c, 3) [(N/m)^(1/2)] square root of each spring's stiffness times d(length)/d(position of each end).
    """

    ends: NDArray[np.int32]
    ways: NDArray[np.float64]

    @classmethod
    def none(cls) -> Springs:
        """Return an empty set of springs."""
        return cls(np.zeros((0, 1), dtype=np.int32), np.zeros((0, 1, 3)))

    @classmethod
    def joined(cls, parts: Sequence[Springs]) -> Springs:
        """Return the springs of several terms, which must have equal numbers of ends."""
        some = [part for part in parts if len(part.ends)]
        return cls(*(np.concatenate(arrays) for arrays in zip(*some, strict=True))) if some else cls.none()


def spring_rows(springs: Springs, unknowns: Unknowns, motion: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the matrix G (m, 3 r) of springs, in the unknowns.

    Args:
        springs: the springs.
        unknowns: the numbering of the unknowns.
        motion: (3 b, 3 q) d(vertices of handles with a free axis)/d(rigid rows).
    """
    count, free, members = len(springs.ends), len(unknowns.free), len(unknowns.members)
    row = np.full(max(int(part.max(initial=0)) for part in (springs.ends, unknowns.free, unknowns.members)) + 1, -1)
    row[unknowns.free], row[unknowns.members] = np.arange(free), free + np.arange(members)
    rows = np.zeros((count, free + members, 3))
    places, ends = row[springs.ends], np.arange(count)[:, None]
    moves = places >= 0
    np.add.at(rows, (np.broadcast_to(ends, places.shape)[moves], places[moves]), springs.ways[moves])
    flat = rows.reshape(count, -1)
    own = flat[:, : 3 * free]
    return np.hstack([own, flat[:, 3 * free :] @ motion]) if motion.size else np.ascontiguousarray(own)
