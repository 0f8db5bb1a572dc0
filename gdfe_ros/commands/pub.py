# SPDX-License-Identifier: Apache-2.0
"""``gdfe pub``: publish one message on a topic that has a subscriber, and print refusals."""

from __future__ import annotations

import argparse
import sys

from gdfe_ros.bounded_text import plain_lines
from gdfe_ros.node.message_text import parse
from gdfe_ros.node.peer import full_name, open_peer

REFUSED = 1


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("--once", action="store_true", help="publish one message, as always")
    parser.add_argument("topic", help="name of the topic, e.g. /gdfe_sim/actuation; its type comes from the subscriber")
    parser.add_argument(
        "message", nargs="?", default="{}", help='message in YAML, e.g. "{name: [flexor], effort: [4.0]}"'
    )


def run(arguments: argparse.Namespace) -> int:
    """Publish the message; return 0 once every subscriber has received it, or 1 if one of them refused it."""
    values = parse(arguments.message)
    with open_peer() as peer:
        count, refusals = peer.publish(arguments.topic, values)
    print(f"published on {full_name(arguments.topic)} to {count} listener{'s' if count > 1 else ''}")
    if ".nan" in arguments.message.lower():
        print("NaN means: no command; what is commanded there stays as it is")
    for refusal in refusals:
        print(plain_lines(f"refused: {refusal}"), file=sys.stderr)
    return REFUSED if refusals else 0
