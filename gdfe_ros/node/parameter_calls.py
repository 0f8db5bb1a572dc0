# SPDX-License-Identifier: Apache-2.0
"""Read and set the parameters of another node."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.parameter import Parameter, parameter_value_to_python

from gdfe_ros.node.peer import Peer


def get_parameters(peer: Peer, node: str, names: Sequence[str], *, patience: float) -> list[Any]:
    """Return the values of a node's parameters; ``patience`` [s] is the longest wait."""
    found = peer.call(f"{node}/get_parameters", {"names": list(names)}, patience=patience).values
    return [parameter_value_to_python(value) for value in found]


def set_parameter(peer: Peer, node: str, name: str, value: Any, *, patience: float) -> SetParametersResult:
    """Set a parameter of a node to a value of its type, and return the node's answer."""
    message = Parameter(name, value=value).to_parameter_msg()
    fields = {field: _plain(getattr(message.value, field)) for field in message.value.get_fields_and_field_types()}
    request = {"parameters": [{"name": name, "value": fields}]}
    (result,) = peer.call(f"{node}/set_parameters", request, patience=patience).results
    return result


def _plain(value: Any) -> Any:
    return value if isinstance(value, (bool, int, float, str)) else list(value)
