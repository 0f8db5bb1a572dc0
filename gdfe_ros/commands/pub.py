# SPDX-License-Identifier: Apache-2.0
"""``gdfe pub``: publish one message on a topic that has a subscriber."""

from __future__ import annotations

import argparse

from rclpy.duration import Duration

from gdfe_ros.commands.message_text import fill, parse
from gdfe_ros.commands.peer import PATIENCE, full_name, matching_qos, open_peer
from gdfe_ros.errors import GdfeError


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("topic", help="name of the topic, e.g. /gdfe_sim/actuation; its type comes from the subscriber")
    parser.add_argument(
        "message", nargs="?", default="{}", help='message in YAML, e.g. "{name: [flexor], effort: [4.0]}"'
    )


def run(arguments: argparse.Namespace) -> int:
    """Publish the message, and return 0 once every subscriber has received it."""
    values = parse(arguments.message)
    topic = full_name(arguments.topic)
    with open_peer() as peer:
        others, kind = peer.endpoints(topic, peer.node.get_subscriptions_info_by_topic, "subscribes to")
        message = fill(kind(), values)
        publisher = peer.node.create_publisher(kind, topic, matching_qos(others, offered=True))
        if not peer.wait(lambda: publisher.get_subscription_count() >= len(others)):
            raise GdfeError(
                f"{topic}: only {publisher.get_subscription_count()} of {len(others)} subscribers were connected"
            )
        publisher.publish(message)
        if not publisher.wait_for_all_acked(Duration(seconds=PATIENCE)):
            raise GdfeError(f"{topic}: not every subscriber acknowledged the message within {PATIENCE:g} s")
    print(f"published on {topic} to {len(others)} listener{'s' if len(others) > 1 else ''}")
    return 0
