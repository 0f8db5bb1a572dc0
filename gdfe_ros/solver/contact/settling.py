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
UNKNOWN = 3.0
"""Way left over the last one while nothing tells how fast ways shrink."""
SLOWEST = 0.95
"""Largest factor from way to way that is believed."""
NORMALS = slice(4, 7)
"""Columns of normals among the forces of pairs."""
SHARE = 0.5
"""Of its turn that a normal makes in a plain update: the map then leads to its fixed point, unless it overshoots by
more than twice."""
SWINGING, MOST_SWINGS = 0.5, 8
"""Share of the last update that an update takes back where the two count as going to and fro, and how often in a row
they may before they are damped."""
SHORTER, LEAST = 0.5, 1.0 / 256.0
"""Factor by which the share of an update that is made shrinks at a swing, and its least value."""


class Damping:
    """Shortens updates of forces that go to and fro.

    What friction holds follows what presses. Where friction is strong, what it holds lifts the body as well: what
    presses is gone after the next update, then what friction holds, and all begins again. A part of each update leads
    to the point between.
    """

    def __init__(self) -> None:
        self._last: NDArray[np.float64] | None = None
        self._swings, self._share = 0, 1.0

    def shortened(self, held: NDArray[np.float64], found: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the forces to go on with, from those that were ``held`` and ``found`` (k, 4) [N]."""
        change, last = found - held, self._last
        self._last = change
        if last is None or last.shape != change.shape:
            return found
        swings = np.vdot(last, change) < -SWINGING * np.vdot(last, last)
        self._swings = self._swings + 1 if swings else 0
        if self._share == 1.0 and self._swings < MOST_SWINGS:
            return found
        self._share = max(LEAST, SHORTER * self._share) if swings else self._share
        return held + self._share * change


class Settling:
    """The updates of one solve.

    Args:
        positions: (n, 3) [m] where it begins.
        held: friction holds what pairs miss together.

    Attributes:
        left: the last way [m], or what else the last update missed.
    """

    def __init__(self, positions: NDArray[np.float64], *, held: bool) -> None:
        self._unknown = np.array([UNKNOWN, 1.0 if held else UNKNOWN])
        self._mixing, self._updates, self._plain, self._hastened = Anderson(), 0, 0, False
        self._last, self._before, self.left = np.zeros(2), positions.copy(), np.inf

    def way(self, positions: NDArray[np.float64], missed: float) -> float:
        """Return how far [m] the body has yet to go, judged by its last way and by what pairs ``missed`` [m].

        Between plain updates both shrink by factors q: what is left is the last one times q / (1 - q). What is missed
        together by many pairs shrinks slowly, and is much less than what it moves.
        """
        last = np.array([largest_distance(positions, self._before), missed])
        self._plain = 0 if self._hastened else self._plain + 1
        rates = np.minimum(last / np.maximum(self._last, 1e-300), SLOWEST)
        factors = rates / (1.0 - rates) if self._plain >= PLAIN else self._unknown
        self._updates, self._hastened = self._updates + 1, False
        self._last, self._before, self.left = last, positions.copy(), float(last.max())
        return max(self.left, float((factors * last).max()))

    def mixed(self, held: NDArray[np.float64], found: NDArray[np.float64], near: float) -> NDArray[np.float64]:
        """Return what to go on with, from the forces and normals that were ``held`` and ``found`` (k, 7).

        It is extrapolated where more than ``near`` [m] is left. Otherwise it is what was found, with normals that have
        turned by a part of the way, lest they go to and fro: plain updates tell how fast ways shrink.
        """
        if not self._last[0] > 0.0:
            return found
        miss = found - held
        mixed = self._mixing.next(held.ravel(), miss.ravel()).reshape(found.shape)
        if self._updates < PLAIN or (self.left <= near and self._plain < PLAIN):
            mixed = found.copy()
            mixed[:, NORMALS] = held[:, NORMALS] + SHARE * miss[:, NORMALS]
        else:
            self._hastened = True
        return mixed


def parted(
    mixed: NDArray[np.float64], before: NDArray[np.float64], alike: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return presses (k,), shears in the planes of contact (k, 3) [N] and unit normals (k, 3) of what was mixed (k, 7).

    Normals whose cosine with those ``before`` (k, 3) is less than ``alike`` stay.
    """
    press, shear, normal = mixed[:, 0], mixed[:, 1:4], mixed[:, NORMALS]
    length = np.linalg.norm(normal, axis=1)[:, None]
    turned = np.einsum("ki,ki->k", normal, before)[:, None] <= alike * length
    normal = np.where(turned, before, normal / np.where(turned, 1.0, length))
    return press, shear - np.einsum("ki,ki->k", shear, normal)[:, None] * normal, normal
