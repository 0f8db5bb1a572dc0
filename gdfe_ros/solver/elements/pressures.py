# SPDX-License-Identifier: Apache-2.0
"""The pressures that carry the elements' volumes: an augmented Lagrangian, one multiplier an element."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.materials.table import BULK, CARRIED, PENALTY, MaterialTable
from gdfe_ros.mesh.operators import ShapeOperators
from gdfe_ros.solver.anderson import Anderson
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.elements.measures import update_pressures
from gdfe_ros.solver.state import ElementState

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
    """The pressures of one solve, positive in tension, and their updates between descents.

    Args:
        body: the discretised body.
        state: what the elements remember.
        elements: (k,) those whose pressures follow the motion.
        ratio: how much of the last step's change of pressure is added at the start.

    Attributes:
        values: (m,) p_e [Pa].
        table: the body's materials, with the bulk moduli beside the pressures that are in force.
        stiffened: how often these were raised.
    """

    def __init__(self, body: Body, state: ElementState, elements: NDArray[np.int32], ratio: float) -> None:
        self._body, self.stiffened = body, 0
        self.values = state.pressures.copy()
        if ratio != 0.0 and state.pressures is not state.pressures_before:
            self.values[elements] += ratio * (state.pressures - state.pressures_before)[elements]
        self.table = with_bulk(body.table, state.bulk)
        self.begin()

    def begin(self) -> None:
        """Forget the updates so far, not their values."""
        self._change: NDArray[np.float64] | None = None
        self._swings, self._still, self._updates = 0, 0, 0
        self._anderson = Anderson()

    def update(
        self, x: NDArray[np.float64], elements: NDArray[np.int32], shape: ShapeOperators, *, still: bool
    ) -> float:
        """Update the pressures of ``elements``; return the misfit of their volumes, the mean or a tenth of the largest.

        Where the body is confined plain updates settle slowly, and Anderson's acceleration takes over. Past a buckling
        load the body gives way faster than the bulk modulus beside the pressures stiffens it, and the updates go to
        and fro for ever; where they do, that modulus is raised until the next reset.
        """
        before = self.values.copy()
        worst, mean = update_pressures(x, elements, shape, self._body.material, self.table, self.values)
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

    @property
    def bulk(self) -> NDArray[np.float64]:
        """Bulk modulus beside the pressures by material (k,) [Pa]."""
        return self.table.parameters[:, PENALTY].copy()

    def _stiffen(self) -> None:
        parameters, most = self.table.parameters, MOST_STIFFENING * self._body.table.parameters[:, PENALTY]
        raised = np.minimum(STIFFENING * parameters[:, PENALTY], np.minimum(most, parameters[:, BULK]))
        parameters[:, PENALTY] = np.where(parameters[:, CARRIED] == 1.0, raised, parameters[:, PENALTY])
        self._swings, self.stiffened = 0, self.stiffened + 1


def with_bulk(table: MaterialTable, bulk: NDArray[np.float64]) -> MaterialTable:
    """Return the materials with other bulk moduli (k,) [Pa] beside the pressures, in an array of their own."""
    parameters = table.parameters.copy()
    parameters[:, PENALTY] = bulk
    return table._replace(parameters=parameters)


def at_rest(body: Body) -> ElementState:
    """Return what elements remember at rest: nothing."""
    none = np.zeros(len(body.material))
    return ElementState(
        pressures=none,
        pressures_before=none,
        bulk=body.table.parameters[:, PENALTY].copy(),
        hourglass_scale=np.ones_like(none),
    )
