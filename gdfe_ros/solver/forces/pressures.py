# SPDX-License-Identifier: Apache-2.0
"""Pressures as multipliers of the elements' volumes, by the augmented Lagrangian method, and the elements' energies."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.compiled import internal, kernel
from gdfe_ros.materials.material import Law
from gdfe_ros.materials.stress import logarithmic_volume
from gdfe_ros.materials.table import BULK, CARRIED, PENALTY, SHEAR, MaterialTable
from gdfe_ros.mesh.cells.operators import ShapeOperators
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.elements.barrier import corner_ratios_at
from gdfe_ros.solver.elements.cell_type import volume_ratio
from gdfe_ros.solver.elements.measures import update_pressures, volume_at
from gdfe_ros.solver.state import ElementState
from gdfe_ros.solver.terms.multiplier import Anderson
from gdfe_ros.solver.vectors import Array


class Pressures:
    """The pressures of one solve, positive in tension, and their updates between minimisations.

    Args:
        body: the discretised body.
        state: the elements' stored state.
        ratio: multiple of the last step's change of pressure that is added at the start.

    Attributes:
        values: (m,) p_e [Pa].
        table: the body's materials, with the present penalty bulk moduli.
    """

    STILL_UPDATES, PLAIN_UPDATES = 3, 20
    """Updates are accelerated after the first number of successive updates without an iteration between them, or after
    the second number of updates in total.
    """
    LOCAL_SLACK = 10.0
    """Allowed volume error of a single element, divided by the allowed mean error. Either error
    displaces the vertices by about the same distance.
    """
    SWINGING = 0.3
    """An update counts as an oscillation if it reverses more than this fraction of the last one."""
    MOST_SWINGS = 2
    """The penalty bulk modulus is raised after this number of successive oscillations."""
    STIFFENING, MOST_STIFFENING = 3.0, 30.0
    """Oscillating pressures raise the penalty bulk modulus by the first factor; the second limits the total factor."""

    def __init__(self, body: Body, state: ElementState, ratio: float) -> None:
        self._body = body
        self.values = state.pressures.copy()
        if ratio != 0.0 and state.pressures is not state.pressures_before:
            self.values += ratio * (state.pressures - state.pressures_before)
        self.table = with_bulk(body.table, state.bulk)
        self.begin()

    def begin(self) -> None:
        """Clear the history of updates; the pressures stay."""
        self._change: Array | None = None
        self._swings, self._still, self._updates = 0, 0, 0
        self._anderson = Anderson()

    def update(self, x: Array, elements: NDArray[np.int32], shape: ShapeOperators, *, still: bool) -> float:
        """Update the pressures of ``elements``; return the mean volume error, or if more, a tenth of the largest.

        In confined bodies plain updates converge slowly, and Anderson acceleration is used. Beyond a buckling load the
        body is softer than the penalty bulk modulus, and the updates would oscillate without end. The modulus is then
        raised, and stays raised in later solves.
        """
        before = self.values.copy()
        worst, mean = update_pressures(x, elements, shape, self._body.material, self.table, self.values)
        change, last = self.values - before, self._change
        self._change = change
        swings = last is not None and np.vdot(last, change) < -self.SWINGING * np.vdot(last, last)
        self._swings = self._swings + 1 if swings else 0
        if self._swings == self.MOST_SWINGS:
            self._stiffen()
        self._still, self._updates = self._still + 1 if still else 0, self._updates + 1
        if self._still > self.STILL_UPDATES or self._updates > self.PLAIN_UPDATES:
            self.values[...] = self._anderson.next(before, change)
        return max(mean, worst / self.LOCAL_SLACK)

    @property
    def bulk(self) -> Array:
        """Penalty bulk modulus (k,) [Pa] of each material, for elements with pressures."""
        return self.table.parameters[:, PENALTY].copy()

    def _stiffen(self) -> None:
        parameters, most = self.table.parameters, self.MOST_STIFFENING * self._body.table.parameters[:, PENALTY]
        raised = np.minimum(self.STIFFENING * parameters[:, PENALTY], np.minimum(most, parameters[:, BULK]))
        parameters[:, PENALTY] = np.where(parameters[:, CARRIED] == 1.0, raised, parameters[:, PENALTY])
        self._swings = 0


def with_bulk(table: MaterialTable, bulk: Array) -> MaterialTable:
    """Return a copy of the materials with other penalty bulk moduli (k,) [Pa]."""
    parameters = table.parameters.copy()
    parameters[:, PENALTY] = bulk
    return table._replace(parameters=parameters)


def at_rest(body: Body) -> ElementState:
    """Return the stored state of undeformed elements."""
    none = np.zeros(len(body.material))
    return ElementState(
        pressures=none,
        pressures_before=none,
        bulk=body.table.parameters[:, PENALTY].copy(),
        hourglass_scale=np.ones_like(none),
        hourglass_scale_before=np.ones_like(none),
    )


@internal
def uncounted_energy(j, pressure, volume, table, k, solved):
    """Return the volume energy V U(J) [J] of an element with a pressure, minus the part in the kernels' energy.

    If ``solved`` is True, U(J) is replaced by its tangent U(J*) + p (J - J*), with the pressure p of the solve and
    U'(J*) = p. With a large bulk modulus, U(J) itself would magnify the remaining error of J. For an incompressible
    element the result is 0, because J is 1 to the tolerance.
    """
    bulk, change = table.parameters[k, BULK], j - 1.0
    if bulk == np.inf:
        return 0.0
    total = pressure + table.parameters[k, PENALTY] * change
    counted = change * (pressure + 0.5 * table.parameters[k, PENALTY] * change)
    target = volume_at(total, table, k) if solved else j
    if table.law[k] == Law.NEO_HOOKEAN:
        full, _ = logarithmic_volume(target, bulk - 2.0 / 3.0 * table.parameters[k, SHEAR])
    else:
        full = 0.5 * bulk * (target - 1.0) ** 2
    return volume * (full + total * (j - target) - counted)


@kernel
def store_energies(x, elements, shape, material, table, pressure, energies, stored, least, solved):
    """Write the energies [J] of ``elements``, with U(J) as their volume part, to ``stored`` (m,).

    The least volume ratio at a corner of each element is written to ``least`` (m,). For elements with a pressure, the
    kernels' ``energies`` (m,) [J] contain V (p_e (J - 1) + kappa/2 (J - 1)^2) instead. ``solved`` states whether the
    pressures are the result of a solve (see `uncounted_energy`). Return by how much [m^3] the volume at the elements'
    corners exceeds that of their mean deformation gradients.
    """
    excess, points = 0.0, np.empty((shape.cells.shape[1], 3))
    for e in elements:
        least[e], mean = corner_ratios_at(x, shape, e, points)
        j, k = volume_ratio(x, shape, e), material[e]
        excess += shape.volume[e] * (mean - j)
        stored[e] = energies[e]
        if table.parameters[k, CARRIED] != 0.0:
            stored[e] += uncounted_energy(j, pressure[e], shape.volume[e], table, k, solved)
    return excess
