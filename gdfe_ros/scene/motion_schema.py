# SPDX-License-Identifier: Apache-2.0
"""The keys of a scene file for motion: inertia, damping, attached masses."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, ValidationInfo, field_validator, model_validator

from gdfe_ros.scene.entry import Entry
from gdfe_ros.scene.quantity import Quantity
from gdfe_ros.scene.where_schema import WhereModel
from gdfe_ros.solver.motion.dynamics import THICKEST, Branch, Dynamics, Scheme

_STEP = Quantity("longest internal step in time", "s", least=Dynamics.SHORTEST_STEP, most=Dynamics.LONGEST_STEP)
_RHO = Quantity(
    "spectral radius of generalised_alpha: fraction of an infinitely fast motion that remains after a step",
    least=0.0,
    most=1.0,
)
_MASS_DAMPING = Quantity("damping force per mass and velocity, relative to the world", "1/s", least=0.0, most=1e6)
_VISCOSITY = Quantity(
    "viscosity: stress per rate of strain, in addition to the material's stress", "Pa s", least=0.0, most=THICKEST
)
_SHARE = Quantity("fraction of the instantaneous modulus that this branch carries", above=0.0, below=1.0)
_TIME = Quantity("relaxation time, in which the branch's stress falls to 1/e", "s", above=0.0, most=1e9)
_VELOCITY = Quantity("velocity of every vertex at the start [x, y, z]", "m/s", least=-1e4, most=1e4, count=3)
_SPIN = Quantity(
    "angular velocity about the centre of mass at the start [x, y, z]", "rad/s", least=-1e4, most=1e4, count=3
)
_MASS = Quantity("mass", "kg", above=0.0, most=1e6)


class DampingModel(Entry):
    """Damping of a body in motion."""

    mass: Annotated[float, _MASS_DAMPING] = 0.0
    viscosity: Annotated[float, _VISCOSITY] = 0.0


class BranchModel(Entry):
    """A branch of a Prony series: stiffness that relaxes. The material's law is the stiffness after full relaxation."""

    share: Annotated[float, _SHARE]
    time: Annotated[float, _TIME]


class DynamicsModel(Entry):
    """Inertia, damping and time steps; without this entry every step ends in a static equilibrium."""

    scheme: Scheme = Field(
        Dynamics.scheme,
        description="bdf2: damps motion that the steps are too long to resolve; newmark: conserves the energy; "
        "generalised_alpha: damps unresolved motion by the amount that rho_inf sets",
    )
    rho_inf: Annotated[float, _RHO] = Dynamics.rho_inf
    step: Annotated[float, _STEP] = Dynamics.step
    damping: DampingModel = DampingModel()
    prony: tuple[BranchModel, ...] = Field(
        (), description="branches of a Prony series; the sum of their shares is less than 1"
    )
    velocity: Annotated[tuple[float, float, float], _VELOCITY] = (0.0, 0.0, 0.0)
    spin: Annotated[tuple[float, float, float], _SPIN] = (0.0, 0.0, 0.0)

    @field_validator("rho_inf")
    @classmethod
    def _has_effect(cls, rho_inf: float, given: ValidationInfo) -> float:
        scheme = given.data.get("scheme", Scheme.GENERALISED_ALPHA)
        if scheme is not Scheme.GENERALISED_ALPHA:
            raise ValueError(
                f"belongs to the scheme generalised_alpha and would be ignored by {scheme.value}; remedy: leave it "
                "out, or set scheme: generalised_alpha"
            )
        return rho_inf

    @model_validator(mode="after")
    def _shares(self) -> DynamicsModel:
        total = sum(branch.share for branch in self.prony)
        if total >= 1.0:
            raise ValueError(
                f"the shares of the Prony series sum to {total:.6g}; allowed: less than 1; remedy: smaller "
                "shares, because the rest up to 1 carries slow loads"
            )
        return self

    def build(self) -> Dynamics:
        """Return the dynamics."""
        return Dynamics(
            scheme=self.scheme,
            rho_inf=self.rho_inf,
            step=self.step,
            mass_damping=self.damping.mass,
            viscosity=self.damping.viscosity,
            prony=tuple(Branch(branch.share, branch.time) for branch in self.prony),
            velocity=self.velocity,
            spin=self.spin,
        )


class MassModel(Entry):
    """A mass that is attached to vertices or to a probe: it adds weight under gravity, and inertia in motion."""

    mass: Annotated[float, _MASS]
    where: WhereModel | None = Field(
        None, description="the vertices among which the mass is divided equally, e.g. {face: x+}"
    )
    probe: str | None = Field(None, description="name of the probe that the mass is attached to")

    @model_validator(mode="after")
    def _one_place(self) -> MassModel:
        if (self.where is None) == (self.probe is None):
            raise ValueError("give either where or probe")
        return self
