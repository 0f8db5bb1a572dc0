# SPDX-License-Identifier: Apache-2.0
"""Offer of services of ``simulation_interfaces`` as far as the installed version has them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from gdfe_ros.node.managed import ManagedNode
from gdfe_ros.node.qos import available, interface_class
from gdfe_ros.node.specification import ServiceSpec
from gdfe_ros.node.standard_answers import Refused, failed


def offer(node: ManagedNode, offered: Mapping[ServiceSpec, Callable[[Any, Any], Any]]) -> None:
    """Offer the services whose types are installed; a `Refused` that an action raises becomes the answer."""
    for spec, action in offered.items():
        if available(spec.type):
            node.offer(interface_class(spec.type), spec.name, partial(_answer, action))


def _answer(action: Callable[[Any, Any], Any], request: Any, response: Any) -> Any:
    try:
        return action(request, response)
    except Refused as error:
        return failed(response, error.code, str(error))
