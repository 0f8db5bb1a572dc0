# SPDX-License-Identifier: Apache-2.0
"""Young's moduli as parameters: ``materials.<name>.young`` of every material whose law has one."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor, SetParametersResult
from rclpy.lifecycle import LifecycleNode
from rclpy.parameter import Parameter

from gdfe_ros.materials import Linear, NeoHookean
from gdfe_ros.node.interface import MODULUS
from gdfe_ros.scene.scene import Scene


class Moduli:
    """Declares the moduli of a scene as parameters while it is configured.

    Args:
        node: that declares them.
        scene: whose materials they are.
        locked: gives why a modulus cannot be changed now; empty: it can.
        changed: called with the new moduli [Pa] by material after a change.
    """

    def __init__(
        self,
        node: LifecycleNode,
        scene: Scene,
        *,
        locked: Callable[[], str],
        changed: Callable[[Mapping[str, float]], None],
    ) -> None:
        self._node, self._locked, self._changed = node, locked, changed
        self._materials = {
            MODULUS.name.format(material=name): name
            for name, material in scene.materials.items()
            if isinstance(material, (Linear, NeoHookean))
        }
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
        reason = self._locked() if any(change.name in self._materials for change in changes) else ""
        return SetParametersResult(successful=not reason, reason=reason)

    def _apply(self, changes: Iterable[Parameter]) -> None:
        moduli = {self._materials[change.name]: change.value for change in changes if change.name in self._materials}
        if moduli:
            self._changed(moduli)


def _descriptor() -> ParameterDescriptor:
    bounds = FloatingPointRange(from_value=MODULUS.least, to_value=MODULUS.most)
    return ParameterDescriptor(description=f"{MODULUS.meaning} [{MODULUS.unit}]", floating_point_range=[bounds])
