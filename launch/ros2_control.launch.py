# SPDX-License-Identifier: Apache-2.0
"""Start the scene tendon_finger with ros2_control: ros2 launch gdfe_ros ros2_control.launch.py.

This needs the packages controller_manager, forward_command_controller, joint_state_broadcaster, robot_state_publisher
and joint_state_topic_hardware_interface. For a robot of your own, give ``scene``, ``urdf``, ``controllers`` and
``spawn``.
"""

from __future__ import annotations

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from launch import LaunchContext, LaunchDescription

FOLDER = Path(get_package_share_directory("gdfe_ros")) / "config" / "ros2_control"
# Arguments: default, meaning.
ARGUMENTS = {
    "scene": ("tendon_finger", "a scene whose actuators are the joints of the URDF"),
    "clock": ("wall", "wall, or lockstep: each command of the controllers makes a step"),
    "urdf": (str(FOLDER / "tendon_finger.urdf"), "joints, limits and the hardware"),
    "controllers": (str(FOLDER / "controllers.yaml"), "parameters of the controller manager"),
    "spawn": ("joint_state_broadcaster tension_controller", "controllers to activate, separated by blanks"),
}


def make_nodes(context: LaunchContext) -> list[Node]:
    """Describe the simulation, the publisher of the URDF, the controller manager and the spawner of controllers."""
    value = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    description = Path(value["urdf"]).read_text(encoding="utf-8")
    return [
        Node(
            package="gdfe_ros",
            executable="sim_node",
            name="gdfe_sim",
            parameters=[{"scene": value["scene"], "clock": value["clock"]}],
            output="screen",
        ),
        Node(
            package="robot_state_publisher",
            executable="robot_state_publisher",
            # A text, because launch would otherwise parse the URDF as YAML.
            parameters=[{"robot_description": ParameterValue(description, value_type=str)}],
        ),
        Node(
            package="controller_manager",
            executable="ros2_control_node",
            parameters=[value["controllers"]],
            output="screen",
        ),
        Node(package="controller_manager", executable="spawner", arguments=value["spawn"].split(), output="screen"),
    ]


def generate_launch_description() -> LaunchDescription:
    """Describe the arguments, and the nodes that `make_nodes` describes from them."""
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=meaning)
        for name, (default, meaning) in ARGUMENTS.items()
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=make_nodes)])
