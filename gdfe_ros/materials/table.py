# SPDX-License-Identifier: Apache-2.0
"""Material parameters packed into arrays for the compiled kernels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.materials.material import Law, Material, Ogden

INTERVALS = 1024
"""Intervals of a tabulated curve; their cubic Hermite error is below 1e-9 of the initial modulus."""
LARGEST_STRETCH = 11.0
"""End of the tabulated curves; beyond it Phi' continues as a straight line in eps_eq."""
MODERATE_POISSON = 0.45
"""Largest Poisson's ratio with the bulk modulus in the energy; beyond it a pressure per element keeps the volume."""
SOFTENING_POISSON = 0.475
"""Poisson's ratio that gives the bulk modulus in the energy, if pressures keep the volume of a measured curve. The
curve's tangent may fall far below the initial modulus, and pressures converge only while this bulk modulus is larger
than the loss by softening. For other laws the ratio is 0.45.
"""

SHEAR, YOUNG, POISSON, BULK, PENALTY, LAME, CARRIED, TERMS, OGDEN = range(9)
"""Columns of ``MaterialTable.parameters``; Ogden's mu_i and alpha_i alternate from column ``OGDEN`` on."""
LOCAL = OGDEN + 12
"""Column of the local part of the volume stiffness, see `with_local_share`."""
LOCAL_SHARE = 1.5
"""Largest local part of the volume stiffness, over the shear modulus; in a prototype 1 to 2.5 worked as well. Without a
local part, laws of isochoric strain have motions without energy. If all of the stiffness is local, elements lock.
"""


class MaterialTable(NamedTuple):
    """One row for each material of a scene.

    Attributes:
        law: (k,) int32 of :class:`Law`.
        parameters: (k, 21) float64 [Pa, -], columns named above. These are: shear modulus mu0; Young's modulus E0;
            Poisson's ratio; bulk modulus K; the bulk modulus kappa in the energy; Lame's lambda of the logarithmic
            neo-Hookean volume term (0 with a pressure per element); 1 if a pressure per element keeps the volume;
            number of Ogden terms; local part of the volume stiffness.
        curve: (k, intervals + 1, 5) float64: on interval i with t = eps_eq/width - i,
            Phi' = c0 + c1 t + c2 t^2 + c3 t^3 [Pa]; c4 is Phi at t = 0 [J/m^3].
        tangent: (k, intervals + 1) float64, d sigma / d e [Pa] at the same nodes.
        width: (k,) float64, width of an interval in eps_eq.
    """

    law: NDArray[np.int32]
    parameters: NDArray[np.float64]
    curve: NDArray[np.float64]
    tangent: NDArray[np.float64]
    width: NDArray[np.float64]


def pack(materials: Sequence[Material]) -> MaterialTable:
    """Pack materials in the order of their index in the scene."""
    curves = [_tabulate(material) for material in materials]
    return MaterialTable(
        np.array([material.law for material in materials], dtype=np.int32),
        np.array([_row(material) for material in materials], dtype=np.float64),
        np.array([curve for curve, _, _ in curves]),
        np.array([tangent for _, tangent, _ in curves]),
        np.array([width for _, _, width in curves]),
    )


def with_local_share(table: MaterialTable) -> MaterialTable:
    """Return the materials with their volume stiffness divided, for elements with several integration points.

    The local part acts at the integration points. It is min(lambda, 1.5 mu) for a logarithmic volume energy, and min(K,
    1.5 mu) for others. ``BULK``, ``PENALTY`` and ``LAME`` keep the rest, which acts on an element's mean volume ratio.
    For a homogeneous deformation the sum of both is the law.
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
    """Return whether a pressure per element keeps the volume of this material."""
    return material.poisson > MODERATE_POISSON


def _row(material: Material) -> NDArray[np.float64]:
    row = np.zeros(LOCAL + 1)
    mu, nu = material.shear0, material.poisson
    row[[SHEAR, YOUNG, POISSON, BULK]] = mu, material.young0, nu, material.bulk
    if carries_pressure(material):
        row[CARRIED] = 1.0
        penalty = SOFTENING_POISSON if material.law is Law.CURVE else MODERATE_POISSON
        row[PENALTY] = 2.0 * mu * (1.0 + penalty) / (3.0 * (1.0 - 2.0 * penalty))
    elif material.law is Law.NEO_HOOKEAN:
        row[LAME] = 2.0 * mu * nu / (1.0 - 2.0 * nu)
    else:
        row[PENALTY] = material.bulk
    if isinstance(material, Ogden):
        count = len(material.mu)
        row[TERMS] = count
        row[OGDEN : OGDEN + 2 * count : 2] = material.mu
        row[OGDEN + 1 : OGDEN + 2 * count : 2] = material.alpha
    return row


def _tabulate(material: Material) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Sample Phi'(eps_eq) so that uniaxial tension at J = 1 reproduces the material's curve (docs/theory/energy.md)."""
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
    """Return the cubic coefficients (i + 1, 4) on unit intervals; the last row is the straight continuation."""
    coefficients = np.zeros((len(value), 4))
    coefficients[:, 0], coefficients[:, 1] = value, slope
    rise = np.diff(value)
    coefficients[:-1, 2] = 3.0 * rise - 2.0 * slope[:-1] - slope[1:]
    coefficients[:-1, 3] = slope[:-1] + slope[1:] - 2.0 * rise
    return coefficients


def _equivalent_strain(stretch: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return eps_eq of Eq. 5 with nu = 0.5 for incompressible uniaxial tension."""
    return (stretch - stretch**-0.5) / 1.5


def _stretch(strain: NDArray[np.float64]) -> NDArray[np.float64]:
    """Invert :func:`_equivalent_strain` by Newton's method.

    The function is concave, so the iteration converges from a high start.
    """
    stretch = 1.0 + 1.5 * strain
    for _ in range(60):
        stretch = stretch - (_equivalent_strain(stretch) - strain) * 1.5 / (1.0 + 0.5 * stretch**-1.5)
    return stretch
