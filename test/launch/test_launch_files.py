# SPDX-License-Identifier: Apache-2.0
"""Launch files use the package's executables, parameters and files.

ROS's launch packages are not available as wheels. Where they are not installed, stand-ins with the same names take
their place: the files run, and their description is checked. Only a machine with ROS tests them with launch itself.
"""

from __future__ import annotations

import ast
import importlib.util
import sys
from collections.abc import Iterable
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest
import yaml

from gdfe_ros.examples.carrying_arm import CarryingArm
from gdfe_ros.examples.tip_tracking import TipTracking
from gdfe_ros.node.interface import NODE_NAME, PARAMETERS
from gdfe_ros.node.run import leaders_of
from gdfe_ros.scene.loader import load_scene

ROOT = Path(__file__).parents[2]
FILES = sorted((ROOT / "launch").glob("*.launch.py"))
OTHERS = ("controller_manager", "robot_state_publisher")
INSTALLED = find_spec("launch_ros") is not None


def _record(kind: str) -> type:
    """Return a class whose instances keep their constructor arguments."""

    def make(self: Any, *given: Any, **named: Any) -> None:
        self.given, self.named = given, named

    return type(kind, (), {"__init__": make, "perform": lambda self, context: context[self.given[0]]})


@pytest.fixture
def stand_ins(monkeypatch: pytest.MonkeyPatch) -> None:
    """Install stand-ins for the launch packages where these are missing."""
    if not INSTALLED:
        names = {
            "launch": ("LaunchDescription", "LaunchContext"),
            "launch.actions": ("DeclareLaunchArgument", "OpaqueFunction"),
            "launch.conditions": ("IfCondition",),
            "launch.substitutions": ("LaunchConfiguration", "PathJoinSubstitution"),
            "launch_ros": (),
            "launch_ros.actions": ("Node",),
            "launch_ros.parameter_descriptions": ("ParameterValue",),
        }
        for name, kinds in names.items():
            module = ModuleType(name)
            for kind in kinds:
                setattr(module, kind, _record(kind))
            monkeypatch.setitem(sys.modules, name, module)
        index = SimpleNamespace(get_package_share_directory=lambda name: str(ROOT))
        monkeypatch.setitem(sys.modules, "ament_index_python", ModuleType("ament_index_python"))
        monkeypatch.setitem(sys.modules, "ament_index_python.packages", index)


