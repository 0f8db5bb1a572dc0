# SPDX-License-Identifier: Apache-2.0
"""Two robots in one process: a node for each robot, in its own namespace, and one executor for both nodes.

``python -m gdfe_ros.examples.two_robots`` runs ``/left/gdfe_sim`` and ``/right/gdfe_sim``. Each node steps in its own
threads, so that the nodes use several cores of the processor. To run each node in its own process, start
``sim.launch.py`` with the argument ``namespace``.
"""

from __future__ import annotations

import threading

from rclpy.node import Node
from rclpy.parameter import Parameter

from gdfe_ros.node.middleware.process import answer_arguments, run_all
from gdfe_ros.node.sim_node import SimNode

ROBOTS = {"left": "tendon_finger", "right": "three_chamber_arm"}
"""Dict from namespace to the scene of the robot."""


def make_nodes(interrupted: threading.Event) -> list[Node]:
    """Return a node for each robot."""
    return [
        SimNode(interrupted, namespace=name, parameter_overrides=[Parameter("scene", value=scene)])
        for name, scene in ROBOTS.items()
    ]


def main(args: list[str] | None = None) -> int:
    """Run both nodes until SIGINT or SIGTERM."""
    answered = answer_arguments("two_robots", f"usage: two_robots [--help] [--ros-args ...]\n\n{__doc__}", args)
    return run_all(make_nodes, args) if answered is None else answered


if __name__ == "__main__":
    raise SystemExit(main())
