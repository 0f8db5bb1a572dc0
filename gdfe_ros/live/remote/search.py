# SPDX-License-Identifier: Apache-2.0
"""Names of nodes that simulate."""

from __future__ import annotations

import os

from rclpy.exceptions import InvalidTopicNameException
from rclpy.node import Node
from rclpy.validate_full_topic_name import validate_full_topic_name

from gdfe_ros.errors import GdfeError
from gdfe_ros.node.interface import topics


def full_name(name: str) -> str:
    """Return the full name of a node.

    Raises:
        GdfeError: it cannot be one.
    """
    full = f"/{name.strip('/')}"
    try:
        validate_full_topic_name(f"{full}/{topics.SCENE.key()}")
    except InvalidTopicNameException as error:
        allowed = "letters, digits and underscores, e.g. gdfe_sim, or left/gdfe_sim in a namespace"
        raise GdfeError(f"{name!r} is no name of a node; allowed: {allowed}") from error
    return full


def absence(node: Node, name: str, patience: float) -> str:
    """Say why a node has told of no scene, and which others there are.

    Args:
        node: that has listened.
        name: full name of the node that was looked for.
        patience: for how long [s].
    """
    space, _, own = name.rpartition("/")
    if (own, space or "/") in node.get_node_names_and_namespaces():
        remedy = f"ros2 lifecycle set {name} configure, then activate"
        return f"node {name} has told of no scene within {patience:g} s: it is not configured; remedy: {remedy}"
    end = f"/{topics.STEP_RECORD.key()}"
    found = [topic.removesuffix(end) for topic, _ in node.get_topic_names_and_types() if topic.endswith(end)]
    there = f"nodes that simulate: {', '.join(sorted(found))}" if found else "no node simulates here"
    domain = os.environ.get("ROS_DOMAIN_ID", "0")
    remedy = "start one: ros2 launch gdfe_ros sim.launch.py, or: sim_node"
    return f"no node {name} within {patience:g} s; {there} (ROS domain {domain}); {remedy}"
