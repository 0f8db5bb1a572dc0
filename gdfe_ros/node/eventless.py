# SPDX-License-Identifier: Apache-2.0
"""Publishers and subscriptions without QoS events, which are safe to destroy while an executor spins.

rclpy gives each publisher and each subscription handlers of QoS events, at least those of incompatible QoS. Their
removal can crash the process by SIGSEGV, for two reasons (rclpy #1644):

- The publisher is finalised at once, but its handlers only when the executor next collects its entities. In between, a
  handler refers to freed memory.
- If an event of a removed handler is still in the queue of an ``EventsExecutor``, the executor frees the handler's wait
  set without holding Python's lock. Any subscriber that appears or goes while topics are opened anew is such an event.

Without handlers, neither can happen. What the events would report is read from the ROS graph instead.
"""

from __future__ import annotations

from typing import Any

from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.node import Node

NO_PUBLISHER_EVENTS = PublisherEventCallbacks(use_default_callbacks=False)
NO_SUBSCRIPTION_EVENTS = SubscriptionEventCallbacks(use_default_callbacks=False)


class EventlessNode(Node):
    """A node whose publishers and subscriptions have no handlers of QoS events."""

    def create_publisher(self, *arguments: Any, **options: Any) -> Any:
        """Create a publisher, as rclpy does, without handlers of QoS events."""
        return super().create_publisher(*arguments, event_callbacks=NO_PUBLISHER_EVENTS, **options)

    def create_subscription(self, *arguments: Any, **options: Any) -> Any:
        """Create a subscription, as rclpy does, without handlers of QoS events."""
        return super().create_subscription(*arguments, event_callbacks=NO_SUBSCRIPTION_EVENTS, **options)
