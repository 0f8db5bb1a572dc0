# SPDX-License-Identifier: Apache-2.0
"""How updates of multipliers and normals come to rest: what takes them there, and how far they have yet to move a body.

An update and the descent after it are a map of the forces and normals of pairs to themselves; an equilibrium is its
fixed point. Without friction a body may slide along what it touches: the normals of a surface that is bent turn with
that, all forces turn with them, and the map may well push away from its fixed point. It is therefore extrapolated, and
no single short way proves anything.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.solver.anderson import Anderson
from gdfe_ros.solver.distance import largest_distance

PLAIN = 2
"""Updates of a solve before they are extrapolated, and in a row that tell how fast their ways shrink."""
UNKNOWN = 10.0
"""Way left over the last one while nothing tells how fast ways shrink."""
SLOWEST = 0.95
"""Largest factor from way to way that is believed."""
NORMALS = slice(4, 7)
"""Columns of normals among the forces of pairs."""
LEAST, FIRST = 0.2, 0.5
"""Share of its turn that a normal makes in a plain update: at least, and before any secant is known."""


class Settling:
    """The updates of one solve.

    Args:
        positions: (n, 3) [m] where it begins.

    Attributes:
        left: the last way [m], or what else the last update missed.
    """

    def __init__(self, positions: NDArray[np.float64]) -> None:
        self._mixing, self._updates, self._plain, self._hastened = Anderson(), 0, 0, False
        self._normals: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None
        self._last, self._before, self.left = np.zeros(2), positions.copy(), np.inf

    def way(self, positions: NDArray[np.float64], missed: float) -> float:
        """Return how far [m] the body has yet to go, judged by its last way and by what pairs ``missed`` [m].

        Between plain updates both shrink by factors q: what is left is the last one times q / (1 - q). What is missed
        together by many pairs shrinks slowly, and is much less than what it moves.
        """
        last = np.array([largest_distance(positions, self._before), missed])
        self._plain = 0 if self._hastened else self._plain + 1
        rates = np.minimum(last / np.maximum(self._last, 1e-300), SLOWEST)
        factors = rates / (1.0 - rates) if self._plain >= PLAIN else np.array([UNKNOWN, 1.0])
        self._updates, self._hastened = self._updates + 1, False
        self._normals: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None
        self._last, self._before, self.left = last, positions.copy(), float(last.max())
        return max(self.left, float((factors * last).max()))

    def mixed(self, held: NDArray[np.float64], found: NDArray[np.float64], near: float) -> NDArray[np.float64]:
        """Return what to go on with, from the forces and normals that were ``held`` and ``found`` (k, 7).

        It is extrapolated where more than ``near`` [m] is left. Otherwise it is what was found, with normals that have
        turned by a part of the way where they would go to and fro: plain updates tell how fast ways shrink.
        """
        if not self._last[0] > 0.0:
            return found
        miss = found - held
        mixed, share = self._mixing.next(held.ravel(), miss.ravel()), self._share(held[:, NORMALS], miss[:, NORMALS])
        if self._updates < PLAIN or (self.left <= near and self._plain < PLAIN):
            relaxed = found.copy()
            relaxed[:, NORMALS] = held[:, NORMALS] + share * miss[:, NORMALS]
            return relaxed
        self._hastened = True
        return mixed.reshape(found.shape)

    def _share(self, normals: NDArray[np.float64], miss: NDArray[np.float64]) -> float:
        """Return by what share of what they miss (k, 3) normals (k, 3) come nearest to where they stay: a secant's."""
        before, self._normals = self._normals, (normals.copy(), miss.copy())
        if before is None:
            return FIRST
        step, change = normals - before[0], miss - before[1]
        along, length = -float(np.vdot(step, change)), float(np.vdot(change, change))
        return max(LEAST, along / length) if 0.0 < along < length else 1.0
