# SPDX-License-Identifier: Apache-2.0
"""rclpy's objects for the names in the interface: quality of service and message classes."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from typing import Any

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from gdfe_ros.node.specification import Delivery

_PROFILES = {
    # Transient local: who asks for it misses no step while discovery is under way; others notice nothing.
    Delivery.STATE: (ReliabilityPolicy.RELIABLE, DurabilityPolicy.TRANSIENT_LOCAL, 10),
    # Ten clouds of a large body would be much for who comes late, and wants the present one only.
    Delivery.CLOUD: (ReliabilityPolicy.RELIABLE, DurabilityPolicy.TRANSIENT_LOCAL, 1),
    Delivery.COMMAND: (ReliabilityPolicy.RELIABLE, DurabilityPolicy.VOLATILE, 1000),
    Delivery.LATCHED: (ReliabilityPolicy.RELIABLE, DurabilityPolicy.TRANSIENT_LOCAL, 1),
    Delivery.EVENT: (ReliabilityPolicy.RELIABLE, DurabilityPolicy.VOLATILE, 100),
    Delivery.CLOCK: (ReliabilityPolicy.BEST_EFFORT, DurabilityPolicy.VOLATILE, 1),
    # As tf2_ros has them.
    Delivery.TRANSFORMS: (ReliabilityPolicy.RELIABLE, DurabilityPolicy.VOLATILE, 100),
    # Whoever leads the way may be reliable or not.
    Delivery.FOLLOWED: (ReliabilityPolicy.BEST_EFFORT, DurabilityPolicy.VOLATILE, 10),
}


def qos_profile(delivery: Delivery) -> QoSProfile:
    """Give the profile that a purpose asks for."""
    reliability, durability, depth = _PROFILES[delivery]
    return QoSProfile(reliability=reliability, durability=durability, history=HistoryPolicy.KEEP_LAST, depth=depth)


def interface_class(type_name: str) -> type[Any]:
    """Import a message or service class by its ROS name, ``package/msg/Name``."""
    package, kind, name = type_name.split("/")
    return getattr(import_module(f"{package}.{kind}"), name)


def installed(type_name: str) -> bool:
    """Tell whether the package of a ROS type, ``package/msg/Name``, is installed.

    A folder of that name, e.g. the package's sources where the process was started, is none, though Python imports it.
    """
    package, kind, _ = type_name.split("/")
    try:
        spec = find_spec(f"{package}.{kind}")
    except ModuleNotFoundError:
        return False
    return spec is not None and spec.origin is not None
