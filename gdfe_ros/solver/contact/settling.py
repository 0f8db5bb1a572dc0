# SPDX-License-Identifier: Apache-2.0
"""Anderson acceleration of the contact multipliers, and an estimate of the remaining displacement.

An update and the next minimisation together map the forces and normals of the pairs to new forces and normals. An
equilibrium is a fixed point of this map. Without friction, a surface may slide along the surface that it touches. The
normals of a bent surface then rotate, all forces rotate with them, and the plain map may diverge from its fixed point.
Updates are therefore extrapolated, and one short displacement is no proof of convergence.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.solver.anderson import Anderson
from gdfe_ros.solver.distance import largest_distance

PLAIN = 2
"""Number of plain updates at the beginning of a solve before extrapolation starts, and number of successive plain
updates before a rate of convergence is measured."""
UNKNOWN = 3.0
"""Assumed ratio of the remaining to the last displacement while no rate of convergence is known."""
SLOWEST = 0.95
"""Largest ratio of successive displacements that the estimate uses."""
NORMALS = slice(4, 7)
"""Columns of the normals in the array (k, 7) of the pairs' forces and normals."""
SHARE = 0.5
"""Fraction of a normal's rotation that a plain update applies. Updates then converge, unless such a shortened update
is more than twice as long as the distance to the fixed point.
"""
SWINGING = 0.5
"""Two updates swing if together they move the body by less than this fraction of both displacements."""


class Settling:
    """Convergence of the multiplier updates of one solve.

    Args:
        positions: (n, 3) [m] at the beginning of the solve.
        held: whether friction damps errors that the pairs have in common.

    Attributes:
        left: the larger of the last displacement and the last error of the pairs [m].
        swings: whether two plain updates have reversed each other.
    """

    def __init__(self, positions: NDArray[np.float64], *, held: bool) -> None:
        self._unknown = np.array([UNKNOWN, 1.0 if held else UNKNOWN])
        self._mixing, self._updates, self._plain, self._hastened = Anderson(), 0, 0, False
        self._last, self._before, self._earlier = np.zeros(2), positions.copy(), positions.copy()
        self.left, self.swings = np.inf, False

    def way(self, positions: NDArray[np.float64], missed: float) -> float:
        """Return an estimate of the remaining distance [m], from the last displacement and the error ``missed`` [m].

        Each plain update multiplies the displacement by a factor q, and the error by a factor of its own. The last
        value times q / (1 - q) then remains. The result is the largest of the two last values and the two remaining
        values. An error that many pairs have in common shrinks slowly, and causes a displacement much larger than the
        error. Updates that reverse each other swing about the equilibrium: only what two of them together move remains.
        """
        last = np.array([largest_distance(positions, self._before), missed])
        self._plain = 0 if self._hastened else self._plain + 1
        rates = np.minimum(last / np.maximum(self._last, 1e-300), SLOWEST)
        factors = rates / (1.0 - rates) if self._plain >= PLAIN else self._unknown
        onward, path = largest_distance(positions, self._earlier), last[0] + self._last[0]
        if self._plain >= PLAIN and onward < SWINGING * path:
            factors, self.swings = factors * onward / path, True
        self._updates, self._hastened = self._updates + 1, False
        self._earlier, self._before = self._before, positions.copy()
        self._last, self.left = last, float(last.max())
        return max(self.left, float((factors * last).max()))

    def mixed(self, held: NDArray[np.float64], found: NDArray[np.float64], near: float) -> NDArray[np.float64]:
        """Return the next forces and normals (k, 7), from the values before and after an update (``held``, ``found``).

        The first `PLAIN` updates of a solve are plain. Later updates are extrapolated while more than ``near`` [m]
        remains. If less remains, `PLAIN` successive plain updates measure the rate of convergence. With ``near``
        infinite, all are plain. A plain update returns ``found``, with normals that rotate by `SHARE` only and so do
        not oscillate.
        """
        if not self._last[0] > 0.0:
            return found
        miss = found - held
        mixed = self._mixing.next(held.ravel(), miss.ravel()).reshape(found.shape)
        if self._updates < PLAIN or near == np.inf or (self.left <= near and self._plain < PLAIN):
            mixed = found.copy()
            mixed[:, NORMALS] = held[:, NORMALS] + SHARE * miss[:, NORMALS]
        else:
            self._hastened = True
        return mixed


def parted(
    mixed: NDArray[np.float64], before: NDArray[np.float64], alike: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return normal forces (k,) [N], tangential friction forces (k, 3) [N] and unit normals (k, 3) of ``mixed`` (k, 7).

    A normal keeps its direction from ``before`` (k, 3) if the cosine between old and new direction is below ``alike``.
    """
    press, shear, normal = mixed[:, 0], mixed[:, 1:4], mixed[:, NORMALS]
    length = np.linalg.norm(normal, axis=1)[:, None]
    turned = np.einsum("ki,ki->k", normal, before)[:, None] <= alike * length
    normal = np.where(turned, before, normal / np.where(turned, 1.0, length))
    return press, shear - np.einsum("ki,ki->k", shear, normal)[:, None] * normal, normal
