# SPDX-License-Identifier: Apache-2.0
"""``gdfe echo``: print the latest message of a topic, and the following ones, as YAML."""

from __future__ import annotations

import argparse
from itertools import islice

from gdfe_ros.errors import GdfeError
from gdfe_ros.node.message_text import show
from gdfe_ros.node.peer import open_peer


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("topic", help="name of the topic, e.g. /gdfe_sim/probe/tip; its type comes from the publisher")
    parser.add_argument(
        "--count", type=int, default=1, help="number of messages: the latest one and the next ones (default: 1)"
    )
    parser.add_argument("--once", action="store_const", const=1, dest="count", help="one message, the default")
    parser.add_argument(
        "--wait", type=float, default=60.0, metavar="S", help="longest wait for each message (default: 60 s)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Print messages; return 0 after the requested number of messages."""
    if arguments.count < 1:
        raise GdfeError(f"--count {arguments.count}; allowed: 1 or more")
    with open_peer() as peer:
        for message in islice(peer.listen(arguments.topic, patience=arguments.wait), arguments.count):
            print(show(message), "---", sep="\n", flush=True)
    return 0
