# SPDX-License-Identifier: Apache-2.0
"""The parameters of a scene by name: commands, poses, numbers of materials and damping."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache, reduce

from gdfe_ros.actuators import Actuator, Mode
from gdfe_ros.actuators.load import Load
from gdfe_ros.constraints import Handle
from gdfe_ros.constraints.rigid_body import RigidBody
from gdfe_ros.errors import require_named
from gdfe_ros.materials import Curve, Material
from gdfe_ros.materials.table import YOUNG
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.sensitivity.parameter import MaterialVariant, Parameter, Variant
from gdfe_ros.solver.settings import Dynamics

AXES = ("x", "y", "z", "rx", "ry", "rz")
"""Components of a pose: translation [m] and rotation vector [rad]."""


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

    def find_parameters(self, names: Sequence[str]) -> list[Parameter]:
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
        """Add, as a parameter, the number that `with_number` replaces in the model at these ``keys``."""

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
        """Return the size of an actuator's command; differences change it by a hundred-thousandth of that."""
        size, young = self._body.size, float(self._body.table.parameters[:, YOUNG].min())
        return {
            Mode.TENSION: self.FAINT * young * size**2,
            Mode.PRESSURE: self.FAINT * young,
            Mode.VOLUME: 1e-2 * size**3,
        }.get(actuator.mode, size if actuator.mode.unit else 1.0)


def with_number(thing: object, keys: Sequence[str | int], value: float) -> object:
    """Return ``thing`` with ``value`` at the end of the path ``keys``: names of fields, keys of dicts, and indices."""
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
