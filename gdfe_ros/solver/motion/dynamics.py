# SPDX-License-Identifier: Apache-2.0
"""What a user may choose about motion."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

SHORTEST_STEP, LONGEST_STEP = 1e-6, 10.0
"""Internal steps [s] that are allowed."""
THICKEST = 1e8
"""Viscosity [Pa s] that is allowed at most: beyond, rounding of strains is larger than forces of soft bodies."""


class Scheme(str, Enum):
    """How a step in time is discretised; all are of second order (docs/theory/motion.md)."""

    BDF2 = "bdf2"
    NEWMARK = "newmark"
    GENERALISED_ALPHA = "generalised_alpha"


@dataclass(frozen=True)
class Branch:
    """One term of a Prony series.

    Attributes:
        share: of the modulus at once that this branch carries, above 0.
        time: in which its stress falls to 1/e [s].
    """

    share: float
    time: float


@dataclass(frozen=True)
class Dynamics:
    """Inertia, damping and steps in time.

    Attributes:
        scheme: ``bdf2`` damps what a step does not resolve, ``newmark`` keeps the energy, ``generalised_alpha`` damps
            as much as ``rho_inf`` says.
        rho_inf: spectral radius of ``generalised_alpha`` at infinite frequency, 0 to 1; other schemes have none.
        step: longest internal step [s]; a step of a simulation is cut into equal ones no longer than it.
        mass_damping: force over mass and velocity, against the world [1/s].
        viscosity: second Piola-Kirchhoff stress over the rate of the Green strain [Pa s].
        prony: branches of a generalised Maxwell body beside the material, whose law is that of slow motion.
        velocity: (3,) of every vertex at the start [m/s].
        spin: (3,) angular velocity about the centre of mass at the start [rad/s].

    Raises:
        ValueError: a value is out of range.
    """

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
        if not SHORTEST_STEP <= self.step <= LONGEST_STEP:
            raise ValueError(f"step must lie in {SHORTEST_STEP:g} .. {LONGEST_STEP:g} s, got {self.step!r}")
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
    def swing(self) -> float:
        """Energy that the first step may give over h^2 a^T M a of the start; what damps gives it back later."""
        damped = (1.0 - self.rho_inf) / (1.0 + self.rho_inf) if self.scheme is Scheme.GENERALISED_ALPHA else 0.0
        return 0.125 * damped**2

    @property
    def damps(self) -> bool:
        """Whether strains that change are resisted."""
        return bool(self.viscosity or self.prony)

    def relaxation(self, shear: float) -> float:
        """Return the longest time [s] in which a material of this shear modulus [Pa] creeps to its shape."""
        return max([0.5 * self.viscosity / shear, *(branch.time for branch in self.prony)])

    @property
    def slow_share(self) -> float:
        """Share of the modulus at once that is left in slow motion, which is the material's law."""
        return 1.0 - sum(branch.share for branch in self.prony)
