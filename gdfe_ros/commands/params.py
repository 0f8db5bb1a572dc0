# SPDX-License-Identifier: Apache-2.0
"""``gdfe params``: print the parameters of a node, or set one."""

from __future__ import annotations

import argparse
import sys
from typing import Any

from gdfe_ros.bounded_text import plain_lines
from gdfe_ros.errors import GdfeError
from gdfe_ros.node.message_text import parse
from gdfe_ros.node.peer import full_name, get_parameters, open_peer, set_parameter
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
        values = get_parameters(peer, node, names, patience=arguments.wait)
        if arguments.value is not None:
            value = parse(arguments.value)
            if isinstance(values[0], float) and type(value) is int:
                value = float(value)  # an integer is a number for a parameter that has a decimal point
            answer = set_parameter(peer, node, wanted, value, patience=arguments.wait)
            if not answer.successful:
                print(plain_lines(f"refused: {answer.reason}"), file=sys.stderr)
                return REFUSED
            values = [value]
    for name, value in zip(names, values, strict=True):
        print(plain_lines(f"{name}: {_text(value)}"))
    return 0


def _text(value: Any) -> str:
    return str(value if isinstance(value, (bool, int, float, str)) or value is None else list(value))
