# SPDX-License-Identifier: Apache-2.0
"""Settings of the dynamics."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

THICKEST = 1e8
"""Largest viscosity [Pa s]. With a larger viscosity, the rounding of strains causes larger forces than the elastic
forces of soft bodies.
"""


class Scheme(str, Enum):
    """Time integration scheme; all are of second order (docs/theory/motion.md)."""

    BDF2 = "bdf2"
    NEWMARK = "newmark"
    GENERALISED_ALPHA = "generalised_alpha"


@dataclass(frozen=True)
class Branch:
    """One term of a Prony series.

    Attributes:
        share: fraction of the instantaneous modulus that this branch carries, above 0.
        time: relaxation time [s], in which the stress of this branch falls to 1/e.
    """

    share: float
    time: float


@dataclass(frozen=True)
class Dynamics:
    """Inertia, damping and time steps.

    Attributes:
        scheme: ``bdf2`` damps motion that a step does not resolve, ``newmark`` conserves energy, ``generalised_alpha``
            damps according to ``rho_inf``.
        rho_inf: spectral radius of ``generalised_alpha`` at infinite frequency, 0 to 1; other schemes do not use it.
        step: longest internal step [s]; a step of a simulation is divided into equal internal steps of at most this.
        mass_damping: damping force, divided by mass and by velocity relative to the world [1/s].
        viscosity: viscous second Piola-Kirchhoff stress, divided by the rate of the Green strain [Pa s].
        prony: branches of a generalised Maxwell body, parallel to the material. The material's law holds for slow
            motion.
        velocity: (3,) initial velocity of every vertex [m/s].
        spin: (3,) initial angular velocity about the centre of mass [rad/s].

    Raises:
        ValueError: a value is out of range.
    """

    SHORTEST_STEP, LONGEST_STEP = 1e-6, 10.0
    """Bounds of the internal step [s]."""

    scheme: Scheme = Scheme.GENERALISED_ALPHA
    rho_inf: float = 0.8
    step: float = 0.005
    mass_damping: float = 0.0
    viscosity: float = 0.0
    prony: tuple[Branch, ...] = ()
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    spin: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        object.__setattr__(self, "scheme", Scheme(self.scheme))
        if not self.SHORTEST_STEP <= self.step <= self.LONGEST_STEP:
            raise ValueError(f"step must lie in {self.SHORTEST_STEP:g} .. {self.LONGEST_STEP:g} s, got {self.step!r}")
        if not 0.0 <= self.rho_inf <= 1.0:
            raise ValueError(f"rho_inf must lie in 0 .. 1, got {self.rho_inf!r}")
        if self.scheme is not Scheme.GENERALISED_ALPHA and self.rho_inf != Dynamics.rho_inf:
            raise ValueError(f"rho_inf belongs to generalised_alpha, got {self.rho_inf!r} with {self.scheme.value}")
        for name in ("mass_damping", "viscosity"):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise ValueError(f"{name} must be finite and not negative, got {getattr(self, name)!r}")
        for name in ("velocity", "spin"):
            if not all(map(math.isfinite, getattr(self, name))):
                raise ValueError(f"{name} must be three finite numbers, got {getattr(self, name)!r}")
        if any(not (branch.share > 0.0 and 0.0 < branch.time < math.inf) for branch in self.prony):
            raise ValueError(f"shares and times of a Prony series must be positive and finite, got {self.prony!r}")
        if not sum(branch.share for branch in self.prony) < 1.0:
            raise ValueError(f"shares of a Prony series must sum to less than 1, got {self.prony!r}")

    @property
    def radius(self) -> float:
        """Spectral radius at infinite frequency: 1 for ``newmark``, 0 for ``bdf2``."""
        return {Scheme.NEWMARK: 1.0, Scheme.BDF2: 0.0}.get(self.scheme, self.rho_inf)

    @property
    def undamped(self) -> bool:
        """Whether the scheme has no numerical damping; `generalised_alpha` with the radius 1 is `newmark`."""
        return self.radius == 1.0

    @property
    def swing(self) -> float:
        """Energy that the first step may add, divided by h^2 a^T M a with the accelerations a at the start.

        Numerical damping removes this energy later.
        """
        damped = 0.0 if self.scheme is Scheme.BDF2 else (1.0 - self.radius) / (1.0 + self.radius)
        return 0.125 * damped**2

    @property
    def damps(self) -> bool:
        """Whether the material resists changes of strain."""
        return bool(self.viscosity or self.prony)

    def relaxation(self, shear: float) -> float:
        """Return the longest time constant [s] of the creep of a material with the shear modulus ``shear`` [Pa]."""
        return max([0.5 * self.viscosity / shear, *(branch.time for branch in self.prony)])

    @property
    def slow_share(self) -> float:
        """Fraction of the instantaneous modulus that remains in slow motion, to which the material's law applies."""
        return 1.0 - sum(branch.share for branch in self.prony)
