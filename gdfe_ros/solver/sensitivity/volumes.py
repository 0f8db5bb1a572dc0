# SPDX-License-Identifier: Apache-2.0
"""Volume laws of elements at a converged state.

A solve keeps the volume of nearly incompressible elements by a pressure and a soft penalty. Its converged state, with
the volume ratio J_0, satisfies p = U'(J_0). The kernels receive the law U itself, plus a small pressure for the
remaining error of J_0.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.compiled import kernel
from gdfe_ros.materials.material import Law
from gdfe_ros.materials.table import BULK, CARRIED, LAME, PENALTY, SHEAR, MaterialTable
from gdfe_ros.mesh.operators import ShapeOperators
from gdfe_ros.solver.elements.cell_type import volume_ratio

STIFF = 1e4
"""Finite substitute for an infinite bulk modulus, divided by the penalty bulk modulus. The relative error is 1e-5."""


@kernel
def write_volume_ratios(x, shape, ratios):
    """Write the volume ratio of each element to ``ratios`` (m,), at positions ``x`` (n, 3) [m]."""
    for e in range(len(ratios)):
        ratios[e] = volume_ratio(x, shape, e)


def elastic(table: MaterialTable) -> MaterialTable:
    """Return the materials with their own volume laws in place of penalties."""
    parameters = table.parameters.copy()
    carried, bulk = parameters[:, CARRIED] == 1.0, parameters[:, BULK]
    logarithmic = (table.law == Law.NEO_HOOKEAN) & np.isfinite(bulk)
    whole = np.where(np.isinf(bulk), STIFF * parameters[:, PENALTY], bulk)
    parameters[carried, PENALTY] = np.where(logarithmic, 0.0, whole)[carried]
    parameters[carried, LAME] = np.where(logarithmic, bulk - 2.0 / 3.0 * parameters[:, SHEAR], 0.0)[carried]
    return table._replace(parameters=parameters)


class Volumes:
    """The volume laws of elements at a state.

    Args:
        x: (n, 3) [m] positions of the state.
        shape: operators of the elements.
        material: (m,) int32 material index of each element.
        table: the materials, with the present penalty bulk moduli.
        pressure: (m,) [Pa] pressures p_e of the state.

    Attributes:
        table: the materials with their own volume laws.
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
        self._material, self._ratio, self.table = material, np.empty(len(material)), elastic(table)
        write_volume_ratios(x, shape, self._ratio)
        own = table.parameters[material]
        kept = pressure + own[:, PENALTY] * (self._ratio - 1.0)
        self._total = np.where(own[:, CARRIED] == 1.0, kept, self._slopes(self.table))
        self.rigid = bool(np.isinf(own[:, BULK]).any())

    def pressures(self, table: MaterialTable) -> NDArray[np.float64]:
        """Return the pressures p_e (m,) [Pa] beside the laws of ``table``, an `elastic` one, at the same J_0.

        The total pressure is that of the state, in proportion to the moduli unless they are infinite.
        """
        old, new = (each.parameters[self._material] for each in (self.table, table))
        carried = new[:, CARRIED] == 1.0
        share = np.ones(len(new))
        moduli = [each[:, LAME] + each[:, PENALTY] for each in (new, old)]
        np.divide(*moduli, out=share, where=carried & np.isfinite(new[:, BULK]))
        return np.where(carried, share * self._total - self._slopes(table), 0.0)

    def _slopes(self, table: MaterialTable) -> NDArray[np.float64]:
        """Return U' (m,) [Pa] at J_0 by the laws of an `elastic` table."""
        parameters, ratio = table.parameters[self._material], self._ratio
        return parameters[:, LAME] * np.log(ratio) / ratio + parameters[:, PENALTY] * (ratio - 1.0)
