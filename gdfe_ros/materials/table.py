# SPDX-License-Identifier: Apache-2.0
"""Table of material parameters for the compiled kernels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.materials.invariant import InvariantLaw
from gdfe_ros.materials.material import Law, Material

INTERVALS = 1024
"""Number of intervals of a tabulated curve. The error of cubic Hermite interpolation is below 1e-9 of the initial
modulus.
"""
LARGEST_STRETCH = 11.0
"""Largest uniaxial stretch of a tabulated curve; beyond it Phi' continues as a straight line in eps_eq."""
MODERATE_POISSON = 0.45
"""Largest Poisson's ratio for which the energy has the full bulk modulus; above it each element has a pressure unknown.
"""
SOFTENING_POISSON = 0.475
"""Poisson's ratio that gives the bulk modulus in the energy of elements with pressures, if their law is a measured
curve. For other laws, `MODERATE_POISSON` gives it. The curve's tangent may fall far below the initial modulus, and the
pressures converge only while the bulk modulus exceeds the decrease of the tangent.
"""

SHEAR, YOUNG, POISSON, BULK, PENALTY, LAME, CARRIED, TERMS, OGDEN = range(9)
"""Columns of ``MaterialTable.parameters``. From column ``OGDEN`` on: Ogden's mu_1, alpha_1, mu_2, alpha_2, ..."""
LOCAL = OGDEN + 12
"""Column of the local part of the volume stiffness, see `with_local_share`."""
POWERS = LOCAL + 1
"""Column of the first of five coefficients of a law of the first invariant (`InvariantLaw`)."""
GENT, LIMIT, END = range(POWERS + 5, POWERS + 8)
"""Columns of such a law: modulus and limit of Gent's part, and the value of I1 - 3 from which it is continued."""
INVARIANT = END + 1
"""Column with 1 for a law of the first invariant, else 0."""
LOCAL_SHARE = 1.5
"""Largest local part of the volume stiffness, divided by the shear modulus. In a prototype, 1 to 2.5 worked as well.
Without a local part, laws in isochoric strains have deformation modes without energy. If all of the stiffness is local,
elements lock.
"""


NO_CONTINUATION = 1e12
"""Value of I1 - 3 that stands for a law without a continuation."""


class MaterialTable(NamedTuple):
    """Arrays with one row for each material of a scene.

    Attributes:
        law: (k,) int32, value of :class:`Law` of the kernel; laws of principal stretches have ``OGDEN``.
        parameters: (k, 31) float64 [Pa, -], with the columns `SHEAR` to `INVARIANT`. They are in this order: shear
            modulus mu0; Young's modulus E0; Poisson's ratio; modulus of the volume energy (`Material.volume_modulus`);
            the bulk modulus kappa in the energy; Lame's lambda of the logarithmic neo-Hookean volume term (0 with a
            pressure per element); 1 if each element has a pressure unknown, else 0; number of Ogden terms; Ogden's
            constants; local part of the volume stiffness; constants of a law of the first invariant.
        curve: (k, intervals + 1, 5) float64 coefficients. On interval i with t = eps_eq/width - i,
            Phi' = c0 + c1 t + c2 t^2 + c3 t^3 [Pa]; c4 is Phi at t = 0 [J/m^3].
        tangent: (k, intervals + 1) float64, d sigma / d e [Pa] at the starts of the intervals.
        width: (k,) float64, width of an interval in eps_eq.
    """

    law: NDArray[np.int32]
    parameters: NDArray[np.float64]
    curve: NDArray[np.float64]
    tangent: NDArray[np.float64]
    width: NDArray[np.float64]


def pack(materials: Sequence[Material]) -> MaterialTable:
    """Return the table of materials, in the order of their indices in the scene."""
    curves = [_tabulate(material) for material in materials]
    return MaterialTable(
        np.array([material.kernel for material in materials], dtype=np.int32),
        np.array([_row(material) for material in materials], dtype=np.float64),
        np.array([curve for curve, _, _ in curves]),
        np.array([tangent for _, tangent, _ in curves]),
        np.array([width for _, _, width in curves]),
    )


