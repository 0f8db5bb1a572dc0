# SPDX-License-Identifier: Apache-2.0
"""Element fields for publication: equivalent strain, elastic volume ratio, moduli, shape factor, energy density."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gdfe_ros.compiled import kernel
from gdfe_ros.materials.material import Law
from gdfe_ros.materials.stress import logarithmic_volume
from gdfe_ros.materials.table import BULK, CARRIED, PENALTY, SHEAR
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.elements.blocks import Operators
from gdfe_ros.solver.elements.cell_type import volume_ratio
from gdfe_ros.solver.elements.measures import softened_scale, strain_state, update_hourglass_scales
from gdfe_ros.solver.elements.response import evaluate
from gdfe_ros.solver.forces.pressures import store_energies, uncounted_energy
from gdfe_ros.solver.vectors import Array


@dataclass(frozen=True)
class ElementFields:
    """Fields with one value for each element, float64 (m,). With growth, F is the elastic part F G^-1.

    Attributes:
        centroids: (m, 3) current centroids [m].
        eps_eq: equivalent strain of Eq. 5 with nu = 0.5; the linear law uses the element's own nu.
        J: elastic volume ratio, the determinant of the mean F; with growth, the present volume is J det G times the
            undeformed one.
        secant: secant modulus Phi'/eps_eq of the material's uniaxial curve [Pa].
        tangent: tangent modulus of the same curve [Pa].
        energy_density: strain energy, hourglass part included, divided by the undeformed volume, without growth
            [J/m^3].
        omega: shape factor. For the ``energy`` policy it is the secant modulus divided by the body's largest secant
            modulus.
    """

    centroids: Array
    eps_eq: Array
    J: Array
    secant: Array
    tangent: Array
    energy_density: Array
    omega: Array


def element_fields(
    body: Body,
    positions: Array,
    omega: Array | None = None,
    *,
    operators: Operators | None = None,
    origin: Array | float = 0.0,
) -> ElementFields:
    """Evaluate all fields at ``positions`` (n, 3) [m].

    Args:
        body: the discretised body.
        positions: (n, 3) [m], relative to ``origin``.
        omega: (m,) shape factors of the ``relative`` policy; None to compute the shape factors of ``energy``.
        operators: operators of the present growth; None without growth.
        origin: (3,) [m] world position of the origin of ``positions``. The returned centroids are in world coordinates.
    """
    count, shape = len(body.material), (operators or body).shape
    values, centroids = np.empty((4, count)), np.empty((count, 3))
    scale, missing = np.ones(count), np.empty(count)
    _element_states(positions, shape, body.material, body.table, values, centroids, scale, missing)
    strain, volume_ratio, secant, tangent = values
    if omega is None:
        omega = secant / secant.max()
    force, energies = np.empty((*body.cells.shape, 3)), np.empty(count)
    none, every, material = np.zeros(count), np.arange(count, dtype=np.int32), body.material
    given = positions, shape, (operators or body).blocks, material, none, scale, body.table, every
    evaluate(*given, force, energies, None)
    density = (energies + missing) / body.shape.volume
    return ElementFields(centroids + origin, strain, volume_ratio, secant, tangent, density, np.asarray(omega))


def strain_energies(body: Body, positions: Array) -> Array:
    """Return the strain energy (m,) [J] of each element with its full volume energy U(J)."""
    none, elements = np.zeros(len(body.material)), np.arange(len(body.material), dtype=np.int32)
    counted = corner_forces(body, positions, none)[1]
    stored, least = np.empty_like(counted), np.empty_like(counted)
    store_energies(positions, elements, body.shape, body.material, body.table, none, counted, stored, least, False)
    return stored


def corner_forces(
    body: Body, positions: Array, pressure: Array, *, operators: Operators | None = None
) -> tuple[Array, Array]:
    """Return corner forces (m, c, 3) [N] and energies (m,) [J] of all elements for a given pressure (m,) [Pa].

    The hourglass scales are computed at ``positions`` (n, 3) [m]. The energies include the fold barriers.
    """
    force, energies = np.zeros((*body.cells.shape, 3)), np.zeros(len(body.material))
    scale, elements = np.ones(len(body.material)), np.arange(len(body.material), dtype=np.int32)
    shape, material, table = (operators or body).shape, body.material, body.table
    update_hourglass_scales(positions, elements, shape, material, table, scale)
    given = positions, shape, (operators or body).blocks, material, pressure, scale, table, elements
    evaluate(*given, force, energies, None)
    return force, energies


@kernel
def _element_states(x, shape, material, table, values, centroids, scale, missing):
    """Write the values of `strain_states`, centroids [m], hourglass scales and `uncounted_energy` [J], in one pass."""
    corners = 8 if shape.cells.shape[1] == 8 else 4
    for e in range(len(material)):
        k = material[e]
        strain, j, secant, tangent = strain_state(x, shape, e, table, k)
        values[0, e], values[1, e], values[2, e], values[3, e] = strain, j, secant, tangent
        missing[e] = uncounted_energy(j, 0.0, shape.volume[e], table, k, False) if table.parameters[k, CARRIED] else 0.0
        if table.law[k] != Law.LINEAR:
            scale[e] = softened_scale(tangent, table, k)
        for i in range(3):
            total = 0.0
            for a in range(corners):
                total += x[shape.cells[e, a], i]
            centroids[e, i] = total / corners


@kernel
def strain_states(x, shape, material, table, values):
    """Write eps_eq, J, secant and tangent modulus [Pa] of every element into the first four rows of ``values``."""
    for e in range(len(material)):
        k = material[e]
        strain, j, secant, tangent = strain_state(x, shape, e, table, k)
        values[0, e], values[1, e], values[2, e], values[3, e] = strain, j, secant, tangent


def volume_pressures(body: Body, positions: Array, *, operators: Operators | None = None) -> Array:
    """Return the pressures p_e (m,) [Pa] with which the kernels' volume term has the derivative U'(J).

    U(J) is the volume energy density [Pa] of the material law. For an incompressible element p_e is 0, because the
    positions do not determine its pressure. It then has the volume term of a material with nu = 0.45.
    """
    pressure = np.zeros(len(body.material))
    _full_pressures(positions, (operators or body).shape, body.material, body.table, pressure)
    return pressure


@kernel
def _full_pressures(x, shape, material, table, pressure):
    for e in range(len(material)):
        k = material[e]
        if table.parameters[k, CARRIED] == 0.0:
            continue
        change = volume_ratio(x, shape, e) - 1.0
        bulk = table.parameters[k, BULK]
        if bulk == np.inf:
            continue
        slope = bulk * change
        if table.law[k] == Law.NEO_HOOKEAN:
            _, slope = logarithmic_volume(change + 1.0, bulk - 2.0 / 3.0 * table.parameters[k, SHEAR])
        pressure[e] = slope - table.parameters[k, PENALTY] * change
