# SPDX-License-Identifier: Apache-2.0
"""The node's parameters, as described in ``interface``, and Young's moduli as parameters."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.lifecycle import LifecycleNode
from rclpy.parameter import Parameter

from gdfe_ros.errors import GdfeError
from gdfe_ros.node.driving.remodelling import moduli_of
from gdfe_ros.node.interface import MODULUS, PARAMETERS, Changeable, ParameterSpec
from gdfe_ros.node.middleware.managed import ManagedNode
from gdfe_ros.scene.scene import Scene
from gdfe_ros.untrusted.bounded_text import require_plain
from gdfe_ros.untrusted.real_number import is_finite, is_number
from gdfe_ros.untrusted.spelling import did_you_mean

_OPEN = {
    Changeable.INACTIVE: ("unconfigured", "inactive"),
    Changeable.UNCONFIGURED: ("unconfigured",),
    Changeable.START: (),
}
"""States in which a parameter may be changed."""


class NodeParameters(Mapping[str, Any]):
    """The parameters of one node: ``parameters["rate"]`` is the present value.

    Args:
        node: node of the parameters; values from the command line and from files apply.
        changed: function that is called after each change.
    """

    def __init__(self, node: ManagedNode, changed: Callable[[], None]) -> None:
        self._node, self._changed = node, changed
        self._specs = {spec.name: spec for spec in PARAMETERS}
        self._values: dict[str, Any] = {}
        for spec in PARAMETERS:
            value = node.declare_parameter(spec.name, spec.default, _descriptor(spec)).value
            require_allowed(spec, value)
            self._values[spec.name] = self._cast(spec.name, value)
        self._warn_of_unknown()
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._keep)

    def __getitem__(self, name: str) -> Any:
        return self._values[name]  # read several times a step, hence kept instead of read through rclpy

    def entries(self, name: str) -> list[str]:
        """Return a parameter's list of strings without empty entries.

        A list with an empty entry stands for an empty list, which ROS cannot declare.
        """
        return [entry for entry in self[name] if entry.strip()]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def _warn_of_unknown(self) -> None:
        """Warn of unknown parameters that were given at start, e.g. those of other nodes in a file for ``/**``."""
        for name in sorted(self._node.list_unknown_parameters()):
            text = f"parameter {name!r} is unknown and does nothing; {did_you_mean(name, self._specs)}"
            self._node.get_logger().warning(text.rstrip("; "))

    def _keep(self, changes: Iterable[Parameter]) -> None:
        self._values |= {each.name: self._cast(each.name, each.value) for each in changes if each.name in self._specs}
        self._changed()

    def _cast(self, name: str, value: Any) -> Any:
        """Return a value in the type of its declaration; a double may be given as an integer (rate:=100)."""
        return float(value) if isinstance(self._specs[name].default, float) else value

    def _check(self, changes: Iterable[Parameter]) -> SetParametersResult:
        state = self._node.lifecycle_state
        for change in changes:
            if change.name == "use_sim_time" and not change.value and (state, self["clock"]) == ("active", "external"):
                reason = "use_sim_time is needed by clock external and can be switched off while not active; "
                return SetParametersResult(successful=False, reason=f"{reason}the node is active")
            spec = self._specs.get(change.name)
            if spec is None:
                continue
            try:
                require_allowed(spec, change.value)
            except GdfeError as error:
                return SetParametersResult(successful=False, reason=str(error))
            closed = spec.change is not Changeable.ALWAYS and state not in _OPEN[spec.change]
            if closed and change.value != self[spec.name]:
                reason = f"{spec.name} can be changed {spec.change.value}; the node is {state}"
                return SetParametersResult(successful=False, reason=reason)
        return SetParametersResult(successful=True)


def require_allowed(spec: ParameterSpec, value: Any) -> None:
    """Check the value of a parameter, as far as rclpy does not: doubles, choices, and control characters in texts.

    A double may be given as an integer (rate:=100).

    Raises:
        GdfeError: the value is not allowed.
    """
    if isinstance(spec.default, float):
        number = is_number(value) and is_finite(value)
        allowed = number and spec.least <= value <= spec.most
    else:
        allowed = not spec.choices or value in spec.choices
        if isinstance(spec.default, str | list):
            require_plain(spec.name, value)
    if not allowed:
        unit = f" {spec.unit}" if spec.unit else ""
        raise GdfeError(f"parameter {spec.name} is {value!r}; allowed: {spec.allowed}{unit}")


def _descriptor(spec: ParameterSpec) -> ParameterDescriptor:
    unit = f" [{spec.unit}]" if spec.unit else ""
    descriptor = ParameterDescriptor(
        description=f"{spec.meaning}{unit}",
        additional_constraints="; ".join(filter(None, [spec.allowed, f"changed {spec.change.value}"])),
        read_only=spec.change is Changeable.START,
        dynamic_typing=isinstance(spec.default, float),
    )
    if spec.least is not None:
        if isinstance(spec.default, float):
            bounds = FloatingPointRange(from_value=float(spec.least), to_value=float(spec.most))
            descriptor.floating_point_range = [bounds]
        else:
            descriptor.integer_range = [IntegerRange(from_value=int(spec.least), to_value=int(spec.most))]
    return descriptor


class Moduli:
    """Declares Young's moduli of a scene as parameters while the scene is configured.

    Args:
        node: node of the parameters.
        scene: scene with the materials.
        locked: function that returns whether a bag is being written. A change of moduli is then refused, because a
            replay could not repeat the change.
        changed: function that is called after a change, with a dict from material name to new modulus [Pa].
    """

    def __init__(
        self,
        node: LifecycleNode,
        scene: Scene,
        *,
        locked: Callable[[], bool],
        changed: Callable[[Mapping[str, float]], None],
    ) -> None:
        self._node, self._locked, self._changed = node, locked, changed
        self._materials = _materials(scene)
        for parameter, name in self._materials.items():
            node.declare_parameter(parameter, scene.materials[name].young, _descriptor(MODULUS), ignore_override=True)
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._apply)

    def destroy(self) -> None:
        """Undeclare the parameters."""
        self._node.remove_on_set_parameters_callback(self._check)
        self._node.remove_post_set_parameters_callback(self._apply)
        for parameter in self._materials:
            self._node.undeclare_parameter(parameter)

    def _check(self, changes: Iterable[Parameter]) -> SetParametersResult:
        own = [change for change in changes if change.name in self._materials]
        text = "a bag is being written, and a replay could not follow; finish it first"
        reason = text if own and self._locked() else ""
        try:
            for change in own:
                _require_modulus(change.name, change.value)
        except GdfeError as error:
            reason = str(error)
        return SetParametersResult(successful=not reason, reason=reason)

    def _apply(self, changes: Iterable[Parameter]) -> None:
        own = [change for change in changes if change.name in self._materials]
        moduli = {self._materials[change.name]: float(change.value) for change in own}
        if moduli:
            self._changed(moduli)


def read_moduli(parameters: Mapping[str, object], scene: Scene) -> dict[str, float]:
    """Return the moduli [Pa] among the given parameters, by parameter name, as overrides of the scene.

    Raises:
        GdfeError: the value of a modulus is not allowed.
    """
    given = {name: parameters[name] for name in _materials(scene) if name in parameters}
    for name, value in given.items():
        _require_modulus(name, value)
    return {name: float(value) for name, value in given.items()}


def _materials(scene: Scene) -> dict[str, str]:
    """Return a dict from parameter name to material name, for the materials with a Young's modulus."""
    return {MODULUS.name.format(material=name): name for name in moduli_of(scene)}


def _require_modulus(name: str, value: object) -> None:
    require_allowed(replace(MODULUS, name=name), value)
