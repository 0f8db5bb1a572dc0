# SPDX-License-Identifier: Apache-2.0
"""The kept tangent stiffness, part of the state, and its springs, which couple vertices that no element couples.

A commanded cable length and a commanded chamber volume act like springs. The length of a spring is linear in small
displacements: d = a . x. A spring of stiffness k adds k a a^T to the tangent. These entries may couple any vertices,
and would fill the factor. The rows sqrt(k) a of all springs therefore form a separate matrix G, with
which `substitution` corrects the solutions of the factor without springs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.solver.matrix.unknowns import Unknowns


class Springs(NamedTuple):
    """Springs, each between any number of vertices; one entry for each vertex of a spring.

    Attributes:
        row: (e,) int32 index of each entry's spring, ascending from 0.
        ends: (e,) int32 vertex of each entry.
        ways: (e, 3) [(N/m)^(1/2)] square root of the spring's stiffness times d(length)/d(position of the vertex).
    """

    row: NDArray[np.int32]
    ends: NDArray[np.int32]
    ways: NDArray[np.float64]

    @classmethod
    def none(cls) -> Springs:
        """Return an empty set of springs."""
        return _NONE

    @classmethod
    def between(cls, ends: NDArray[np.int32], ways: NDArray[np.float64]) -> Springs:
        """Return springs between equal numbers of vertices ``ends`` (m, c), with ``ways`` (m, c, 3)."""
        row = np.repeat(np.arange(len(ends), dtype=np.int32), ends.shape[1])
        return cls(row, ends.ravel().astype(np.int32), ways.reshape(-1, 3))

    @property
    def count(self) -> int:
        """Number m of springs."""
        return int(self.row[-1]) + 1 if len(self.row) else 0

    def alike(self, other: Springs) -> bool:
        """Return whether two sets of springs connect the same vertices."""
        return np.array_equal(self.row, other.row) and np.array_equal(self.ends, other.ends)

    @classmethod
    def joined(cls, parts: Sequence[Springs]) -> Springs:
        """Return the springs of several terms."""
        some = [part for part in parts if part.count]
        if len(some) < 2:
            return some[0] if some else _NONE
        first = np.cumsum([0, *(part.count for part in some[:-1])], dtype=np.int32)
        rows = [part.row + begin for part, begin in zip(some, first, strict=True)]
        return cls(np.concatenate(rows), *(np.concatenate([part[k] for part in some]) for k in (1, 2)))


_NONE = Springs(*np.zeros((2, 0), dtype=np.int32), np.zeros((0, 3)))


def spring_rows(springs: Springs, unknowns: Unknowns, motion: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the matrix G (m, 3 r) of springs, in the unknowns.

    Args:
        springs: the springs.
        unknowns: the numbering of the unknowns.
        motion: (3 b, 3 q) d(vertices of handles with a free axis)/d(rigid rows).
    """
    free, members = len(unknowns.free), len(unknowns.members)
    place = np.full(max(int(part.max(initial=0)) for part in (springs.ends, unknowns.free, unknowns.members)) + 1, -1)
    place[unknowns.free], place[unknowns.members] = np.arange(free), free + np.arange(members)
    rows, places = np.zeros((springs.count, free + members, 3)), place[springs.ends]
    moves = places >= 0
    np.add.at(rows, (springs.row[moves], places[moves]), springs.ways[moves])
    flat = rows.reshape(len(rows), 3 * (free + members))
    own = flat[:, : 3 * free]
    own[:, unknowns.fixed] = 0.0
    return np.hstack([own, flat[:, 3 * free :] @ motion]) if motion.size else np.ascontiguousarray(own)


@dataclass(frozen=True, eq=False, kw_only=True)
class Tangent:
    """A kept tangent stiffness; an immutable value.

    Attributes:
        blocks: (k, 3, 3) [N/m] blocks of coupled pairs of vertices; the part of the free vertices is positive definite.
        motion: (3 b, 3 q) d(vertices of handles with a free axis)/d(rigid rows).
        positions: (n, 3) [m] at which the tangent was taken; None for the constant matrix, which does not follow
            rotations.
        shift: multiple of the constant matrix that was added for definiteness.
        row, ends, ways: arrays of the springs, as in `Springs`.
        stages: (t,) int32 stages of the terms (`Term.stage`); empty if all are 0.
        spent: number of iterations since the tangent was evaluated.
        solves: number of solves with the tangent.
        latest: the part of ``spent`` in the last of these solves.
    """

    blocks: NDArray[np.float64]
    motion: NDArray[np.float64]
    positions: NDArray[np.float64] | None = None
    shift: float = 0.0
    row: NDArray[np.int32] = field(default_factory=lambda: Springs.none().row)
    ends: NDArray[np.int32] = field(default_factory=lambda: Springs.none().ends)
    ways: NDArray[np.float64] = field(default_factory=lambda: Springs.none().ways)
    stages: NDArray[np.int32] = field(default_factory=lambda: np.zeros(0, np.int32))
    spent: int = 0
    solves: int = 0
    latest: int = 0

    def overdue(self, cost: float) -> bool:
        """Return whether a new tangent that costs as much as ``cost`` iterations lowers the mean cost of a solve."""
        return self.latest * self.solves > cost + self.spent

    @property
    def springs(self) -> Springs:
        """The springs."""
        return Springs(self.row, self.ends, self.ways)
