# SPDX-License-Identifier: Apache-2.0
"""Memory that plain rclpy keeps after topics were opened and closed again and again, without a line of gdfe_ros.

``python -m benchmarks.node.endpoints`` prints, for each hundred openings, the memory in use (glibc's ``mallinfo2``).
"""

from __future__ import annotations

import argparse
import ctypes
import gc
import sys

import rclpy
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import JointState

PUBLISHERS, SUBSCRIPTIONS = 16, 12
"""Topics of a node with a small scene."""


_FIELDS = "arena", "ordblks", "smblks", "hblks", "hblkhd", "usmblks", "fsmblks", "uordblks", "fordblks", "keepcost"


class _Allocations(ctypes.Structure):
    """The structure ``mallinfo2`` of glibc."""

    _fields_ = tuple((name, ctypes.c_size_t) for name in _FIELDS)


def main() -> int:
    """Open and close topics, and print a table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.node.endpoints", description=__doc__)
    parser.add_argument("--openings", type=int, default=1000, help="how often the topics are opened")
    count = parser.parse_args().openings
    rclpy.init()
    node, executor = rclpy.create_node("opener"), SingleThreadedExecutor()
    executor.add_node(node)
    for number in range(count + 1):
        open_and_close(node, executor)
        if number % 100 == 0:
            print(f"{number} openings: {used() / 1e3:.0f} kB in use", flush=True)
    return 0


def open_and_close(node: Node, executor: SingleThreadedExecutor) -> None:
    """Open all topics without handlers of QoS events, and close them."""
    silent = (
        PublisherEventCallbacks(use_default_callbacks=False),
        SubscriptionEventCallbacks(use_default_callbacks=False),
    )
    publishers = [
        node.create_publisher(JointState, f"~/out_{k}", 10, event_callbacks=silent[0]) for k in range(PUBLISHERS)
    ]
    subscriptions = [
        node.create_subscription(JointState, f"~/in_{k}", print, 10, event_callbacks=silent[1])
        for k in range(SUBSCRIPTIONS)
    ]
    executor.spin_once(timeout_sec=0.0)
    for each in publishers:
        node.destroy_publisher(each)
    for each in subscriptions:
        node.destroy_subscription(each)
    executor.spin_once(timeout_sec=0.0)
    del publishers, subscriptions
    entities = node.default_callback_group.entities  # rclpy keeps a weak reference to each destroyed entity
    entities.difference_update([each for each in list(entities) if each() is None])


def used() -> int:
    """Return the memory in use outside of Python's own pools [bytes]."""
    gc.collect()
    find = ctypes.CDLL(None).mallinfo2
    find.restype = _Allocations
    found = find()
    return found.uordblks + found.hblkhd


if __name__ == "__main__":
    sys.exit(main())
