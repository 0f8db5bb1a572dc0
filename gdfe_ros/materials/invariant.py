# SPDX-License-Identifier: Apache-2.0
"""Laws of the first isochoric invariant: Yeoh, Arruda and Boyce, Gent.

With x = I1 - 3, where I1 is the sum of the squared isochoric principal stretches,

    W = sum_i c_i x^i - mu Jm / 2 ln(1 - x / Jm) + K/2 (J - 1)^2.

Beyond ``end``, the energy continues as a parabola in x, or as a straight line where the law softens. A Gent body is
therefore not infinitely stiff near its limit, and a polynomial with a negative last coefficient does not collapse.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.materials.drucker import drucker_remarks, invariant_hessian
from gdfe_ros.materials.material import Law, Material, require_within
from gdfe_ros.quantity import Quantity

Vector = NDArray[np.float64]
Shear = Annotated[float, Quantity("shear modulus mu", "Pa", above=0.0, below=1e13, remedy="in Pa: 1 MPa is 1.0e6")]
MOST_COEFFICIENTS = 5
"""Largest number of coefficients c_i; the law of Arruda and Boyce has five."""
GENT_END = 0.99
"""Value of x / Jm from which Gent's law is continued."""
WEAKEST = 0.1
"""Slope dW/dx over its initial value below which a polynomial is continued by a straight line."""
_SEARCH = np.concatenate([[0.0], np.geomspace(1e-3, 1e4, 4000)])


@dataclass(frozen=True, kw_only=True)
class InvariantLaw(Material):
    """Base class of the laws of the first isochoric invariant."""

    law = Law.YEOH
    kernel = Law.OGDEN

    @property
    def coefficients(self) -> tuple[float, ...]:
        """Coefficients c_i [Pa] of x, x^2, ..."""
        return ()

    @property
    def limited(self) -> tuple[float, float]:
        """Modulus mu [Pa] and limit Jm of Gent's part; zeros without such a part."""
        return 0.0, 0.0

    @property
    def end(self) -> float:
        """Value of x from which the energy is continued; infinite for a law that needs no continuation."""
        mu, limit = self.limited
        if mu > 0.0:
            return GENT_END * limit
        slope = _polynomial(self.coefficients, _SEARCH)[1]
        weak = np.flatnonzero(slope < WEAKEST * slope[0])
        return float(_SEARCH[max(weak[0] - 1, 0)]) if len(weak) else math.inf

    @property
    def shear0(self) -> float:
        """Initial shear modulus 2 dW/dI1 [Pa]."""
        first = self.coefficients[0] if self.coefficients else 0.0
        return 2.0 * first + self.limited[0]

    def slopes(self, x: Vector) -> tuple[Vector, Vector]:
        """Return dW/dx and d2W/dx2 [Pa] at x = I1 - 3 (any shape)."""
        inside = np.minimum(x, self.end)
        _, first, second = _polynomial(self.coefficients, inside)
        mu, limit = self.limited
        if mu > 0.0:
            first = first + 0.5 * mu / (1.0 - inside / limit)
            second = second + 0.5 * mu / limit / (1.0 - inside / limit) ** 2
        beyond = x > inside
        second = np.where(beyond, np.maximum(second, 0.0), second)
        return np.where(beyond, first + second * (x - inside), first), second

    def stress_at(self, strain: Vector) -> Vector:
        """Return 2 dW/dI1 (l - l^-2) [Pa] at l = 1 + e."""
        stretch = 1.0 + np.asarray(strain, dtype=np.float64)
        return 2.0 * self.slopes(stretch**2 + 2.0 / stretch - 3.0)[0] * (stretch - stretch**-2.0)

    def tangent_at(self, strain: Vector) -> Vector:
        """Return the derivative [Pa] of :meth:`stress_at`."""
        stretch = 1.0 + np.asarray(strain, dtype=np.float64)
        first, second = self.slopes(stretch**2 + 2.0 / stretch - 3.0)
        return 2.0 * first * (1.0 + 2.0 * stretch**-3.0) + 4.0 * second * (stretch - stretch**-2.0) ** 2

    def remarks(self) -> list[str]:
        """Return remarks on the deformations and stretches at which the law is unstable; empty if there are none."""
        return drucker_remarks(invariant_hessian(self.slopes))


