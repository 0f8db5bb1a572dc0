# SPDX-License-Identifier: Apache-2.0
"""Start one simulation: ros2 launch gdfe_ros sim.launch.py scene:=twist90 record:=true rviz:=true."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml
from ament_index_python.packages import get_package_share_directory
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from launch import LaunchContext, LaunchDescription

SHARE = Path(get_package_share_directory("gdfe_ros"))
# Arguments that are parameters of the node: type, meaning. A given argument takes precedence over the parameter file.
# Without the argument, the value is that of the file or the node's default.
PARAMETERS = {
    "scene": (str, "name of a scene in config/scenes, or path of a scene file"),
    "clock": (str, "what makes a step begin: wall, fast, lockstep or external"),
    "rate": (float, "steps a second [Hz], clock wall"),
    "frame_id": (str, "frame of the rest shape, in the header of every output"),
    "use_sim_time": (bool, "take the time from /clock"),
    "publish_clock": (bool, "publish /clock; for one node of a system"),
    "autostart": (bool, "configure and activate at start"),
    "record": (bool, "write a bag"),
    "bag_path": (str, "directory of the bag; empty: runs/<scene>_<time>"),
}
# Arguments of the launch: default, meaning.
ARGUMENTS = {
    "name": ("gdfe_sim", "of the node"),
    "namespace": ("", "of the node"),
    "params_file": (str(SHARE / "config" / "sim.yaml"), "parameters of the node"),
    "log_level": ("info", "debug, info, warn, error or fatal"),
    "rviz": ("false", "open RViz with config/rviz/sim.rviz"),
}
SHOWN = ("markers", "mesh", "strain")
"""Topics that config/rviz/sim.rviz shows."""


def make_nodes(context: LaunchContext) -> list[Node]:
    """Describe ``sim_node`` and, if the argument ``rviz`` is true, RViz."""
    value = {name: LaunchConfiguration(name).perform(context) for name in (*ARGUMENTS, *PARAMETERS)}
    full = "/".join(["", *filter(None, value["namespace"].split("/")), value["name"]])
    require_match(value["params_file"], full)
    given = {
        name: ParameterValue(LaunchConfiguration(name), value_type=kind)
        for name, (kind, _) in PARAMETERS.items()
        if value[name]
    }
    simulation = Node(
        package="gdfe_ros",
        executable="sim_node",
        name=value["name"],
        namespace=value["namespace"],
        parameters=[value["params_file"], *([given] if given else [])],
        ros_arguments=["--log-level", f"{full.strip('/').replace('/', '.')}:={value['log_level']}"],
        output="screen",
    )
    if value["rviz"].lower() not in ("true", "1"):
        return [simulation]
    return [simulation, make_rviz(full, value["frame_id"])]


def make_rviz(full: str, frame_id: str) -> Node:
    """Describe RViz with the topics of a node; ``full`` is the node's full name."""
    return Node(
        package="rviz2",
        executable="rviz2",
        arguments=["-d", str(SHARE / "config" / "rviz" / "sim.rviz"), *(["-f", frame_id] if frame_id else [])],
        remappings=[(f"/gdfe_sim/{topic}", f"{full}/{topic}") for topic in SHOWN],
    )


def require_match(path: str, full: str) -> None:
    """Check that a parameter file has parameters for the node, because ROS would ignore another file without a warning.

    Raises:
        RuntimeError: the file cannot be read, or has parameters for other nodes only.
    """
    try:
        data = yaml.safe_load(Path(path).read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise RuntimeError(f"params_file {path} cannot be read: {error}") from error
    names = list(node_names(data))
    if not any(re.fullmatch(pattern(name), full) for name in names):
        found = ", ".join(names) or "no node"
        raise RuntimeError(f"params_file {path} is for {found}, the node is {full}; write /**: for a node of any name")


def node_names(data: Any, path: str = "") -> Iterator[str]:
    """Yield the full names of the nodes in a parameter file; a namespace may be a key of its own."""
    for key, value in data.items() if isinstance(data, dict) else ():
        if key == "ros__parameters":
            yield f"/{path.strip('/')}"
        else:
            yield from node_names(value, f"{path}/{str(key).strip('/')}")


def pattern(name: str) -> str:
    """Return the regular expression of a node's name in a parameter file: * is one token, ** any number of tokens."""
    tokens = {"**": r"(/[^/]+)*", "*": r"/[^/]+"}
    return "".join(tokens.get(part, f"/{re.escape(part)}") for part in name.strip("/").split("/"))


def generate_launch_description() -> LaunchDescription:
    """Describe one ``sim_node`` in a namespace, with parameters from a file and from arguments."""
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=default, description=meaning)
                for name, (default, meaning) in ARGUMENTS.items()
            ),
            *(
                DeclareLaunchArgument(name, default_value="", description=f"{meaning} (empty: as in params_file)")
                for name, (_, meaning) in PARAMETERS.items()
            ),
            OpaqueFunction(function=make_nodes),
        ]
    )
