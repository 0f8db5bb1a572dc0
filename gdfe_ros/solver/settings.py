# SPDX-License-Identifier: Apache-2.0
"""What a user may choose about the solver."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Policy(str, Enum):
    """How an element's shape factor and desired shape follow from its material."""

    ENERGY = "energy"
    RELATIVE = "relative"


class Torsion(str, Enum):
    """As what an element resists torsion, where one integration point does not tell."""

    CELL = "cell"
    """A bar of its own: exact where the body is one cell across, too stiff by 14 % where it is two."""
    SECTION = "section"
    """A part of the section that it lies in, which is counted: exact in square bars of one to four cells across."""


FORMER_NAMES = {"elements inside plates": "elements inside handles"}
"""Of skipped work in scenes and bags that were written before a handle had one word; each with today's."""


class Skip(str, Enum):
    """Work that is left out where a scene does not need it; the name under which results count it.

    What a scene lacks altogether has no code path at all, and is counted only: ``EIGENVALUES`` and ``ACTUATORS``.
    """

    SOLVE = "solve"
    HANDLES = "elements inside handles"
    DORMANT = "dormant elements"
    SHAPE_FACTORS = "shape factor updates"
    PRESSURES = "pressure updates"
    EIGENVALUES = "eigenvalues"
    ACTUATORS = "actuators"

    @classmethod
    def _missing_(cls, value: object) -> Skip | None:
        return cls(FORMER_NAMES[value]) if value in FORMER_NAMES else None


@dataclass(frozen=True)
class SolverSettings:
    """Settings of the equilibrium solver.

    Attributes:
        policy: ``energy`` (force-consistent shape factors) or ``relative`` (the paper as published).
        tolerance: estimated largest distance to the equilibrium (from the preconditioned step), over the body's
            size, at which a step counts as converged; 1e-12 to 1e-1.
        steps: number of load steps for a program; None lets the solver choose.
        max_iterations: most iterations of one increment before a step is returned as not converged; a command that
            is cut into n increments from the start has n times as many.
        threads: most that share the elements of a solve under ``energy``, at most numba's (``NUMBA_NUM_THREADS``, by
            default the machine's cores); 1 to 1024. The result is the same to the last bit.
        skip: work that is left out where it changes nothing beyond the tolerance; all of it by default.
        torsion: as what elements resist torsion, under ``energy``.

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
            raise ValueError("torsion: section is of the policy energy, relative has no hourglass energy; leave it out")
        if not 1e-12 <= self.tolerance <= 1e-1:
            raise ValueError(f"tolerance must lie in 1e-12 .. 1e-1, got {self.tolerance!r}")
        for name, most in (("steps", 1_000_000), ("max_iterations", 1_000_000), ("threads", 1024)):
            value = getattr(self, name)
            if value is not None and not 1 <= value <= most:
                raise ValueError(f"{name} must lie in 1 .. {most}, got {value!r}")
