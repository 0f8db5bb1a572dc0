# SPDX-License-Identifier: Apache-2.0
"""Named parameters of derivatives: commands, poses, numbers of materials and damping; and scenes with other numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, reduce

import numpy as np
from scipy import sparse

from gdfe_ros.actuators import Actuator, Mode
from gdfe_ros.actuators.actuator import Grip, Growth
from gdfe_ros.actuators.load import AttachedMass, Gravity, Load
from gdfe_ros.constraints import Handle, Pose
from gdfe_ros.constraints.rigid_body import RigidBody
from gdfe_ros.errors import require_named
from gdfe_ros.materials import Curve, Material, cell_densities
from gdfe_ros.materials.table import YOUNG, MaterialTable, pack
from gdfe_ros.mesh.filling import Filling
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.motion import inertia, viscosity
from gdfe_ros.solver.motion.dynamics import Dynamics
from gdfe_ros.solver.motion.inertia import Inertia, mass_matrix
from gdfe_ros.solver.motion.viscosity import Viscosity
from gdfe_ros.solver.terms.load import DeadLoadTerm
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
        """Return a dict from name to term for the terms that differ from those of the body.

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


AXES = ("x", "y", "z", "rx", "ry", "rz")
"""Components of a pose: translation [m] and rotation vector [rad]."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Parameter:
    """A parameter of a derivative.

    Attributes:
        name: dotted name from the scene's keys.
        unit: unit of the value; empty for a dimensionless parameter.
        value: value in the model; zero for poses and commands, whose values are in the state.
        scale: lower bound of the order of magnitude of the value, for `step`.
        command: name of the actuator or load whose command the parameter is; empty for other parameters.
        handle: name of the handle whose pose has the parameter as component; empty for other parameters.
        axis: index of the component of the pose.
        model: function that returns the body for another value; None for poses and commands.
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

    def commanded(self, commands: Mapping[str, float], change: float) -> Mapping[str, float]:
        """Return the commands; if the parameter is a command, ``change`` is added to this command."""
        return {**commands, self.command: commands[self.command] + change} if self.command else commands

    def posed(self, poses: Mapping[str, Pose], change: float) -> Mapping[str, Pose]:
        """Return the poses; if the parameter is a component of a pose, ``change`` is added to this component."""
        if not self.handle:
            return poses
        return {**poses, self.handle: moved(poses[self.handle], np.eye(6)[self.axis] * change)}


def moved(pose: Pose, change: Sequence[float]) -> Pose:
    """Return ``pose`` with ``change`` (6,) added to its translation [m] and rotation vector [rad]."""
    parts = np.concatenate([pose.translation, pose.rotation]) + change
    return Pose(tuple(parts[:3]), tuple(parts[3:]))


