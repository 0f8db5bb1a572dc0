# SPDX-License-Identifier: Apache-2.0
"""``gdfe call``: call a service and print its response as YAML."""

from __future__ import annotations

import argparse

from gdfe_ros.node.message_text import parse, show
from gdfe_ros.node.peer import open_peer

REFUSED = 1


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("service", help="name of the service, e.g. /gdfe_sim/record")
    parser.add_argument("request", nargs="?", default="{}", help='request in YAML, e.g. "{data: true}"')
    parser.add_argument(
        "--wait", type=float, default=60.0, metavar="S", help="longest wait for the answer (default: 60 s)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Call the service; return 0, or 1 if the response reports a failure."""
    values = parse(arguments.request)
    with open_peer() as peer:
        response = peer.call(arguments.service, values, patience=arguments.wait)
    print(show(response))
    return 0 if getattr(response, "success", True) else REFUSED
