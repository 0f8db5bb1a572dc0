# SPDX-License-Identifier: Apache-2.0
"""``gdfe call``: call a service and print its response as YAML."""

from __future__ import annotations

import argparse

from gdfe_ros.commands.message_text import fill, parse, show
from gdfe_ros.commands.peer import PATIENCE, full_name, open_peer
from gdfe_ros.errors import GdfeError

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
    service = full_name(arguments.service)
    with open_peer() as peer:
        kind = peer.service_class(service)
        request = fill(kind.Request(), values)
        client = peer.node.create_client(kind, service)
        if not peer.wait(client.service_is_ready):
            raise GdfeError(f"service {service} was not ready within {PATIENCE:g} s")
        future = client.call_async(request)
        if not peer.wait(future.done, arguments.wait):
            raise GdfeError(f"no answer from {service} within {arguments.wait:g} s; remedy: a longer --wait")
        print(show(future.result()))
        return 0 if getattr(future.result(), "success", True) else REFUSED