def _module(path: Path) -> Any:
    spec = importlib.util.spec_from_file_location(path.name.replace(".", "_"), path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def _entry_points() -> dict[str, str]:
    """Return the console scripts in setup.py."""
    tree = ast.parse((ROOT / "setup.py").read_text(encoding="utf-8"))
    strings = [node.value for node in ast.walk(tree) if isinstance(node, ast.Constant) and isinstance(node.value, str)]
    return dict(text.split(" = ") for text in strings if text.count(" = ") == 1 and ":" in text)


def test_there_are_launch_files() -> None:
    """The package has launch files."""
    names = ["control_loop", "gripper_on_arm", "robots", "ros2_control", "sim"]
    assert [path.name for path in FILES] == [f"{name}.launch.py" for name in names]


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_a_launch_file_names_what_there_is(path: Path, stand_ins: None) -> None:
    """Each launch file has executables of this package with known parameters, and a description of every argument."""
    description = _module(path).generate_launch_description()
    if INSTALLED:
        assert description.entities
        return
    (entities,) = description.given
    declared = _of_kind(entities, "DeclareLaunchArgument")
    assert all(entity.named["description"] for entity in declared)
    arguments = {entity.given[0]: entity.named["default_value"] for entity in declared}
    nodes = _of_kind(entities, "Node")
    for entity in _of_kind(entities, "OpaqueFunction"):
        nodes += entity.named["function"](arguments)
    assert nodes
    for node in nodes:
        _check_node(node, arguments)


def _nodes(module: Any, **given: str) -> list[Any]:
    """Return the nodes that sim.launch.py describes for the given arguments."""
    (entities,) = module.generate_launch_description().given
    declared = _of_kind(entities, "DeclareLaunchArgument")
    return module.make_nodes({e.given[0]: e.named["default_value"] for e in declared} | given)


@pytest.fixture
def sim(stand_ins: None) -> Any:
    """Return the module sim.launch.py, loaded with stand-ins."""
    if INSTALLED:
        pytest.skip("launch is installed: it reads the file itself")
    return _module(ROOT / "launch" / "sim.launch.py")


def test_only_what_is_given_is_put_over_the_parameter_file(sim: Any, tmp_path: Path) -> None:
    """Without arguments the parameter file alone decides; given arguments override only their own parameters."""
    (node,) = _nodes(sim)
    assert node.named["parameters"] == [str(ROOT / "config" / "sim.yaml")]
    own = tmp_path / "own.yaml"
    own.write_text("/**: {ros__parameters: {rate: 20.0, clock: fast}}")
    (node,) = _nodes(sim, params_file=str(own))
    assert node.named["parameters"] == [str(own)]
    (node,) = _nodes(sim, params_file=str(own), rate="50", use_sim_time="true", namespace="/left", log_level="debug")
    path, given = node.named["parameters"]
    kinds = {name: value.named["value_type"] for name, value in given.items()}
    assert (path, kinds) == (str(own), {"rate": float, "use_sim_time": bool})
    assert node.named["ros_arguments"] == ["--log-level", "left.gdfe_sim:=debug"]


def test_rviz_is_given_the_topics_of_the_node(sim: Any) -> None:
    """For a node in a namespace, RViz's displays get the node's topics, and RViz's fixed frame is the node's frame."""
    _, rviz = _nodes(sim, rviz="true", namespace="left", frame_id="left/base")
    assert (rviz.named["package"], rviz.named["executable"]) == ("rviz2", "rviz2")
    assert ("/gdfe_sim/mesh", "/left/gdfe_sim/mesh") in rviz.named["remappings"]
    assert rviz.named["arguments"][2:] == ["-f", "left/base"]
    assert Path(rviz.named["arguments"][1]).is_file()


@pytest.mark.parametrize(
    ("text", "full", "fits"),
    [
        ("/**: {ros__parameters: {}}", "/left/arm", True),
        ("gdfe_sim: {ros__parameters: {}}", "/gdfe_sim", True),
        ("gdfe_sim: {ros__parameters: {}}", "/left/gdfe_sim", False),
        ("/left/gdfe_sim: {ros__parameters: {}}", "/left/gdfe_sim", True),
        ("left: {gdfe_sim: {ros__parameters: {}}}", "/left/gdfe_sim", True),
        ("/*/gdfe_sim: {ros__parameters: {}}", "/left/gdfe_sim", True),
        ("/*: {ros__parameters: {}}", "/left/gdfe_sim", False),
        ("/**/gdfe_sim: {ros__parameters: {}}", "/a/b/gdfe_sim", True),
        ("[1, 2", "/gdfe_sim", False),
        ("", "/gdfe_sim", False),
    ],
)
def test_a_parameter_file_for_other_nodes_is_refused(
    sim: Any, tmp_path: Path, text: str, full: str, fits: bool
) -> None:
    """A parameter file without an entry for this node is refused with its names and a remedy."""
    path = tmp_path / "own.yaml"
    path.write_text(text)
    if fits:
        sim.require_match(str(path), full)
    else:
        with pytest.raises(RuntimeError, match=r"own.yaml (is for .*write /\*\*:|cannot be read)"):
            sim.require_match(str(path), full)


def _of_kind(entities: Iterable[Any], kind: str) -> list[Any]:
    return [entity for entity in entities if type(entity).__name__ == kind]


def _check_node(node: Any, arguments: dict[str, str]) -> None:
    executable = node.named["executable"]
    if node.named["package"] in OTHERS:
        return
    assert node.named["package"] == "gdfe_ros"
    assert executable in _entry_points()
    if executable == "sim_node":
        assert node.named["name"] == NODE_NAME
    for source in node.named["parameters"]:
        if isinstance(source, dict):
            assert set(source) <= _parameters(executable), set(source) - _parameters(executable)
        else:
            assert Path(source).is_file()


def _parameters(executable: str) -> set[str]:
    if executable == "sim_node":
        return {spec.name for spec in PARAMETERS} | {"use_sim_time"}
    module = {"tip_tracking": TipTracking, "carrying_arm": CarryingArm}[executable].__module__
    source = ast.parse(Path(sys.modules[module].__file__).read_text(encoding="utf-8"))
    calls = [node for node in ast.walk(source) if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)]
    return {call.args[0].value for call in calls if call.func.attr == "declare_parameter"}


def test_the_parameter_file_names_parameters_of_the_node() -> None:
    """Every entry of config/sim.yaml is a parameter of the node, with its default."""
    entries = yaml.safe_load((ROOT / "config" / "sim.yaml").read_text(encoding="utf-8"))["/**"]["ros__parameters"]
    defaults = {spec.name: spec.default for spec in PARAMETERS}
    assert entries == {name: defaults[name] for name in entries}
    assert [type(value) for value in entries.values()] == [type(defaults[name]) for name in entries]


def test_the_gripper_follows_the_arm_that_is_started_beside_it(stand_ins: None) -> None:
    """gripper_on_arm.launch.py lets a handle of the scene follow a topic of the arm's node."""
    module = _module(ROOT / "launch" / "gripper_on_arm.launch.py")
    name = module.FOLLOW.partition("=")[0]
    scene = load_scene("gripper", overrides=dict([module.WEIGHT.split("=", 1)]))
    assert leaders_of([module.FOLLOW], scene, listening=False)[name].topic == "/carrying_arm/tool_pose"
    assert [load.name for load in scene.loads] == ["weight"]


def test_the_controllers_that_are_spawned_have_parameters(stand_ins: None) -> None:
    """The files of ros2_control.launch.py exist, and every spawned controller has a type."""
    module = _module(ROOT / "launch" / "ros2_control.launch.py")
    default = {name: value for name, (value, _) in module.ARGUMENTS.items()}
    manager = yaml.safe_load(Path(default["controllers"]).read_text())["controller_manager"]["ros__parameters"]
    assert all("type" in manager[name] for name in default["spawn"].split())
    if not INSTALLED:
        nodes = {node.named["executable"]: node for node in module.make_nodes(default)}
        assert list(nodes) == ["sim_node", "robot_state_publisher", "ros2_control_node", "spawner"]
        assert nodes["spawner"].named["arguments"] == default["spawn"].split()