@dataclass(frozen=True, kw_only=True)
class Yeoh(InvariantLaw):
    """Yeoh's law, W = C10 (I1 - 3) + C20 (I1 - 3)^2 + C30 (I1 - 3)^3, with the coefficients of Abaqus.

    Attributes:
        c10, c20, c30: coefficients [Pa]; mu0 = 2 C10.
    """

    c10: Annotated[float, Quantity("half of the initial shear modulus", "Pa", above=0.0, below=1e13)]
    c20: Annotated[float, Quantity("coefficient of (I1 - 3)^2", "Pa", least=-1e13, most=1e13)] = 0.0
    c30: Annotated[float, Quantity("coefficient of (I1 - 3)^3", "Pa", least=-1e13, most=1e13)] = 0.0
    law = Law.YEOH

    def __post_init__(self) -> None:
        super().__post_init__()
        require_within("c10", self.c10, 0.0, 1e13, "in Pa: 1 MPa is 1.0e6; 2 c10 is the initial shear modulus")

    @property
    def coefficients(self) -> tuple[float, ...]:
        """Coefficients of x, x^2, x^3 [Pa]."""
        return self.c10, self.c20, self.c30


@dataclass(frozen=True, kw_only=True)
class ArrudaBoyce(InvariantLaw):
    """Law of Arruda and Boyce: chains of rubber with a locking stretch, with the five terms of Abaqus.

    W = mu sum_i C_i / lambda_m^(2i-2) (I1^i - 3^i) with C = 1/2, 1/20, 11/1050, 19/7000, 519/673750.

    Attributes:
        mu: modulus [Pa]; the initial shear modulus is larger by the factor 1 + 3/(5 lambda_m^2) + ...
        lambda_m: locking stretch of the chains, above 1.
    """

    mu: Shear
    lambda_m: Annotated[float, Quantity("locking stretch of the chains; rubber has 2 to 7", above=1.0, below=1e3)]
    law = Law.ARRUDA_BOYCE

    @property
    def coefficients(self) -> tuple[float, ...]:
        """Coefficients of x to x^5 [Pa], from I1 = x + 3."""
        series = np.zeros(MOST_COEFFICIENTS + 1)
        for i, factor in enumerate((1 / 2, 1 / 20, 11 / 1050, 19 / 7000, 519 / 673750), start=1):
            power = np.array([math.comb(i, k) * 3.0 ** (i - k) for k in range(i + 1)])
            series[: i + 1] += self.mu * factor / self.lambda_m ** (2 * i - 2) * power
        return tuple(series[1:].tolist())


@dataclass(frozen=True, kw_only=True)
class Gent(InvariantLaw):
    """Gent's law, W = -mu Jm / 2 ln(1 - (I1 - 3) / Jm).

    Attributes:
        mu: initial shear modulus [Pa].
        jm: limit of I1 - 3, above 0.
    """

    mu: Shear
    jm: Annotated[float, Quantity("limit of I1 - 3; rubber has 10 to 100", above=0.0, below=1e6)]
    law = Law.GENT

    @property
    def limited(self) -> tuple[float, float]:
        """Modulus [Pa] and limit."""
        return self.mu, self.jm


def _polynomial(coefficients: tuple[float, ...], x: Vector) -> tuple[Vector, Vector, Vector]:
    """Return sum_i c_i x^i and its two derivatives [Pa]."""
    polynomial = np.polynomial.Polynomial((0.0, *coefficients))
    return polynomial(x), polynomial.deriv()(x), polynomial.deriv(2)(x)
