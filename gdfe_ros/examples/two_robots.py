# SPDX-License-Identifier: Apache-2.0
"""Several robots in one process: a node for each in a namespace of its own, one executor for all.

``python -m gdfe_ros.examples.two_robots`` runs ``/left/gdfe_sim`` and ``/right/gdfe_sim``. Each steps in threads of its
own, so that they share the processor's cores; ``sim.launch.py`` with the argument ``namespace`` gives each a process.
"""

from __future__ import annotations

import threading

from rclpy.node import Node
from rclpy.parameter import Parameter

from gdfe_ros.node.process import answer_arguments, run_all
from gdfe_ros.node.sim_node import SimNode

ROBOTS = {"left": "tendon_finger", "right": "three_chamber_arm"}
"""Namespace -> scene."""


def make_nodes(interrupted: threading.Event) -> list[Node]:
    """Make a node for each robot."""
    return [
        SimNode(interrupted, namespace=name, parameter_overrides=[Parameter("scene", value=scene)])
        for name, scene in ROBOTS.items()
    ]


def main(args: list[str] | None = None) -> int:
    """Run both until SIGINT or SIGTERM."""
    answered = answer_arguments("two_robots", f"usage: two_robots [--help] [--ros-args ...]\n\n{__doc__}", args)
    return run_all(make_nodes, args) if answered is None else answered


if __name__ == "__main__":
    raise SystemExit(main())
