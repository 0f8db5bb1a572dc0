# SPDX-License-Identifier: Apache-2.0
"""Start a simulation and a controller that moves its tip in a circle: ros2 launch gdfe_ros control_loop.launch.py."""

from __future__ import annotations

from typing import List  # noqa: UP035 -- launch compares with this one

from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from launch import LaunchDescription

# Arguments of the controller: default, type, meaning.
CONTROLLER = {
    "probe": ("tip", str, "name of the probe that is led"),
    "radius": ("0.005", float, "of the circle [m]"),
    "period": ("2.0", float, "of one round [s] of simulation time"),
    "gain": ("1.0", float, "share of the distance that one command makes up for"),
}


def generate_launch_description() -> LaunchDescription:
    """Describe the two nodes. By default they run in lockstep, so that every run gives the same results."""
    declared = [
        DeclareLaunchArgument("namespace", default_value="", description="namespace of both nodes"),
        DeclareLaunchArgument(
            "scene", default_value="three_chamber_arm", description="a scene with actuators and probes"
        ),
        DeclareLaunchArgument("clock", default_value="lockstep", description="lockstep, or wall for real time"),
        DeclareLaunchArgument(
            "publish_clock", default_value="true", description="publish /clock: the circle is timed by the simulation"
        ),
        DeclareLaunchArgument("tolerance", default_value="1.0e-4", description="of the solver; smaller is slower"),
        DeclareLaunchArgument("record", default_value="false", description="write a bag"),
        *(
            DeclareLaunchArgument(name, default_value=default, description=meaning)
            for name, (default, _, meaning) in CONTROLLER.items()
        ),
    ]
    namespace = LaunchConfiguration("namespace")
    simulation = Node(
        package="gdfe_ros",
        executable="sim_node",
        name="gdfe_sim",
        namespace=namespace,
        parameters=[
            {
                "scene": LaunchConfiguration("scene"),
                "clock": LaunchConfiguration("clock"),
                "record": ParameterValue(LaunchConfiguration("record"), value_type=bool),
                "publish_clock": ParameterValue(LaunchConfiguration("publish_clock"), value_type=bool),
                "scene_overrides": ParameterValue(
                    ["['solver.tolerance=", LaunchConfiguration("tolerance"), "']"],
                    value_type=List[str],  # noqa: UP006
                ),
            }
        ],
        output="screen",
    )
    controller = Node(
        package="gdfe_ros",
        executable="tip_tracking",
        name="tip_tracking",
        namespace=namespace,
        parameters=[
            {
                "simulation": PathJoinSubstitution(["/", namespace, "gdfe_sim"]),
                **{
                    name: ParameterValue(LaunchConfiguration(name), value_type=kind)
                    for name, (_, kind, _) in CONTROLLER.items()
                },
            }
        ],
        output="screen",
    )
    return LaunchDescription([*declared, simulation, controller])