def with_local_share(table: MaterialTable) -> MaterialTable:
    """Return a table with the volume stiffness split into two parts, for elements with several integration points.

    The local part acts on the volume ratio at each integration point. It is min(lambda, 1.5 mu) for a logarithmic
    volume energy, and min(K, 1.5 mu) for other energies. The remaining part acts on an element's mean volume ratio and
    is stored in ``BULK``, ``PENALTY`` and ``LAME``. For a homogeneous deformation both parts add up to the law.
    """
    parameters = table.parameters.copy()
    log = table.law == Law.NEO_HOOKEAN
    whole = parameters[:, BULK] - np.where(log, 2.0 / 3.0 * parameters[:, SHEAR], 0.0)
    parameters[:, LOCAL] = local = np.clip(whole, 0.0, LOCAL_SHARE * parameters[:, SHEAR])
    parameters[:, BULK] -= local
    for column in (PENALTY, LAME):
        rest = np.maximum(parameters[:, column] - local, 0.0)
        parameters[:, column] = np.where(parameters[:, column] > 0.0, rest, 0.0)
    return table._replace(parameters=parameters)


def carries_pressure(material: Material) -> bool:
    """Return whether elements of this material have a pressure as an additional unknown."""
    return material.poisson > MODERATE_POISSON


def _row(material: Material) -> NDArray[np.float64]:
    row = np.zeros(INVARIANT + 1)
    mu, nu = material.shear0, material.poisson
    row[[SHEAR, YOUNG, POISSON, BULK]] = mu, material.young0, nu, material.volume_modulus
    if carries_pressure(material):
        row[CARRIED] = 1.0
        penalty = SOFTENING_POISSON if material.law is Law.CURVE else MODERATE_POISSON
        row[PENALTY] = 2.0 * mu * (1.0 + penalty) / (3.0 * (1.0 - 2.0 * penalty))
    elif material.law is Law.NEO_HOOKEAN:
        row[LAME] = 2.0 * mu * nu / (1.0 - 2.0 * nu)
    else:
        row[PENALTY] = material.volume_modulus
    row[TERMS] = count = len(material.terms)
    row[OGDEN : OGDEN + 2 * count] = np.ravel(material.terms)
    if isinstance(material, InvariantLaw):
        coefficients = material.coefficients
        row[POWERS : POWERS + len(coefficients)] = coefficients
        row[[GENT, LIMIT]], row[END], row[INVARIANT] = material.limited, min(material.end, NO_CONTINUATION), 1.0
    return row


def _tabulate(material: Material) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Return the rows ``curve`` and ``tangent`` of a material, and the ``width`` of an interval (`MaterialTable`).

    Phi'(eps_eq) is sampled so that uniaxial tension at J = 1 reproduces the material's curve (docs/theory/energy.md).
    """
    width = _equivalent_strain(np.array(LARGEST_STRETCH)) / INTERVALS
    stretch = _stretch(width * np.arange(INTERVALS + 1))
    stress, tangent = material.stress_at(stretch - 1.0), material.tangent_at(stretch - 1.0)
    rate = (1.0 + 0.5 * stretch**-1.5) / 1.5
    curve = np.zeros((INTERVALS + 1, 5))
    slope = (tangent + stress * 0.5 * stretch**-2.5 / rate) / rate**2 * width
    curve[:, :4] = _hermite(stress / rate, slope)
    area = width * curve[:-1, :4] @ (1.0, 0.5, 1.0 / 3.0, 0.25)
    curve[1:, 4] = np.cumsum(area)
    return curve, tangent, float(width)


def _hermite(value: NDArray[np.float64], slope: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the coefficients (i + 1, 4) of the cubic Hermite interpolation on i intervals of unit length.

    ``value`` and ``slope`` (i + 1,) are the values and slopes at the ends of the intervals. The last row is the
    straight continuation.
    """
    coefficients = np.zeros((len(value), 4))
    coefficients[:, 0], coefficients[:, 1] = value, slope
    rise = np.diff(value)
    coefficients[:-1, 2] = 3.0 * rise - 2.0 * slope[:-1] - slope[1:]
    coefficients[:-1, 3] = slope[:-1] + slope[1:] - 2.0 * rise
    return coefficients


def _equivalent_strain(stretch: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return eps_eq of Eq. 5 with nu = 0.5 for incompressible uniaxial tension with a given stretch."""
    return (stretch - stretch**-0.5) / 1.5


def _stretch(strain: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the stretch for an equivalent strain, the inverse of :func:`_equivalent_strain`, by Newton's method.

    The function is concave, so that the iteration converges from a start above the solution.
    """
    stretch = 1.0 + 1.5 * strain
    for _ in range(60):
        stretch = stretch - (_equivalent_strain(stretch) - strain) * 1.5 / (1.0 + 0.5 * stretch**-1.5)
    return stretch
