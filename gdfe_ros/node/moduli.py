# SPDX-License-Identifier: Apache-2.0
"""Young's moduli as parameters: ``materials.<name>.young`` for every linear or neo-Hookean material."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace

from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor, SetParametersResult
from rclpy.lifecycle import LifecycleNode
from rclpy.parameter import Parameter

from gdfe_ros.errors import GdfeError
from gdfe_ros.node.bag import Bags
from gdfe_ros.node.interface.parameters import MODULUS
from gdfe_ros.node.parameters import require_allowed
from gdfe_ros.node.remodelling import moduli_of
from gdfe_ros.scene.scene import Scene


class Moduli:
    """Declares Young's moduli of a scene as parameters while the scene is configured.

    Args:
        node: node of the parameters.
        scene: scene with the materials.
        bags: recorder of the session. While it writes a bag, a change of moduli is refused, because a replay could not
            repeat the change.
        changed: function that is called after a change, with a dict from material name to new modulus [Pa].
    """

    def __init__(
        self,
        node: LifecycleNode,
        scene: Scene,
        bags: Bags,
        *,
        changed: Callable[[Mapping[str, float]], None],
    ) -> None:
        self._node, self._bags, self._changed = node, bags, changed
        self._materials = _materials(scene)
        for parameter, name in self._materials.items():
            node.declare_parameter(parameter, scene.materials[name].young, _descriptor(), ignore_override=True)
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
        locked = "a bag is being written, and a replay could not follow; finish it first"
        reason = locked if own and self._bags.active else ""
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


def given_moduli(parameters: Mapping[str, object], scene: Scene) -> dict[str, float]:
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


def _descriptor() -> ParameterDescriptor:
    bounds = FloatingPointRange(from_value=MODULUS.least, to_value=MODULUS.most)
    text = f"{MODULUS.meaning} [{MODULUS.unit}]"
    return ParameterDescriptor(description=text, floating_point_range=[bounds], dynamic_typing=True)
