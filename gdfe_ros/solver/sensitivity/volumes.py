# SPDX-License-Identifier: Apache-2.0
"""Linearised volume laws of elements at a converged state.

A solve keeps the volume of nearly incompressible elements by a pressure and a soft penalty. Its converged state, with
the volume ratio J_0, satisfies p = U'(J_0). The kernels receive this law linearised, p + U''(J_0) (J - J_0): a pressure
and a bulk modulus for each element.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.compiled import kernel
from gdfe_ros.materials.material import Law
from gdfe_ros.materials.table import BULK, CARRIED, PENALTY, SHEAR, MaterialTable
from gdfe_ros.mesh.operators import ShapeOperators
from gdfe_ros.solver.elements.cell_type import volume_ratio
from gdfe_ros.solver.elements.measures import volume_at

STIFF = 1e4
"""Finite substitute for an infinite bulk modulus, divided by the penalty bulk modulus. The relative error is 1e-5."""


@kernel
def volume_state(x, shape, material, table, pressure, ratio, total, slope):
    """Write J to ``ratio``, p [Pa] to ``total`` and U'' [Pa] to ``slope`` (m,).

    For elements without a pressure, p is U'(J), and the slope is 0.
    """
    for e in range(len(material)):
        k = material[e]
        j = volume_ratio(x, shape, e)
        ratio[e], bulk = j, table.parameters[k, BULK]
        logarithmic = table.law[k] == Law.NEO_HOOKEAN and bulk != math.inf
        lame = bulk - 2.0 / 3.0 * table.parameters[k, SHEAR]
        if table.parameters[k, CARRIED] == 0.0:
            total[e] = lame * math.log(max(j, 1e-3)) / j if logarithmic else bulk * (j - 1.0)
            slope[e] = 0.0
            continue
        total[e] = pressure[e] + table.parameters[k, PENALTY] * (j - 1.0)
        if logarithmic:
            at = volume_at(total[e], table, k)
            slope[e] = lame * (1.0 - math.log(at)) / (at * at)
        elif bulk == math.inf:
            slope[e] = STIFF * table.parameters[k, PENALTY]
        else:
            slope[e] = bulk


class Volumes:
    """The volume laws of elements, linearised at a state.

    Args:
        x: (n, 3) [m] positions of the state.
        shape: operators of the elements.
        material: (m,) int32 material index of each element.
        table: the materials, with the present penalty bulk moduli.
        pressure: (m,) [Pa] pressures p_e of the state.

    Attributes:
        table, material, pressure: materials, material indices and pressures of the linearised law, for the kernels.
        total: (m,) [Pa] total pressure p of the state.
        ratio: (m,) volume ratio J of the state.
        rigid: whether any element is incompressible.
    """

    def __init__(
        self,
        x: NDArray[np.float64],
        shape: ShapeOperators,
        material: NDArray[np.int32],
        table: MaterialTable,
        pressure: NDArray[np.float64],
    ) -> None:
        self.ratio, self.total, slope = (np.empty(len(material)) for _ in range(3))
        volume_state(x, shape, material, table, pressure, self.ratio, self.total, slope)
        carried = table.parameters[material, CARRIED] == 1.0
        self.rigid = bool(np.isinf(table.parameters[material, BULK]).any())
        own = carried & (table.law[material] == Law.NEO_HOOKEAN)  # each of these has its own bulk modulus
        parameters, first = table.parameters.copy(), len(table.parameters)
        stiff = np.where(np.isinf(parameters[:, BULK]), STIFF * parameters[:, PENALTY], parameters[:, BULK])
        parameters[:, PENALTY] = np.where(parameters[:, CARRIED] == 1.0, stiff, parameters[:, PENALTY])
        rows = table.parameters[material[own]].copy()
        rows[:, PENALTY] = slope[own]
        self.material = material.copy()
        self.material[own] = first + np.arange(int(own.sum()))
        law = np.concatenate([table.law, table.law[material[own]]])
        self.table = table._replace(law=law, parameters=np.concatenate([parameters, rows]))
        self.pressure = np.where(carried, self.total - slope * (self.ratio - 1.0), 0.0)

    def pressed(self, material: NDArray[np.int32], before: MaterialTable, table: MaterialTable) -> NDArray[np.float64]:
        """Return the pressures p_e (m,) [Pa] at the same J with the materials of ``table`` instead of ``before``."""
        old, new = before.parameters[material], table.parameters[material]
        moduli = []
        for each, law in ((old, before.law[material]), (new, table.law[material])):
            bulk = each[:, BULK]
            moduli.append(np.where(law == Law.NEO_HOOKEAN, bulk - 2.0 / 3.0 * each[:, SHEAR], bulk))
        carried = new[:, CARRIED] == 1.0
        share, finite = np.ones(len(material)), np.isfinite(moduli[0]) & np.isfinite(moduli[1])
        np.divide(moduli[1], moduli[0], out=share, where=carried & finite)
        return np.where(carried, share * self.total - new[:, PENALTY] * (self.ratio - 1.0), 0.0)
