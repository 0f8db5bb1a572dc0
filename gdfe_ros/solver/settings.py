# SPDX-License-Identifier: Apache-2.0
"""Settings of the solver, and of the dynamics of a scene."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Annotated

from gdfe_ros.keys import CheckedKeys, FieldError, Meaning
from gdfe_ros.quantity import Quantity, Vector


class Policy(str, Enum):
    """Rule that gives an element's shape factor and desired shape from its material."""

    ENERGY = "energy"
    RELATIVE = "relative"


class Torsion(str, Enum):
    """Model of an element's torsional stiffness, which the element's single integration point does not resolve."""

    CELL = "cell"
    """Each cell resists torsion as a separate bar: exact with one cell across a bar, 14 % too stiff with two cells."""
    SECTION = "section"
    """Each cell resists torsion as part of a section that is as many cells wide as the shortest row through the cell.
    This is exact for square bars one to four cells across.
    """


class Skip(str, Enum):
    """Kinds of work that are left out if a scene does not need them; the value is the key in `StepResult.skipped`.

    ``EIGENVALUES`` and ``ACTUATORS`` are only counted: a scene that does not need them never computes them anyway.
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


class Scheme(str, Enum):
    """Time integration scheme; all are of second order (docs/theory/motion.md)."""

    BDF2 = "bdf2"
    NEWMARK = "newmark"
    GENERALISED_ALPHA = "generalised_alpha"


_DRAG = Quantity("damping force per mass and velocity, relative to the world", "1/s", least=0.0, most=1e6)
# With a larger viscosity, the rounding of strains causes larger forces than the elastic forces of soft bodies.
_VISCOSITY = Quantity(
    "viscosity: stress per rate of strain, in addition to the material's stress", "Pa s", least=0.0, most=1e8
)
_SHARE = Quantity("fraction of the instantaneous modulus that this branch carries", above=0.0, below=1.0)
_TIME = Quantity("relaxation time, in which the branch's stress falls to 1/e", "s", above=0.0, most=1e9)
_SCHEME = Meaning(
    "bdf2: damps motion that the steps are too long to resolve; newmark: conserves the energy; "
    "generalised_alpha: damps unresolved motion by the amount that rho_inf sets"
)
_RHO = Quantity(
    "spectral radius of generalised_alpha: fraction of an infinitely fast motion that remains after a step",
    least=0.0,
    most=1.0,
)
_PRONY = Meaning("branches of a Prony series; the sum of their shares is less than 1")
_VELOCITY = Quantity(
    "velocity of all soft bodies at the start [x, y, z]; axes that a handle holds are at rest",
    "m/s",
    least=-1e4,
    most=1e4,
    count=3,
)
_SPIN = Quantity(
    "angular velocity of all soft bodies about their common centre of mass at the start [x, y, z]",
    "rad/s",
    least=-1e4,
    most=1e4,
    count=3,
)


@dataclass(frozen=True)
class Damping(CheckedKeys):
    """Damping of a body in motion.

    The viscosity is the viscous second Piola-Kirchhoff stress, divided by the rate of the Green strain.
    """

    mass: Annotated[float, _DRAG] = 0.0
    viscosity: Annotated[float, _VISCOSITY] = 0.0


@dataclass(frozen=True)
class Branch(CheckedKeys):
    """A branch of a Prony series: stiffness that relaxes. The material's law is the stiffness after full relaxation."""

    share: Annotated[float, _SHARE]
    time: Annotated[float, _TIME]


@dataclass(frozen=True)
class Dynamics(CheckedKeys):
    """Inertia, damping and time steps; without this entry every step ends in a static equilibrium.

    A step of a simulation is divided into equal internal steps. The branches of the Prony series are parallel to the
    material, as in a generalised Maxwell body.

    Attributes:
        restarts: whether every step starts anew from the last state, without the history of earlier steps.

    Raises:
        ValueError: a value is out of range.
    """

    scheme: Annotated[Scheme, _SCHEME] = Scheme.GENERALISED_ALPHA
    rho_inf: Annotated[float, _RHO] = 0.8
    step: Annotated[float, Quantity("longest internal step in time", "s", least=1e-6, most=10.0)] = 0.005
    damping: Damping = Damping()
    prony: Annotated[tuple[Branch, ...], _PRONY] = ()
    velocity: Annotated[Vector, _VELOCITY] = (0.0, 0.0, 0.0)
    spin: Annotated[Vector, _SPIN] = (0.0, 0.0, 0.0)

    restarts = False

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "scheme", Scheme(self.scheme))
        if self.rho_inf != Dynamics.rho_inf:
            self.require_effect()
        total = sum(branch.share for branch in self.prony)
        if total >= 1.0:
            raise ValueError(
                f"the shares of the Prony series sum to {total:.6g}; allowed: less than 1; remedy: smaller "
                "shares, because the rest up to 1 carries slow loads"
            )

    def require_effect(self) -> None:
        """Raise FieldError if the scheme ignores ``rho_inf``."""
        if self.scheme is not Scheme.GENERALISED_ALPHA:
            text = f"belongs to the scheme generalised_alpha and would be ignored by {self.scheme.value}"
            raise FieldError("rho_inf", self.rho_inf, f"{text}; remedy: leave it out, or set scheme: generalised_alpha")

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
        """Energy that the first step may add, divided by h^2 a^T M a: step length h, accelerations a at the start.

        Numerical damping removes this energy later.
        """
        damped = 0.0 if self.scheme is Scheme.BDF2 else (1.0 - self.radius) / (1.0 + self.radius)
        return 0.125 * damped**2

    @property
    def damps(self) -> bool:
        """Whether the material has viscosity or Prony branches, whose stresses depend on the rate of strain."""
        return bool(self.damping.viscosity or self.prony)

    def relaxation(self, shear: float) -> float:
        """Return the longest time constant [s] of the creep of a material with the shear modulus ``shear`` [Pa]."""
        return max([0.5 * self.damping.viscosity / shear, *(branch.time for branch in self.prony)])

    @property
    def slow_share(self) -> float:
        """Modulus that remains in slow motion (that of the material's law), divided by the instantaneous modulus."""
        return 1.0 - sum(branch.share for branch in self.prony)


class BackwardEuler(Dynamics):
    """The dynamics of a scene with steps of backward Euler, the first step of `bdf2`: it needs only the last state."""

    restarts = True

    @classmethod
    def of(cls, dynamics: Dynamics) -> BackwardEuler:
        """Return the dynamics with backward Euler as their scheme."""
        return cls(**{**vars(dynamics), "scheme": Scheme.BDF2, "rho_inf": Dynamics.rho_inf})
