# SPDX-License-Identifier: Apache-2.0
"""Start several simulations, each in its own namespace and process: ros2 launch gdfe_ros robots.launch.py.

The argument ``robots`` lists the simulations as ``namespace:scene``, separated by blanks. The simulation in the
namespace ``clock_of`` publishes /clock.
"""

from __future__ import annotations

from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from launch import LaunchContext, LaunchDescription


def make_nodes(context: LaunchContext) -> list[Node]:
    """Describe a ``sim_node`` for each entry of ``robots``."""
    robots = LaunchConfiguration("robots").perform(context).split()
    owner = LaunchConfiguration("clock_of").perform(context)
    nodes = []
    for robot in robots:
        namespace, _, scene = robot.partition(":")
        nodes.append(
            Node(
                package="gdfe_ros",
                executable="sim_node",
                name="gdfe_sim",
                namespace=namespace,
                parameters=[
                    {"scene": scene, "frame_id": f"{namespace}/base_link", "publish_clock": namespace == owner}
                ],
                output="screen",
            )
        )
    return nodes


def generate_launch_description() -> LaunchDescription:
    """Describe the arguments, and the nodes that `make_nodes` describes from them."""
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "robots", default_value="left:tendon_finger right:tendon_finger", description="namespace:scene ..."
            ),
            DeclareLaunchArgument("clock_of", default_value="", description="namespace of the one that gives /clock"),
            OpaqueFunction(function=make_nodes),
        ]
    )
