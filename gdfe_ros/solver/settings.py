# SPDX-License-Identifier: Apache-2.0
"""Settings of the solver."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Annotated

from gdfe_ros.keys import CheckedKeys, Meaning
from gdfe_ros.quantity import Quantity


class Policy(str, Enum):
    """Rule that gives an element's shape factor and desired shape from its material."""

    ENERGY = "energy"
    RELATIVE = "relative"


class Torsion(str, Enum):
    """Model of an element's torsional stiffness; the element's single integration point does not resolve it."""

    CELL = "cell"
    """Each cell resists torsion as a separate bar: exact with one cell across a bar, 14 % too stiff with two cells."""
    SECTION = "section"
    """Each cell resists torsion as part of a cross-section with the counted number of cells. This is exact for square
    bars one to four cells across.
    """


class Skip(str, Enum):
    """Kinds of work that are left out if a scene does not need them; the value is the key in `StepResult.skipped`.

    ``EIGENVALUES`` and ``ACTUATORS`` are only counted, because a scene that does not need them never computes them.
    """

    SOLVE = "solve"
    HANDLES = "elements inside handles"
    SHAPE_FACTORS = "shape factor updates"
    PRESSURES = "pressure updates"
    EIGENVALUES = "eigenvalues"
    ACTUATORS = "actuators"


_POLICY = Meaning(
    "energy: minimises the strain energy, forces in newtons; relative: the method of the paper, as published"
)
_TOLERANCE = Quantity(
    "tolerance: allowed distance to the equilibrium, as a fraction of the body's size", least=1e-12, most=1e-1
)
_STEPS = Quantity(
    "number of load steps of a program; default: the solver chooses",
    least=1,
    most=1_000_000,
    whole=True,
    remedy="leave it out: the solver chooses",
)
_ITERATIONS = Quantity("largest number of iterations per step", least=1, most=1_000_000, whole=True)
_THREADS = Quantity("number of threads among which the elements are divided", least=1, most=1024, whole=True)
_TORSION = Meaning(
    "policy energy only; cell: each element resists torsion as a bar of its own; section: as a part of the body's "
    "cross-section"
)


@dataclass(frozen=True)
class SolverSettings(CheckedKeys):
    """Solver settings.

    Attributes:
        policy: ``energy`` (force-consistent shape factors) or ``relative`` (the paper as published).
        tolerance: a step counts as converged if the estimated largest distance of a vertex to the equilibrium, divided
            by the body's size, is at most this.
        steps: number of equal load steps into which a program is divided; None lets the solver choose.
        max_iterations: largest number of iterations of one increment; a step that needs more is returned as not
            converged. A command that is divided into n increments in advance has n times this limit.
        threads: largest number of threads among which a solve under ``energy`` divides the elements. It never uses more
            than numba's number of threads (``NUMBA_NUM_THREADS``, by default the machine's cores). The result does not
            depend on the number, bit by bit.
        skip: kinds of work that are left out where the result changes by less than the tolerance; by default all kinds.
        torsion: model of torsional stiffness under ``energy``.

    Raises:
        ValueError: a value is out of range.
    """

    policy: Annotated[Policy, _POLICY] = Policy.ENERGY
    tolerance: Annotated[float, _TOLERANCE] = 1e-4
    steps: Annotated[int, _STEPS] | None = None
    max_iterations: Annotated[int, _ITERATIONS] = 2000
    threads: Annotated[int, _THREADS] = 1
    skip: Annotated[tuple[Skip, ...], Meaning("kinds of work that are left out if not needed")] = tuple(Skip)
    torsion: Annotated[Torsion, _TORSION] = Torsion.CELL

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "skip", tuple(Skip(item) for item in self.skip))
        object.__setattr__(self, "policy", Policy(self.policy))
        object.__setattr__(self, "torsion", Torsion(self.torsion))
        if self.torsion is Torsion.SECTION and self.policy is Policy.RELATIVE:
            raise ValueError("torsion: section needs policy: energy; relative has no hourglass energy; leave it out")
