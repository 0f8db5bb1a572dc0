# SPDX-License-Identifier: Apache-2.0
"""The commands that replace ``ros2``, with a real node, and messages as text."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Iterator

import pytest
import rclpy
import yaml
from geometry_msgs.msg import PoseStamped, WrenchStamped
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger

from gdfe_ros.cli import BAD_INPUT, main
from gdfe_ros.commands.remote.message_text import fill, parse, show
from gdfe_ros.errors import GdfeError
from gdfe_ros.node.interface.topics import TF
from gdfe_ros.node.middleware.ros_types import is_installed
from gdfe_ros.testing import NodeProcess


@pytest.fixture(scope="module")
def node() -> Iterator[NodeProcess]:
    """Give a node with a coarse bar that waits for commands."""
    with NodeProcess({"scene": "bend5", "scene_overrides": ["mesh.bar.cells=[20, 2, 2]"], "clock": "lockstep"}) as node:
        while "active, clock lockstep" not in node.log:
            time.sleep(0.1)
        yield node


@pytest.mark.usefixtures("node")
def test_a_tip_is_lifted_from_the_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    """README's commands publish a target, print the wrench and the pose, and call a service."""
    assert main(["echo", "gdfe_sim/step_record"]) == 0  # the node is there
    assert main(["pub", "/gdfe_sim/handles/tip/target", "{pose: {position: {z: 0.1}, orientation: {w: 1.0}}}"]) == 0
    deadline, height = time.monotonic() + 60.0, None
    while height != pytest.approx(0.1) and time.monotonic() < deadline:  # the step takes as long as the machine lets it
        capsys.readouterr()
        assert main(["echo", "/gdfe_sim/handles/tip/pose"]) == 0
        height = yaml.safe_load(capsys.readouterr().out.rstrip("-\n"))["pose"]["position"]["z"]
    assert height == pytest.approx(0.1)
    assert main(["echo", "/gdfe_sim/mesh", "--once"]) == 0
    assert "... 189 points" in capsys.readouterr().out
    assert main(["call", "/gdfe_sim/reset"]) == 0
    assert main(["call", "/gdfe_sim/pause", "{data: false}"]) in (0, 1)
    assert "success" in capsys.readouterr().out


@pytest.mark.usefixtures("node")
def test_what_is_not_there_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    """A misspelt topic, service or field is an error with the intended name and the existing ones."""
    assert main(["echo", "/gdfe_sim/step_record"]) == 0
    assert main(["pub", "/gdfe_sim/handles/tip/tarket", "{}"]) == BAD_INPUT
    assert "did you mean '/gdfe_sim/handles/tip/target'?" in capsys.readouterr().err
    assert main(["call", "/gdfe_sim/rest"]) == BAD_INPUT
    assert "did you mean '/gdfe_sim/reset'?" in capsys.readouterr().err
    assert main(["pub", "/gdfe_sim/handles/tip/target", "{pose: {positon: {z: 0.1}}}"]) == BAD_INPUT
    assert "no field 'pose.positon'; did you mean 'position'?" in capsys.readouterr().err


@pytest.mark.usefixtures("node")
def test_a_refused_command_ends_with_its_reason(capsys: pytest.CaptureFixture[str]) -> None:
    """A command that the node refuses ends with status 1 and the node's reason."""
    wrong = "{pose: {position: {z: .nan}, orientation: {w: 1.0}}}"
    assert main(["pub", "--once", "/gdfe_sim/handles/tip/target", wrong]) == 1
    assert "refused: position (0.0, 0.0, nan)" in capsys.readouterr().err


@pytest.mark.usefixtures("node")
def test_nodes_topics_and_rates_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    """Nodes, topics with types and endpoints, and the rate of a topic are printed."""
    assert main(["nodes"]) == 0
    assert "/gdfe_sim" in capsys.readouterr().out.split()
    assert main(["topics", "tip/"]) == 0
    rows = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert ["/gdfe_sim/handles/tip/target", "geometry_msgs/msg/PoseStamped", "0", "1"] in rows
    assert main(["topics", "no such topic"]) == 1
    capsys.readouterr()
    assert main(["hz", "/diagnostics", "--count", "3"]) == 0
    rate = float(capsys.readouterr().out.removeprefix("/diagnostics: ").partition(" Hz")[0])
    assert 0.1 < rate < 2.0  # once a second, on a machine that may be busy
    assert main(["hz", "/diagnostics", "--count", "1000", "--seconds", "0.1"]) == 0
    assert "intervals of 2 messages" in capsys.readouterr().out


@pytest.mark.usefixtures("node")
def test_parameters_are_printed_and_set(capsys: pytest.CaptureFixture[str]) -> None:
    """Parameters are printed and set; a wrong name or value is refused with a reason."""
    assert main(["params", "/gdfe_sim"]) == 0
    printed = yaml.safe_load(capsys.readouterr().out)
    assert (printed["scene"], printed["clock"], printed["follow"]) == ("bend5", "lockstep", [""])
    assert main(["params", "/gdfe_sim", "slew_time", "2"]) == 0
    assert main(["params", "/gdfe_sim", "slew_time"]) == 0
    assert yaml.safe_load(capsys.readouterr().out.splitlines()[-1]) == {"slew_time": 2.0}
    assert main(["params", "/gdfe_sim", "slew_time", "-1"]) == 1
    assert main(["params", "/gdfe_sim", "slew"]) == BAD_INPUT
    assert "did you mean 'slew_time'?" in capsys.readouterr().err
    assert main(["params", "/gdfe_sim", "slew_time", "0"]) == 0


