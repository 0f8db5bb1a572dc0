# SPDX-License-Identifier: Apache-2.0
"""Stability of an equilibrium, and the descent from a saddle of the energy."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.solver.body import Body
from gdfe_ros.solver.descent.minimiser import Task
from gdfe_ros.solver.descent.products import TangentProducts
from gdfe_ros.solver.distance import largest
from gdfe_ros.solver.tangent.curvature import Lowest, lowest

FIRST, DOUBLINGS, SHORTENINGS = 1e-3, 12, 6
"""First length of a step along a direction of negative curvature, divided by the body's size. The other two numbers are
the largest numbers of doublings of this length and of its divisions by four."""
FALL = 1e-9
"""Least relative decrease of the energy along a descent direction; a smaller decrease counts as rounding."""


class Downhill(NamedTuple):
    """A point of lower energy along a direction.

    Attributes:
        unknowns: (3 r,) unknowns.
        positions: (n, 3) vertex positions [m].
    """

    unknowns: NDArray[np.float64]
    positions: NDArray[np.float64]


class Stability:
    """Finds directions along which the energy of an equilibrium has negative curvature.

    Args:
        body: the discretised body.
        softest: (3 r,) the constant matrix times the undeformed body's softest mode, in which bodies often buckle.
    """

    def __init__(self, body: Body, softest: NDArray[np.float64]) -> None:
        self._size, self._product = body.size, TangentProducts(body)
        noise = np.random.default_rng(0).standard_normal(len(softest))
        # The random load is as large as the softest mode's, because buckling may be local. With a tenth of it, the
        # search may converge to the softest mode before it finds a mode of negative curvature.
        self._load = softest + np.linalg.norm(softest) / np.linalg.norm(noise) * noise

    def look(self, task: Task) -> Lowest:
        """Return the softest direction at the unknowns of ``task``, at which all terms must be evaluated.

        The start vector has a random part with a fixed seed, so that it contains all modes. The loads of a perfectly
        symmetric body would not contain the buckling mode.
        """
        with task.turn:
            self._product.begin(task)
            return lowest(self._product, task.precondition, self._load)

    def curvature(self, task: Task, direction: NDArray[np.float64]) -> float:
        """Return the curvature of the energy along a direction (3 r,) that `look` found, now or earlier."""
        with task.turn:
            self._product.begin(task)
            return float(direction @ self._product(direction))

    def leave(self, task: Task, direction: NDArray[np.float64]) -> Downhill | None:
        """Return the point of least energy found along a direction (3 r,); None if the energy does not fall.

        The first length is divided by four until the energy falls. It is then doubled while the energy falls further.
        """
        work = task.active.workspace
        sign = -1.0 if float(work.gradient @ direction) > 0.0 else 1.0
        unit, length, best, found = sign / largest(direction) * direction, FIRST * self._size, np.inf, None
        start = float(task.active.status["energy"])
        least = start - FALL * float(task.active.status["absolute"] + task.active.status["outside"])
        self._product.begin(task)
        for _ in range(SHORTENINGS + DOUBLINGS):
            with task.turn:
                energy = self._product.energy(length * unit)
            if not energy < min(least, best):
                if found is not None:
                    break
                length *= 0.25
                continue
            best, found = energy, Downhill(work.u + length * unit, self._product.positions.copy())
            length *= 2.0
        return found
