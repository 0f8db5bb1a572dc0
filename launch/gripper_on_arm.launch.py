# SPDX-License-Identifier: Apache-2.0
"""Mount the soft gripper on a simulated arm: ros2 launch gdfe_ros gripper_on_arm.launch.py.

The gripper's wrist follows the pose of the arm's tool. ``~/handles/wrist/force_torque`` is the reading of a
force-torque sensor between the tool and the wrist. For an arm of your own, give ``arm:=false`` and ``follow``: a topic
(``wrist=topic:/arm/tool_pose``) or, if tf2_msgs is installed, a frame (``wrist=frame:tool0``).
"""

from __future__ import annotations

from typing import List  # noqa: UP035 -- launch compares with this one

from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from launch import LaunchDescription

FOLLOW = "wrist=topic:/carrying_arm/tool_pose"
WEIGHT = "loads.weight={gravity: [0, 0, -9.81]}"


def generate_launch_description() -> LaunchDescription:
    """Describe ``sim_node`` with the gripper, and the node ``carrying_arm``."""
    declared = [
        DeclareLaunchArgument(
            "follow", default_value=FOLLOW, description="what the wrist follows, as handle=kind:name"
        ),
        DeclareLaunchArgument("arm", default_value="true", description="start the example's arm, too"),
        DeclareLaunchArgument("rate", default_value="20.0", description="steps a second [Hz]"),
        DeclareLaunchArgument("record", default_value="false", description="write a bag"),
    ]
    gripper = Node(
        package="gdfe_ros",
        executable="sim_node",
        name="gdfe_sim",
        parameters=[
            {
                "scene": "gripper",
                "scene_overrides": ParameterValue(f"['{WEIGHT}']", value_type=List[str]),  # noqa: UP006
                "follow": ParameterValue(["['", LaunchConfiguration("follow"), "']"], value_type=List[str]),  # noqa: UP006
                "rate": ParameterValue(LaunchConfiguration("rate"), value_type=float),
                "record": ParameterValue(LaunchConfiguration("record"), value_type=bool),
            }
        ],
        output="screen",
    )
    arm = Node(
        package="gdfe_ros",
        executable="carrying_arm",
        name="carrying_arm",
        parameters=[{"frame_id": "base_link"}],
        condition=IfCondition(LaunchConfiguration("arm")),
        output="screen",
    )
    return LaunchDescription([*declared, gripper, arm])
