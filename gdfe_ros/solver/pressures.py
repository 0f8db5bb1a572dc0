# SPDX-License-Identifier: Apache-2.0
"""The pressures that carry the elements' volumes: an augmented Lagrangian, one multiplier an element (DESIGN 5.2)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.materials.table import BULK, CARRIED, PENALTY
from gdfe_ros.solver.anderson import Anderson
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.element_state import update_pressures

STILL_UPDATES, PLAIN_UPDATES = 3, 20
"""Updates in a row that move nothing, and updates in all, after which pressures are accelerated."""
LOCAL_SLACK = 10.0
"""Misfit of a single element's volume over that of all which moves the positions as far."""
SWINGING = 0.3
"""Share of the last update that an update takes back where the two count as going to and fro."""
MOST_SWINGS = 2
STIFFENING, MOST_STIFFENING = 3.0, 30.0
"""Factor by which the bulk modulus beside the pressures is raised then, and its bound."""


class Pressures:
    """The pressures, positive in tension, and their updates between descents.

    Args:
        body: the discretised body.

    Attributes:
        values: (m,) p_e [Pa].
        table: the body's materials, with the bulk moduli beside the pressures that are in force.
        stiffened: how often these were raised.
    """

    def __init__(self, body: Body) -> None:
        self._body = body
        self.values = np.zeros(len(body.material))
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self.stiffened = 0
        self._last, self._before = np.zeros_like(self.values), np.zeros_like(self.values)
        self.values[...] = 0.0
        self.table = self._body.table._replace(parameters=self._body.table.parameters.copy())
        self.begin()

    def accept(self) -> None:
        """Keep the pressures as the start of the next solve."""
        self._last, self._before = self.values.copy(), self._last

    def start(self, elements: NDArray[np.int32], ratio: float) -> None:
        """Start a solve: what was accepted, of ``elements`` with ``ratio`` of the last accepted change added."""
        self.values[...] = self._last
        self.values[elements] += ratio * (self._last - self._before)[elements]

    def begin(self) -> None:
        """Forget the updates of the last solve."""
        self._change: NDArray[np.float64] | None = None
        self._swings, self._still, self._updates = 0, 0, 0
        self._anderson = Anderson()

    def update(self, x: NDArray[np.float64], elements: NDArray[np.int32], *, still: bool) -> float:
        """Update the pressures of ``elements``; return the misfit of their volumes, the mean or a tenth of the largest.

        Where the body is confined plain updates settle slowly, and Anderson's acceleration takes over. Past a buckling
        load the body gives way faster than the bulk modulus beside the pressures stiffens it, and the updates go to
        and fro for ever; where they do, that modulus is raised until the next reset.
        """
        body, before = self._body, self.values.copy()
        worst, mean = update_pressures(x, elements, body.shape, body.material, self.table, self.values)
        change, last = self.values - before, self._change
        self._change = change
        swings = last is not None and np.vdot(last, change) < -SWINGING * np.vdot(last, last)
        self._swings = self._swings + 1 if swings else 0
        if self._swings == MOST_SWINGS:
            self._stiffen()
        self._still, self._updates = self._still + 1 if still else 0, self._updates + 1
        if self._still > STILL_UPDATES or self._updates > PLAIN_UPDATES:
            self.values[...] = self._anderson.next(before, change)
        return max(mean, worst / LOCAL_SLACK)

    def _stiffen(self) -> None:
        parameters, most = self.table.parameters, MOST_STIFFENING * self._body.table.parameters[:, PENALTY]
        raised = np.minimum(STIFFENING * parameters[:, PENALTY], np.minimum(most, parameters[:, BULK]))
        parameters[:, PENALTY] = np.where(parameters[:, CARRIED] == 1.0, raised, parameters[:, PENALTY])
        self._swings, self.stiffened = 0, self.stiffened + 1
