# SPDX-License-Identifier: Apache-2.0
"""``gdfe echo``: print the latest message of a topic, and the following ones, as YAML."""

from __future__ import annotations

import argparse
from typing import Any

from gdfe_ros.commands.message_text import show
from gdfe_ros.commands.peer import full_name, matching_qos, open_peer
from gdfe_ros.errors import GdfeError

SETTLING = 0.2
"""Time [s] within which stored messages arrive after the first of them."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("topic", help="name of the topic, e.g. /gdfe_sim/probe/tip; its type comes from the publisher")
    parser.add_argument(
        "--count", type=int, default=1, help="number of messages: the latest one and the next ones (default: 1)"
    )
    parser.add_argument(
        "--wait", type=float, default=60.0, metavar="S", help="longest wait for each message (default: 60 s)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Print messages; return 0 after the requested number."""
    if arguments.count < 1:
        raise GdfeError(f"--count {arguments.count}; allowed: 1 or more")
    topic, received = full_name(arguments.topic), list[Any]()
    with open_peer() as peer:
        others, kind = peer.endpoints(topic, peer.node.get_publishers_info_by_topic, "publishes")
        peer.node.create_subscription(kind, topic, received.append, matching_qos(others, offered=False))
        for number in range(arguments.count):
            if not peer.wait(lambda: received, arguments.wait):
                raise GdfeError(f"no message on {topic} within {arguments.wait:g} s")
            if number == 0:  # a late subscriber receives the last ten; the latest one is requested
                peer.wait(lambda: False, SETTLING)
                del received[:-1]
            print(show(received.pop(0)), "---", sep="\n", flush=True)
    return 0
