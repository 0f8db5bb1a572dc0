# SPDX-License-Identifier: Apache-2.0
"""Second derivative of the energy -p V of a chamber with pressure p, one block per quad of its walls."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.actuators.actuator import Mode
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.terms.chamber import EFFORT, ChamberTerm, push
from gdfe_ros.solver.terms.term import Term

STEP = 1e-3
"""Displacement in a central difference, divided by the body's size. Forces are quadratic in the positions, so that the
difference is exact.
"""


class PressedWalls(Term):
    """A chamber of given pressure with its full tangent, which is indefinite; minimisations do not use it.

    Args:
        chamber: the chamber's term.
        body: the body around the chamber.
    """

    def __init__(self, chamber: ChamberTerm, body: Body) -> None:
        super().__init__(chamber.name, chamber.reals, chamber.integers)
        self._chamber, self._step = chamber, STEP * body.size
        actuator = chamber.actuator
        self._points, self._quads = actuator.points, actuator.quads

    def couplings(self) -> NDArray[np.int32]:
        """Return the vertices that carry the corners of each quad (q, 4 or 32)."""
        if self._points is None:
            return self._quads
        return self._points.corners[self._quads].reshape(len(self._quads), -1)

    def tangents(self, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the tangents of the pressure on the wall's faces, -p d^2V/dx^2 (q, 3 c, 3 c) [N/m]."""
        places = self._chamber.actuator.at(positions)[self._quads]
        count, middle = len(places), places.reshape(-1, 3).mean(axis=0)
        # An additional quad of zero size keeps the kernel's reference point fixed.
        own = np.concatenate([np.zeros(4, np.int32), 1 + np.arange(4 * count, dtype=np.int32)])
        pressure, blocks = float(self._chamber.reals[EFFORT]), np.empty((count, 12, 12))
        for column in range(12):
            sides = []
            for step in (self._step, -self._step):
                x, force = np.concatenate([middle[None], places.reshape(-1, 3)]), np.zeros((4 * count + 1, 3))
                x[1 + column // 3 :: 4, column % 3] += step
                push(x, own, pressure, force)
                sides.append(force[1:].reshape(count, 12))
            blocks[:, :, column] = (sides[0] - sides[1]) / (2.0 * self._step)
        if self._points is None:
            return blocks
        weights, parts = self._points.weights[self._quads], blocks.reshape(count, 4, 3, 4, 3)
        spread = np.einsum("qac,qaibj,qbd->qacibdj", weights, parts, weights, optimize=True)
        return spread.reshape(count, 96, 96)


def curved(terms: tuple[Term, ...], body: Body) -> list[Term]:
    """Return ``terms`` with chambers of given pressure replaced by `PressedWalls`; derivatives need full tangents."""

    def pressed(term: Term) -> bool:
        return isinstance(term, ChamberTerm) and term.actuator.mode is Mode.PRESSURE

    return [PressedWalls(term, body) if pressed(term) else term for term in terms]
