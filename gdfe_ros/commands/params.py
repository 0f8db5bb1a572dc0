# SPDX-License-Identifier: Apache-2.0
"""``gdfe params``: print the parameters of a node, or set one."""

from __future__ import annotations

import argparse
import sys
from typing import Any

from rclpy.parameter import Parameter, parameter_value_to_python

from gdfe_ros.errors import GdfeError
from gdfe_ros.node.message_text import parse
from gdfe_ros.node.peer import Peer, full_name, open_peer
from gdfe_ros.spelling import did_you_mean

REFUSED = 1


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("node", help="name of the node, e.g. /gdfe_sim")
    parser.add_argument("name", nargs="?", help="name of one parameter (default: all are printed)")
    parser.add_argument("value", nargs="?", help="new value in YAML, e.g. 0.02")
    parser.add_argument(
        "--wait", type=float, default=60.0, metavar="S", help="longest wait for the answer (default: 60 s)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Print parameters as YAML after a requested change; return 0, or 1 if the node refused the change."""
    node, wanted = full_name(arguments.node), arguments.name
    with open_peer() as peer:
        names = peer.call(f"{node}/list_parameters", {}, patience=arguments.wait).result.names
        if wanted is not None and wanted not in names:
            raise GdfeError(
                f"{node} has no parameter {wanted!r}; {did_you_mean(wanted, names)}names: {', '.join(names)}"
            )
        names = sorted(names) if wanted is None else [wanted]
        values = _values(peer, node, names, arguments.wait)
        if arguments.value is not None:
            return _set(peer, node, wanted, parse(arguments.value), old=values[0], patience=arguments.wait)
    for name, value in zip(names, values, strict=True):
        print(f"{name}: {_text(value)}")
    return 0


def _values(peer: Peer, node: str, names: list[str], patience: float) -> list[Any]:
    found = peer.call(f"{node}/get_parameters", {"names": names}, patience=patience).values
    return [parameter_value_to_python(value) for value in found]


def _text(value: Any) -> str:
    return str(value if isinstance(value, (bool, int, float, str)) or value is None else list(value))


def _set(peer: Peer, node: str, name: str, value: Any, *, old: Any, patience: float) -> int:
    """Set a parameter; an integer is a number for a parameter that has a decimal point."""
    if isinstance(old, float) and type(value) is int:
        value = float(value)
    message = Parameter(name, value=value).to_parameter_msg()
    fields = message.value.get_fields_and_field_types()
    request = {"name": name, "value": {field: _plain(getattr(message.value, field)) for field in fields}}
    answer = peer.call(f"{node}/set_parameters", {"parameters": [request]}, patience=patience)
    (result,) = answer.results
    if not result.successful:
        print(f"refused: {result.reason}", file=sys.stderr)
        return REFUSED
    print(f"{name}: {_text(value)}")
    return 0


def _plain(value: Any) -> Any:
    return value if isinstance(value, (bool, int, float, str)) else list(value)
