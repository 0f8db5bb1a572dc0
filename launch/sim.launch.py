# SPDX-License-Identifier: Apache-2.0
"""Start one simulation: ros2 launch gdfe_ros sim.launch.py scene:=twist90 record:=true."""

from __future__ import annotations

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from launch import LaunchDescription

# Arguments that are parameters of the node, put over those of the file: default, type, meaning.
PARAMETERS = {
    "scene": ("bend5", str, "name of a scene in config/scenes, or path of a scene file"),
    "clock": ("wall", str, "what makes a step begin: wall, fast or lockstep"),
    "publish_clock": ("false", bool, "publish /clock; for one node of a system"),
    "record": ("false", bool, "write a bag"),
    "bag_path": ("", str, "directory of the bag; empty: runs/<scene>_<time>"),
}


def generate_launch_description() -> LaunchDescription:
    """Describe one ``sim_node`` in a namespace, with parameters from a file and from arguments."""
    defaults = Path(get_package_share_directory("gdfe_ros")) / "config" / "sim.yaml"
    declared = [
        DeclareLaunchArgument("namespace", default_value="", description="namespace of the node"),
        DeclareLaunchArgument("params_file", default_value=str(defaults), description="parameters of the node"),
        *(
            DeclareLaunchArgument(name, default_value=default, description=meaning)
            for name, (default, _, meaning) in PARAMETERS.items()
        ),
    ]
    chosen = {
        name: ParameterValue(LaunchConfiguration(name), value_type=kind) for name, (_, kind, _) in PARAMETERS.items()
    }
    node = Node(
        package="gdfe_ros",
        executable="sim_node",
        name="gdfe_sim",
        namespace=LaunchConfiguration("namespace"),
        parameters=[LaunchConfiguration("params_file"), chosen],
        output="screen",
    )
    return LaunchDescription([*declared, node])
