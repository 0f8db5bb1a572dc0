# SPDX-License-Identifier: Apache-2.0
"""Stress-strain laws with their parameters: immutable, validated, SI units."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.keys import CheckedKeys
from gdfe_ros.materials.curve_data import CurveData
from gdfe_ros.materials.drucker import drucker_remarks, separable_hessian
from gdfe_ros.quantity import ANY, Quantity, quantities_of

Modulus = Annotated[float, Quantity("Young's modulus", "Pa", above=0.0, below=1e13, remedy="in Pa: 1 MPa is 1.0e6")]
Density = Annotated[float, Quantity("density", "kg/m^3", least=1e-9, below=1e6)]
Omega = Annotated[
    float, Quantity("shape factor for the policy relative, instead of the law's own", above=0.0, most=1.0)
]
Coefficient = Annotated[
    float,
    Quantity("coefficient of I1 - 3, half of the initial shear modulus of Yeoh's law", "Pa", least=-1e13, most=1e13),
]


class Law(IntEnum):
    """The stress-strain laws. The first four and the last have kernels of their own; the others use that of Ogden."""

    LINEAR = 0
    NEO_HOOKEAN = 1
    CURVE = 2
    OGDEN = 3
    YEOH = 4
    MOONEY_RIVLIN = 5
    ARRUDA_BOYCE = 6
    GENT = 7
    STABLE_NEO_HOOKEAN = 8


@dataclass(frozen=True, kw_only=True)
class Material(CheckedKeys):
    """Base class of all laws.

    Attributes:
        poisson: initial Poisson's ratio, -1 < nu <= 0.5; 0.5 is incompressible.
        density: mass density [kg/m^3]; None if unknown. Only gravity and dynamics need it.
        omega: shape factor for the ``relative`` policy; None stands for the factor that follows from the law.
        caveat: limitation of the measurement that gave the parameters; empty if there is none.

    Raises:
        ValueError: a parameter is out of range.
    """

    poisson: float
    density: Density | None = None
    omega: Omega | None = None
    caveat: str = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not -1.0 < self.poisson <= 0.5:
            raise ValueError(f"poisson must lie in -1 < poisson <= 0.5, got {self.poisson!r}; 0.5 is incompressible")

    law = Law.LINEAR

    @classmethod
    def parameters(cls) -> dict[str, Quantity]:
        """Return a dict from name to quantity, for the numbers that this law has in addition to those of `Material`."""
        common = quantities_of(Material)
        return {name: quantity for name, quantity in quantities_of(cls).items() if name not in common}

    @property
    def kernel(self) -> Law:
        """Law whose compiled kernel computes this law."""
        return self.law

    @property
    def terms(self) -> tuple[tuple[float, float], ...]:
        """Moduli mu_i [Pa] and exponents alpha_i of Ogden's terms; empty for other laws."""
        return ()

    @property
    def shear0(self) -> float:
        """Initial shear modulus [Pa]."""
        return self.young0 / (2.0 * (1.0 + self.poisson))

    @property
    def bulk(self) -> float:
        """Bulk modulus [Pa], K = 2 mu0 (1 + nu) / (3 (1 - 2 nu)); infinite at nu = 0.5."""
        if self.poisson == 0.5:
            return math.inf
        return 2.0 * self.shear0 * (1.0 + self.poisson) / (3.0 * (1.0 - 2.0 * self.poisson))

    @property
    def volume_modulus(self) -> float:
        """Modulus [Pa] of the volume energy: K, unless a law overrides it; infinite at nu = 0.5."""
        return self.bulk

    @property
    def young0(self) -> float:
        """Initial Young's modulus [Pa], E = 2 mu0 (1 + nu)."""
        return 2.0 * self.shear0 * (1.0 + self.poisson)

    def stress_at(self, strain: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the nominal stress [Pa] of incompressible uniaxial tension at engineering strains."""
        raise AssertionError(f"{type(self).__name__} states no uniaxial curve")

    def tangent_at(self, strain: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivative [Pa] of :meth:`stress_at`."""
        raise AssertionError(f"{type(self).__name__} states no uniaxial curve")

    def remarks(self) -> list[str]:
        """Return remarks on unusual or unstable parameters; empty if there are none."""
        return []


@dataclass(frozen=True, kw_only=True)
class Linear(Material):
    """Corotated linear law: stress is proportional to strain, also under large rotations.

    P = E/(1+nu) (F - lam R) + K (J-1) cof F, where lam = tr(R^T F)/3.

    Attributes:
        young: Young's modulus [Pa].
    """

    young: Modulus
    law = Law.LINEAR

    @property
    def young0(self) -> float:
        """Initial Young's modulus [Pa]."""
        return self.young

    def stress_at(self, strain: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return E e [Pa]."""
        return self.young * strain

    def tangent_at(self, strain: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return E [Pa]."""
        return np.full_like(strain, self.young)


@dataclass(frozen=True, kw_only=True)
class NeoHookean(Linear):
    """Neo-Hookean law, W = mu/2 (I1 - 3) - mu ln J + lambda/2 (ln J)^2.

    Attributes:
        young: initial Young's modulus [Pa].
    """

    law = Law.NEO_HOOKEAN

    def stress_at(self, strain: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the nominal stress E/3 (l - l^-2) [Pa] at the stretch l = 1 + ``strain``."""
        stretch = 1.0 + strain
        return self.young / 3.0 * (stretch - stretch**-2.0)

    def tangent_at(self, strain: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the tangent E/3 (1 + 2 l^-3) [Pa] at the stretch l = 1 + ``strain``."""
        return self.young / 3.0 * (1.0 + 2.0 * (1.0 + strain) ** -3.0)


@dataclass(frozen=True, kw_only=True)
class StableNeoHookean(Linear):
    """Stable neo-Hookean law of Smith, de Goes and Kim (2018), smooth also for inverted elements.

    W = m/2 (I1 - 3) - m/2 ln((I1 + 1)/4) - 3 m/4 (J - 1) + l/2 (J - 1)^2 with m = 4/3 mu and l = lambda + 5/6 mu,
    where mu and lambda are Lame's constants. Up to a constant, W is m/2 (I1 - 3) + l/2 (J - a)^2 - m/2 ln(I1 + 1) with
    a = 1 + 3 m / (4 l), as in their paper.

    Attributes:
        young: initial Young's modulus [Pa].
    """

    law = Law.STABLE_NEO_HOOKEAN

    @property
    def volume_modulus(self) -> float:
        """Modulus l = K + mu/6 [Pa] of the volume energy."""
        return self.bulk + self.shear0 / 6.0

    def stress_at(self, strain: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return 4 E/9 (1 - 1/(I1 + 1)) (l - l^-2) [Pa] at l = 1 + e, with I1 = l^2 + 2/l."""
        stretch = 1.0 + strain
        first = stretch**2 + 2.0 / stretch
        return 4.0 * self.young / 9.0 * (1.0 - 1.0 / (first + 1.0)) * (stretch - stretch**-2.0)

    def tangent_at(self, strain: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivative [Pa] of :meth:`stress_at`."""
        stretch = 1.0 + strain
        first, slope = stretch**2 + 2.0 / stretch, stretch - stretch**-2.0
        straight = (1.0 - 1.0 / (first + 1.0)) * (1.0 + 2.0 * stretch**-3.0)
        return 4.0 * self.young / 9.0 * (straight + 2.0 * slope**2 / (first + 1.0) ** 2)


@dataclass(frozen=True, kw_only=True)
class PrincipalLaw(Material):
    """Base class of laws that are sums of Ogden's ``terms`` (Abaqus' convention, Eq. 11).

    W = sum_i 2 mu_i / alpha_i^2 (l1^alpha_i + l2^alpha_i + l3^alpha_i - 3) + K/2 (J - 1)^2. Here l1, l2, l3 are the
    isochoric principal stretches. The initial shear modulus is mu0 = sum_i mu_i.
    """

    law = Law.OGDEN
    kernel = Law.OGDEN

    @property
    def shear0(self) -> float:
        """Initial shear modulus [Pa]."""
        return float(sum(mu for mu, _ in self.terms))

    def stress_at(self, strain: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return sum_i 2 mu_i / alpha_i (l^(alpha_i - 1) - l^(-alpha_i/2 - 1)) [Pa] at l = 1 + e."""
        stretch = 1.0 + np.asarray(strain, dtype=np.float64)
        parts = (
            2.0 * mu / alpha * (stretch ** (alpha - 1.0) - stretch ** (-0.5 * alpha - 1.0)) for mu, alpha in self.terms
        )
        return sum(parts, np.zeros_like(stretch))

    def tangent_at(self, strain: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivative [Pa] of :meth:`stress_at`."""
        stretch = 1.0 + np.asarray(strain, dtype=np.float64)
        parts = (
            2.0
            * mu
            / alpha
            * ((alpha - 1.0) * stretch ** (alpha - 2.0) + (0.5 * alpha + 1.0) * stretch ** (-0.5 * alpha - 2.0))
            for mu, alpha in self.terms
        )
        return sum(parts, np.zeros_like(stretch))

    def remarks(self) -> list[str]:
        """Return remarks on the deformations and stretches at which the law is unstable; empty if there are none."""
        return drucker_remarks(separable_hessian(self._stiffness))

    def _stiffness(self, stretch: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return d tau / d ln l = sum_i 2 mu_i l^alpha_i [Pa] at a principal stretch l; tau is the Kirchhoff stress."""
        return sum((2.0 * mu * stretch**alpha for mu, alpha in self.terms), np.zeros_like(stretch))


@dataclass(frozen=True, kw_only=True)
class Ogden(PrincipalLaw):
    """Ogden's law in Abaqus' convention.

    Attributes:
        mu: moduli mu_i [Pa] of one to six terms.
        alpha: exponents alpha_i, nonzero, as many as ``mu``.
    """

    mu: Annotated[tuple[float, ...], Quantity("moduli mu_i", "Pa", count=ANY)]
    alpha: Annotated[tuple[float, ...], Quantity("exponents alpha_i", least=-20.0, most=20.0, count=ANY)]

    def __post_init__(self) -> None:
        if not 1 <= len(self.mu) <= 6 or len(self.mu) != len(self.alpha):
            raise ValueError(
                f"mu and alpha must have equal length of 1 to 6 terms, got {len(self.mu)} and {len(self.alpha)}"
            )
        super().__post_init__()
        if 0.0 in self.alpha:
            raise ValueError("mu and alpha must be finite and no alpha zero")
        require_within("sum of mu (the initial shear modulus)", sum(self.mu), 0.0, 1e13, "check units and signs of mu")

    @property
    def terms(self) -> tuple[tuple[float, float], ...]:
        """Moduli mu_i [Pa] and exponents alpha_i."""
        return tuple(zip(self.mu, self.alpha, strict=True))


@dataclass(frozen=True, kw_only=True)
class MooneyRivlin(PrincipalLaw):
    """Law of Mooney and Rivlin, W = C10 (I1 - 3) + C01 (I2 - 3), with the coefficients of Abaqus.

    It is Ogden's law with the exponents 2 and -2 and the moduli 2 C10 and 2 C01.

    Attributes:
        c10, c01: coefficients [Pa]; mu0 = 2 (C10 + C01).
    """

    c10: Coefficient
    c01: Annotated[float, Quantity("coefficient of I2 - 3", "Pa", least=-1e13, most=1e13)]
    law = Law.MOONEY_RIVLIN

    def __post_init__(self) -> None:
        super().__post_init__()
        require_within("c10 + c01 (half of the initial shear modulus)", self.c10 + self.c01, 0.0, 1e13, "in Pa")

    @property
    def terms(self) -> tuple[tuple[float, float], ...]:
        """Moduli mu_i [Pa] and exponents alpha_i of Ogden's law."""
        return (2.0 * self.c10, 2.0), (2.0 * self.c01, -2.0)


RIBBON = 4.0 ** (2.0 / 3.0) - 1.0
"""Strain in incompressible tension beyond which the equivalent strain falls if the cross section becomes flat."""


@dataclass(frozen=True, kw_only=True)
class Curve(Material):
    """Law from a measured uniaxial curve, extended to three dimensions by Eq. 5: W = Phi(eps_eq) + K/2 (J - 1)^2.

    ``Phi`` is chosen so that uniaxial tension at J = 1 reproduces the curve exactly (docs/theory/energy.md). The
    equivalent strain ``eps_eq`` has no sign, so that compression and shear follow from the tension curve.

    Attributes:
        data: the measured curve.
    """

    data: CurveData
    law = Law.CURVE

    @property
    def shear0(self) -> float:
        """Initial shear modulus E0 / 3 [Pa]; the deviatoric energy uses nu = 0.5 in Eq. 5."""
        return self.data.initial_modulus / 3.0

    def stress_at(self, strain: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the nominal stress [Pa] of the measured curve, continued beyond its data."""
        return self.data.stress_at(strain)

    def tangent_at(self, strain: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the slope of the measured curve [Pa], continued beyond its data."""
        return self.data.tangent_at(strain)

    def remarks(self) -> list[str]:
        """Return remarks on strains at which the curve or its law is unstable, or its stress not positive."""
        found = self.data.remarks()
        if self.data.strain_max > RIBBON:
            text = f"beyond a strain of {RIBBON:.3g}, a bar in tension becomes a flat ribbon, which has less energy"
            found.append(f"{text}; remedy: the law `ogden`, or one from `gdfe fit`, for such strains")
        return found


def require_within(name: str, value: float, low: float, high: float, remedy: str) -> None:
    """Raise ValueError with a remedy if a value is not between two bounds."""
    if not low < value < high:
        raise ValueError(f"{name} must lie in {low:g} < {name} < {high:g}, got {value!r}; {remedy}")


def lacks_density(materials: Mapping[str, Material], what: str) -> str:
    """Return a message that names the materials without a density; empty if every material has one.

    The message starts with ``what``, e.g. ``gravity needs``.
    """
    light = [key for key, material in materials.items() if material.density is None]
    return f"{what} a density: give `density` [kg/m^3] to {', '.join(light)}" if light else ""


def cell_densities(materials: Mapping[str, Material], cell_material: NDArray[np.int32]) -> NDArray[np.float64]:
    """Return the density (m,) [kg/m^3] of each cell; ``cell_material`` (m,) are the indices of the cells' materials."""
    return np.array([material.density for material in materials.values()])[cell_material]
