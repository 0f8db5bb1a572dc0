# SPDX-License-Identifier: Apache-2.0
"""rclpy's QoS profiles and message classes for the names in the interface."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from typing import Any

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from gdfe_ros.node.specification import Delivery

_PROFILES = {
    # Transient local: subscribers that request it miss no step during discovery; others are not affected.
    Delivery.STATE: (ReliabilityPolicy.RELIABLE, DurabilityPolicy.TRANSIENT_LOCAL, 10),
    # A late subscriber needs the present cloud only, and ten clouds of a large body are many bytes.
    Delivery.CLOUD: (ReliabilityPolicy.RELIABLE, DurabilityPolicy.TRANSIENT_LOCAL, 1),
    Delivery.COMMAND: (ReliabilityPolicy.RELIABLE, DurabilityPolicy.VOLATILE, 1000),
    Delivery.LATCHED: (ReliabilityPolicy.RELIABLE, DurabilityPolicy.TRANSIENT_LOCAL, 1),
    Delivery.EVENT: (ReliabilityPolicy.RELIABLE, DurabilityPolicy.VOLATILE, 100),
    Delivery.CLOCK: (ReliabilityPolicy.BEST_EFFORT, DurabilityPolicy.VOLATILE, 1),
    # The same as in tf2_ros.
    Delivery.TRANSFORMS: (ReliabilityPolicy.RELIABLE, DurabilityPolicy.VOLATILE, 100),
    # The leader's publisher may be reliable or not.
    Delivery.FOLLOWED: (ReliabilityPolicy.BEST_EFFORT, DurabilityPolicy.VOLATILE, 10),
}


def qos_profile(delivery: Delivery) -> QoSProfile:
    """Return rclpy's QoS profile for a kind of delivery."""
    reliability, durability, depth = _PROFILES[delivery]
    return QoSProfile(reliability=reliability, durability=durability, history=HistoryPolicy.KEEP_LAST, depth=depth)


def interface_class(type_name: str) -> type[Any]:
    """Import a message or service class by its ROS name, ``package/msg/Name``."""
    package, kind, name = type_name.split("/")
    return getattr(import_module(f"{package}.{kind}"), name)


def available(type_name: str) -> bool:
    """Return whether a ROS type, ``package/srv/Name``, is installed; a package's older versions may lack it."""
    package, kind, name = type_name.split("/")
    return installed(type_name) and hasattr(import_module(f"{package}.{kind}"), name)


def installed(type_name: str) -> bool:
    """Return whether the package of a ROS type, ``package/msg/Name``, is installed.

    A folder of that name, e.g. the package's sources in the working directory, does not count, although Python can
    import it.
    """
    package, kind, _ = type_name.split("/")
    try:
        spec = find_spec(f"{package}.{kind}")
    except ModuleNotFoundError:
        return False
    return spec is not None and spec.origin is not None
