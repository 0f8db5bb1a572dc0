# SPDX-License-Identifier: Apache-2.0
"""A parameter of derivatives: a command, a component of a pose, or a number in the materials or the damping."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import sparse

from gdfe_ros.actuators.load import AttachedMass, Gravity, Load
from gdfe_ros.constraints import Pose
from gdfe_ros.materials import Material, cell_densities
from gdfe_ros.materials.table import MaterialTable, pack
from gdfe_ros.mesh.cells.filling import Filling
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.motion import inertia, viscosity
from gdfe_ros.solver.motion.inertia import FreeMass, Inertia, mass_matrix
from gdfe_ros.solver.motion.viscosity import Viscosity
from gdfe_ros.solver.settings import Dynamics
from gdfe_ros.solver.terms.applied_load import DeadLoadTerm
from gdfe_ros.solver.terms.term import Term


@dataclass(frozen=True, eq=False, kw_only=True)
class MaterialVariant:
    """Data of a scene that depend on its materials and its damping.

    Attributes:
        materials: dict from name to material, in the scene's order.
        loads: dead loads.
        masses: attached masses.
        filling: filled fraction of the cells.
        dynamics: damping; None for equilibria.
    """

    materials: Mapping[str, Material]
    loads: Sequence[Load]
    masses: tuple[AttachedMass, ...]
    filling: Filling | None
    dynamics: Dynamics | None


class Variant:
    """A body with other materials or damping.

    Args:
        body: the body.
        own: the body's own materials and damping.
        model: the other materials and damping.

    Attributes:
        table: the packed materials of ``model``.
        dynamics: dynamics of ``model``.
    """

    def __init__(self, body: Body, own: MaterialVariant, model: MaterialVariant) -> None:
        materials = tuple(model.materials.values())
        changed = materials != tuple(own.materials.values())
        self.table: MaterialTable = body.cell_type.table(pack(materials)) if changed else body.table
        self._body = replace(body, materials=materials, table=self.table)
        self._model, self.dynamics = model, model.dynamics
        self._heavier = [each.density for each in materials] != [each.density for each in own.materials.values()]

    def terms(self, h: float | None = None, scheme: Dynamics | None = None) -> dict[str, Term]:
        """Return a dict from name to term, with the terms that change with materials or damping.

        In motion, ``h`` [s] is the step length, and ``scheme`` has the time integration scheme in use. Both are None
        for equilibria.
        """
        terms = dict(self._loads)
        if h is None:
            return terms
        dynamics = replace(scheme, damping=self.dynamics.damping, prony=self.dynamics.prony)
        terms[inertia.NAME] = Inertia(self._body, self.mass, dynamics, h)
        if dynamics.damps:
            terms[viscosity.NAME] = Viscosity(self._body, dynamics, h)
        return terms

    @cached_property
    def _loads(self) -> dict[str, Term]:
        """Dict from name to gravity term if densities differ; otherwise empty."""
        if not self._heavier:
            return {}
        density = cell_densities(self._model.materials, self._body.material)
        loads = [replace(load, density=density) for load in self._model.loads if isinstance(load, Gravity)]
        return {load.name: DeadLoadTerm(load, self._body) for load in loads}

    @cached_property
    def mass(self) -> sparse.csr_matrix:
        """The mass matrix (n, n) [kg]."""
        density, model = cell_densities(self._model.materials, self._body.material), self._model
        return mass_matrix(self._body.rest, self._body.cells, density, model.masses, filling=model.filling)

    @cached_property
    def free_mass(self) -> FreeMass | None:
        """Mass of the free vertices and the rigid bodies, with which contacts strike; None if no density differs."""
        return FreeMass(self._body, self.mass) if self._heavier else None


@dataclass(frozen=True, eq=False, kw_only=True)
class Parameter:
    """A parameter of a derivative.

    Attributes:
        name: dotted name from the scene's keys.
        unit: unit of the value; empty for a dimensionless parameter.
        value: value in the model; zero for poses and commands, whose values are in the state.
        scale: least order of magnitude of the value; the variation in finite differences is proportional to it
            (`step`).
        command: name of the actuator or load whose command the parameter is; empty for other parameters.
        handle: name of the handle of whose pose the parameter is a component; empty for other parameters.
        axis: index of the component of the pose.
        model: function that returns the `Variant` of the body for another value; None for poses and commands.
    """

    NEAR = 1e-5
    """Variation of a parameter in a finite difference, divided by its order of magnitude. Forces are smooth functions
    of the parameter, so that the relative error is about 1e-10.
    """
    TOUCH = 1e-8
    """Variation of a translation or of a commanded length, divided by the body's size, and of a rotation [rad]. It is
    so small that no contact opens or closes, and that no cable becomes slack.
    """

    name: str
    unit: str
    scale: float
    value: float = 0.0
    command: str = ""
    handle: str = ""
    axis: int = 0
    model: Callable[[float], Variant] | None = None

    def step(self, commands: Mapping[str, float]) -> float:
        """Return the variation of the parameter for finite differences, in its unit, at the given commands."""
        near = self.TOUCH if self.unit in ("m", "rad") else self.NEAR
        return near * max(self.scale, abs(commands[self.command]) if self.command else 0.0)

    def change_commands(self, commands: Mapping[str, float], change: float) -> Mapping[str, float]:
        """Return the commands; if the parameter is a command, ``change`` is added to this command."""
        return {**commands, self.command: commands[self.command] + change} if self.command else commands

    def change_poses(self, poses: Mapping[str, Pose], change: float) -> Mapping[str, Pose]:
        """Return the poses; if the parameter is a component of a pose, ``change`` is added to this component."""
        if not self.handle:
            return poses
        return {**poses, self.handle: move_pose(poses[self.handle], np.eye(6)[self.axis] * change)}


def move_pose(pose: Pose, change: Sequence[float]) -> Pose:
    """Return ``pose`` with ``change`` (6,) added to its translation [m] and rotation vector [rad]."""
    parts = np.concatenate([pose.translation, pose.rotation]) + change
    return Pose(tuple(parts[:3]), tuple(parts[3:]))
