# SPDX-License-Identifier: Apache-2.0
"""Settings of the solver."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Policy(str, Enum):
    """Rule by which an element's shape factor and desired shape follow from its material."""

    ENERGY = "energy"
    RELATIVE = "relative"


class Torsion(str, Enum):
    """Model of an element's torsional stiffness; the element's single integration point does not resolve it."""

    CELL = "cell"
    """Each cell resists torsion as a separate bar: exact for a body one cell across, 14 % too stiff for two cells."""
    SECTION = "section"
    """Each cell resists torsion as a part of its cross-section, by the number of cells there: exact in square bars of
    one to four cells across.
    """


class Skip(str, Enum):
    """Kinds of work that are left out if a scene does not need them; the value is the name in results.

    ``EIGENVALUES`` and ``ACTUATORS`` are only counted: a scene without them has no such code path.
    """

    SOLVE = "solve"
    HANDLES = "elements inside handles"
    DORMANT = "dormant elements"
    SHAPE_FACTORS = "shape factor updates"
    PRESSURES = "pressure updates"
    EIGENVALUES = "eigenvalues"
    ACTUATORS = "actuators"


@dataclass(frozen=True)
class SolverSettings:
    """Settings of the equilibrium solver.

    Attributes:
        policy: ``energy`` (force-consistent shape factors) or ``relative`` (the paper as published).
        tolerance: a step counts as converged if the estimated largest distance to the equilibrium, over the body's
            size, is at most this; 1e-12 to 1e-1. The preconditioned step gives the estimate.
        steps: number of load steps for a program; None lets the solver choose.
        max_iterations: limit of iterations of one increment; a step beyond it is returned as not converged. A command
            that is divided into n increments from the start has n times this limit.
        threads: most threads that divide the elements of a solve under ``energy``, 1 to 1024; never more than numba's
            number of threads (``NUMBA_NUM_THREADS``, by default the machine's cores). The result does not depend on it,
            bit by bit.
        skip: kinds of work that are left out where the result changes by less than the tolerance; by default all kinds.
        torsion: model of torsional stiffness under ``energy``.

    Raises:
        ValueError: a value is out of range.
    """

    policy: Policy = Policy.ENERGY
    tolerance: float = 1e-4
    steps: int | None = None
    max_iterations: int = 2000
    threads: int = 1
    skip: tuple[Skip, ...] = tuple(Skip)
    torsion: Torsion = Torsion.CELL

    def __post_init__(self) -> None:
        object.__setattr__(self, "skip", tuple(Skip(item) for item in self.skip))
        object.__setattr__(self, "policy", Policy(self.policy))
        object.__setattr__(self, "torsion", Torsion(self.torsion))
        if self.torsion is Torsion.SECTION and self.policy is Policy.RELATIVE:
            raise ValueError("torsion: section needs policy: energy; relative has no hourglass energy; leave it out")
        if not 1e-12 <= self.tolerance <= 1e-1:
            raise ValueError(f"tolerance must lie in 1e-12 .. 1e-1, got {self.tolerance!r}")
        for name, most in (("steps", 1_000_000), ("max_iterations", 1_000_000), ("threads", 1024)):
            value = getattr(self, name)
            if value is not None and not 1 <= value <= most:
                raise ValueError(f"{name} must lie in 1 .. {most}, got {value!r}")