@pytest.mark.usefixtures("node")
def test_a_transition_is_requested(capsys: pytest.CaptureFixture[str]) -> None:
    """The state and its transitions are printed, and a transition is carried out."""
    assert main(["lifecycle", "/gdfe_sim"]) == 0
    assert capsys.readouterr().out == "/gdfe_sim: active; transitions: deactivate, shutdown\n"
    assert main(["lifecycle", "/gdfe_sim", "activate"]) == BAD_INPUT
    assert "allowed: deactivate, shutdown" in capsys.readouterr().err
    assert main(["lifecycle", "/gdfe_sim", "deactivate"]) == 0
    assert capsys.readouterr().out.startswith("/gdfe_sim: inactive; transitions: cleanup, activate")
    assert main(["lifecycle", "/gdfe_sim", "activate"]) == 0


@pytest.mark.usefixtures("node")
def test_frames_that_wheels_cannot_publish_are_explained(capsys: pytest.CaptureFixture[str]) -> None:
    """Without tf2_msgs, echo of /tf says why no node publishes it; with them, it prints the frames."""
    status = main(["echo", "/tf_static"])
    seen = capsys.readouterr()
    if is_installed(TF.type):
        assert (status, seen.err) == (0, "")
    else:
        assert status == BAD_INPUT
        assert "only with tf2_msgs, which ROS from Python wheels lacks" in " ".join(seen.err.split())


def test_texts_of_a_stranger_cannot_command_the_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    """Control characters in a stranger's parameters, messages, answers and refusals are printed as escapes."""
    bad, shown = "red \x1b[31m\x07\u202e", r"red \x1b[31m\x07\u202e"
    context = rclpy.Context()
    rclpy.init(context=context)
    node, executor = rclpy.create_node("stranger", context=context), SingleThreadedExecutor(context=context)
    executor.add_node(node)
    node.declare_parameter(f"text {bad}", bad)
    state = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    node.create_publisher(String, "~/said", state).publish(String(data=bad))
    refused = node.create_publisher(String, "~/refused", 10)
    node.create_subscription(String, "~/heard", lambda _: refused.publish(String(data=json.dumps([bad]))), 10)
    node.create_service(Trigger, "~/asked", lambda _, response: Trigger.Response(success=False, message=bad))
    spinning = threading.Thread(target=executor.spin)
    spinning.start()
    try:
        for arguments in (
            ["params", "stranger"],
            ["params", "stranger", "txet"],
            ["echo", "stranger/said"],
            ["call", "stranger/asked"],
            ["pub", "stranger/heard", "{data: hello}"],
        ):
            main(arguments)
            printed = "".join(capsys.readouterr())
            assert printed.replace("\n", "").isprintable(), arguments
            assert shown in printed.replace(r"\e", r"\x1b").replace(r"\a", r"\x07") or "unknown" in printed, printed
    finally:
        executor.shutdown()
        node.destroy_node()
        rclpy.shutdown(context=context)
        spinning.join()


def test_messages_are_filled_and_shown() -> None:
    """Nested fields and lists are filled with numbers as YAML reads them, and printed again."""
    message = fill(JointState(), parse("{header: {frame_id: arm}, name: [a, b], effort: [1, 2e5]}"))
    assert (message.header.frame_id, message.name, list(message.effort)) == ("arm", ["a", "b"], [1.0, 2e5])
    assert yaml.safe_load(show(message))["effort"] == [1.0, 2e5]
    long = JointState(position=[0.5] * 100)
    assert yaml.safe_load(show(long))["position"][-1] == "... 100 values"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("{effort: 4.0}", r"effort takes a list of double, got 4\.0"),
        ("{effort: [true]}", r"effort\[0\] takes a double, got True"),
        ("{name: [3]}", r"name\[0\] takes a string, got 3"),
        ("{header: {stamp: {sec: 1.5}}}", r"header\.stamp\.sec takes a int32, got 1\.5"),
        ("{header: {stamp: {nanosec: -1}}}", r"nanosec takes a uint32, got -1"),
        ("[1, 2]", r"JointState needs a mapping of fields, e\.g\. \{header: \.\.\.\}; got \[1, 2\]"),
        ("{name: [", r"is no YAML"),
    ],
)
def test_a_value_of_another_type_is_refused(text: str, expected: str) -> None:
    """A value of the wrong type is refused with the field and its type."""
    with pytest.raises(GdfeError, match=expected):
        fill(JointState(), parse(text))


def test_nested_messages_keep_what_is_not_named() -> None:
    """Fields that are not named in a nested message keep the defaults of a new message."""
    assert fill(PoseStamped(), parse("{pose: {position: {z: 1}}}")).pose.orientation.w == 1.0
    assert fill(WrenchStamped(), parse("{wrench: {force: {x: 2}}}")).wrench.force.y == 0.0