class Parameters:
    """The parameters of a scene.

    Args:
        body: the discretised body.
        model: materials and damping of the body.
        actuators, loads, handles: actuators, loads and handles of the scene.
    """

    FAINT = 1e-8
    """Order of magnitude of a tension, divided by Young's modulus times the squared body size, and of a pressure,
    divided by Young's modulus. It may be small, because forces are linear in tension and pressure.
    """

    def __init__(
        self,
        body: Body,
        model: MaterialVariant,
        actuators: Sequence[Actuator],
        loads: Sequence[Load],
        handles: Sequence[Handle],
    ) -> None:
        self._body, self._model, self._made = body, model, {}
        for each in actuators:
            self._add(f"actuators.{each.name}", each.mode.unit, self._size_of(each), command=each.name)
        for each in loads:
            self._add(f"loads.{each.name}", "", 1.0, command=each.name)
        for each in handles:
            if each.fixed or isinstance(each, RigidBody):
                continue
            for axis, part in enumerate(AXES):
                scale = body.size if axis < 3 else 1.0
                unit = "m" if axis < 3 else "rad"
                self._add(f"{each.section}.{each.name}.{part}", unit, scale, handle=each.name, axis=axis)
        for name, material in model.materials.items():
            self._add_material(name, material)
        if model.dynamics is not None:
            self._add_damping(model.dynamics)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all parameters."""
        return tuple(self._made)

    def named(self, names: Sequence[str]) -> list[Parameter]:
        """Return parameters by their names.

        Raises:
            CommandError: there is no such parameter.
        """
        for name in names:
            require_named("parameter", name, self._made, " in this scene")
        return [self._made[name] for name in names]

    def _add(self, name: str, unit: str, scale: float, **more: object) -> None:
        self._made[name] = Parameter(name=name, unit=unit, scale=scale, **more)

    def _vary(self, name: str, unit: str, scale: float, *keys: str | int) -> None:
        """Add the number of the model at ``keys`` as a parameter; they are those of `with_number`."""

        @cache
        def model(changed: float) -> Variant:
            return Variant(self._body, self._model, with_number(self._model, keys, changed))

        self._add(name, unit, scale, value=reduce(part_of, keys, self._model), model=model)

    def _add_material(self, name: str, material: Material) -> None:
        """Add the parameters of a material's law, and its Poisson's ratio unless it is incompressible."""

        def add(unit: str, scale: float, *keys: str | int) -> None:
            own = ".".join(str(key) for key in keys if key != "data")
            self._vary(f"materials.{name}.{own}", unit, scale, "materials", name, *keys)

        for key, quantity in type(material).parameters().items():
            value = getattr(material, key)
            if quantity.count is None:
                add(quantity.unit, max(abs(value), material.shear0 if quantity.unit else 0.0), key)
            for i, each in enumerate(() if quantity.count is None else value):
                add(quantity.unit, abs(each), key, i)
        if material.poisson < 0.5:
            add("", min(0.5 - material.poisson, 0.1), "poisson")
        if material.density is not None:
            add("kg/m^3", material.density, "density")
        if isinstance(material, Curve):
            for i, value in enumerate(material.data.coefficients):
                add("Pa", abs(value) or material.data.initial_modulus, "data", "coefficients", i)
            for i, value in list(enumerate(material.data.stress))[1:]:  # the first one is zero: undeformed
                add("Pa", abs(value) or material.data.initial_modulus, "data", "stress", i)

    def _add_damping(self, dynamics: Dynamics) -> None:
        for key, name, unit in (("mass", "mass_damping", "1/s"), ("viscosity", "viscosity", "Pa s")):
            if value := getattr(dynamics.damping, key):
                self._vary(f"dynamics.{name}", unit, value, "dynamics", "damping", key)
        for i, branch in enumerate(dynamics.prony):
            for key, unit in (("share", ""), ("time", "s")):
                self._vary(f"dynamics.prony.{i}.{key}", unit, getattr(branch, key), "dynamics", "prony", i, key)

    def _size_of(self, actuator: Actuator) -> float:
        """Return the order of magnitude of an actuator's command."""
        size, young = self._body.size, float(self._body.table.parameters[:, YOUNG].min())
        if isinstance(actuator, Grip | Growth):
            return 1.0
        return {
            Mode.TENSION: self.FAINT * young * size**2,
            Mode.PRESSURE: self.FAINT * young,
            Mode.VOLUME: 1e-2 * size**3,
        }.get(actuator.mode, size)


def with_number(thing: object, keys: Sequence[str | int], value: float) -> object:
    """Return ``thing`` with ``value`` at ``keys``, names of fields, keys of dicts and indices, outermost first."""
    if not keys:
        return value
    first, *rest = keys
    fresh = with_number(part_of(thing, first), rest, value)
    if isinstance(thing, Mapping):
        return {**thing, first: fresh}
    return (*thing[:first], fresh, *thing[first + 1 :]) if isinstance(first, int) else replace(thing, **{first: fresh})


def part_of(thing: object, key: str | int) -> object:
    """Return the entry of a dict or a tuple, or the field of another object."""
    return thing[key] if isinstance(thing, Mapping | tuple) else getattr(thing, key)
