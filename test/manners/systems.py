# SPDX-License-Identifier: Apache-2.0
"""What is asked of a node among others: subscribers that die, full disks, parameter files, long work, second nodes."""

from __future__ import annotations

import json
import resource
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from geometry_msgs.msg import PoseStamped, TwistStamped
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.parameter import Parameter
from rosbags.highlevel import AnyReader
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState, PointCloud2
from stage import Stage
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import SetBool, Trigger
from trajectory_msgs.msg import JointTrajectory

Row = tuple[str, str, str]

_SUBSCRIBER = """
import rclpy
from sensor_msgs.msg import PointCloud2
rclpy.init()
node = rclpy.create_node("doomed")
node.create_subscription(PointCloud2, "/gdfe_sim/mesh", lambda message: None, 1)
rclpy.spin(node)
"""
_FINGER = ("-p", "scene:=tendon_finger", "-p", "scene_overrides:=['']")


def subscribers() -> Iterator[Row]:
    """Have subscribers die, stand still and go; the node makes its steps, and others get them."""
    with Stage(["-p", "clock:=lockstep"]) as stage:
        mesh = stage.listen("/gdfe_sim/mesh", PointCloud2)
        stage.wait(lambda: mesh)
        for name, number in (("killed", signal.SIGKILL), ("stopped by SIGSTOP", signal.SIGSTOP)):
            with subprocess.Popen([sys.executable, "-c", _SUBSCRIBER], stderr=subprocess.DEVNULL) as other:
                stage.publish("handles/tip/target", PoseStamped())
                heard = stage.wait(lambda: stage.node.count_subscribers("/gdfe_sim/mesh") > 1)
                other.send_signal(number)
                count = int(stage.await_report()["steps"])
                for _ in range(20):
                    stage.publish("handles/tip/target", PoseStamped())
                going = stage.wait(lambda count=count: int(stage.values["steps"]) >= count + 20)
                found = _told(heard and going, "20 steps", "stuck")
                yield f"20 commands after a subscriber was {name}", "20 steps", found
                other.kill()
        count = len(mesh)
        late = stage.listen("/gdfe_sim/mesh", PointCloud2)
        found = _told(stage.wait(lambda: late), "the present state")
        yield "a subscriber that comes after that", "the present state", found
        stage.publish("handles/tip/target", PoseStamped())
        yield "and the next step", "to both", _told(stage.wait(lambda: len(mesh) > count and len(late) > 1), "to both")


def types() -> Iterator[Row]:
    """Publish the wrong type on every command topic: nothing is taken, nothing ends, a right one still is."""
    kinds: dict[str, type] = {
        "handles/tip/target": PoseStamped,
        "handles/tip/velocity": TwistStamped,
        "actuation": JointState,
        "commands": Float64MultiArray,
        "trajectory": JointTrajectory,
    }
    for scene, topics in (((), list(kinds)[:2]), (_FINGER, list(kinds)[2:])):
        with Stage(scene) as stage:
            stage.wait(lambda stage=stage: stage.values.get("state") == "active")
            for topic in topics:
                stage.intrude(f"/gdfe_sim/{topic}", String(data="x"))
                before = int(stage.await_report()["commands taken"]) + int(stage.values["commands refused"])
                stage.publish(topic, kinds[topic]())
                counted = stage.wait(
                    lambda stage=stage, before=before: (
                        int(stage.values["commands taken"]) + int(stage.values["commands refused"]) == before + 1
                    )
                )
                found = _told(counted and stage.alive, "read, the node active", "lost")
                yield f"a message on ~/{topic}, beside a publisher of another type", "read, the node active", found


def disks() -> Iterator[Row]:
    """Fill the disk while a bag is written: said, counted alike, answered with false, and the simulation goes on."""
    for way in ("~/record false", "SIGINT"):
        with tempfile.TemporaryDirectory() as folder:
            bag = Path(folder) / "bag"
            with Stage(["-p", "publish_clock:=true", "-p", "record:=true", "-p", f"bag_path:={bag}"]) as stage:
                yield from _fill(stage, way)
                written = int(stage.values["messages written"])
            found = f"{'all' if _messages(bag) == written else f'{_messages(bag)} of {written}'} that were counted"
            yield f"messages in that bag, after {way}", "all that were counted", found


def _fill(stage: Stage, way: str) -> Iterator[Row]:
    """Have a bag fill its disk, then end the recording one way or the other."""
    steps = stage.listen("/gdfe_sim/step_record", String)
    stage.wait(lambda: steps)
    resource.prlimit(stage.pid, resource.RLIMIT_FSIZE, (5 << 20, resource.RLIM_INFINITY))
    said = stage.wait(lambda: "recording ended, the simulation goes on" in stage.log)
    yield "a full disk, in the log", "said", _told(said, "said", "no word")
    told = stage.wait(lambda: stage.values.get("bag error", "none") != "none")
    yield "on /diagnostics", "said", _told(told, "said", "no word")
    if way == "SIGINT":
        yield "SIGINT after that: status, tracebacks", "0, 0", f"{stage.end()}, {stage.log.count('Traceback')}"
        return
    answer = stage.call(SetBool, "record", SetBool.Request(data=False))
    agreed = f"{stage.values['messages written']} messages, {stage.values['messages dropped']} dropped"
    found = "no answer" if answer is None else f"{str(answer.success).lower()}, {agreed in answer.message}"
    yield "~/record false after that: success, the same counts", "false, True", found
    count = len(steps)
    going = stage.wait(lambda: len(steps) > count)
    yield "the steps after that", "go on", _told(going, "go on", "stand still")
    yield "SIGINT after that: status, tracebacks", "0, 0", f"{stage.end()}, {stage.log.count('Traceback')}"


def parameters() -> Iterator[Row]:
    """Start from files of parameters; set good and bad values while active."""
    with tempfile.TemporaryDirectory() as folder:
        for name, owner, arguments, expected in (
            ("for nodes of any name, node renamed, in a namespace", "/**", ("-r", "__node:=a", "-r", "__ns:=/b"), "50"),
            ("for this node", "/gdfe_sim", (), "50"),
            ("for another node", "/other", (), "100"),
        ):
            path = Path(folder) / "given.yaml"
            values = {"rate": 50, "materials.e100.young": 2000000}  # integers for doubles
            path.write_text(json.dumps({owner: {"ros__parameters": values}}), encoding="utf-8")
            full = "/b/a" if arguments else "/gdfe_sim"
            with Stage([*arguments, "--params-file", str(path)], name=full) as stage:
                stage.wait(lambda stage=stage: stage.values.get("state") == "active")
                found = _values(stage, "rate", "materials.e100.young")
                young = "2e+06" if expected == "50" else "100000"
                yield f"a file {name}: rate, modulus", f"{expected}, {young}", found
    with Stage() as stage:
        stage.wait(lambda: stage.values.get("state") == "active")
        for name, value, expected in (
            ("rate", 50, "taken"), ("rate", 0.0, "refused"), ("rate", "fast", "refused"),
            ("clock", "lockstep", "refused, while not active"), ("scene", "twist90", "refused, while unconfigured"),
            ("marker_field", "colour", "refused, allowed: eps_eq"), ("step_count", 0, "refused"),
        ):  # fmt: skip
            message = Parameter(name, value=value).to_parameter_msg()
            answer = stage.call(SetParameters, "set_parameters", SetParameters.Request(parameters=[message]))
            result = answer.results[0] if answer else None
            word = "no answer" if result is None else "taken" if result.successful else "refused"
            _, _, reason = expected.partition(", ")
            found = f"{word}, {reason}" if reason and result and reason in result.reason else word
            yield f"set {name} to {value!r} while active", expected, found


def work() -> Iterator[Row]:
    """Ask for what takes long: other requests are answered meanwhile, it tells its progress, and it can be ended."""
    with Stage(["-p", "clock:=lockstep", "-p", "step_count:=1000000"]) as stage:
        records = stage.listen("/gdfe_sim/step_record", String)
        stage.wait(lambda: records)
        begun = stage.begin(Trigger, "step")
        stage.wait(lambda: len(records) > 3)
        yield "~/get_state during a million steps", "active, before they are done", _during(begun, stage.state())
        second = stage.call(Trigger, "step")
        yield "~/step during that", "false", str(second.success).lower()
        stage.await_report()
        told = " of 1000000 steps" in stage.values.get("working on", "")
        yield "/diagnostics during that", "tells how many", _told(told, "tells how many", "no word")
        stage.call(SetBool, "pause", SetBool.Request(data=True))
        ended = stage.wait(begun.done) and not begun.result().success
        yield "~/pause during that", "ends it, false", _told(ended, "ends it, false", "nothing")
        begun = stage.begin(Trigger, "step")
        stage.await_report()
        yield "SIGINT during another million", "0", stage.end()
    with Stage() as stage:
        for service, request, expected in (
            ("step", Trigger.Request(), "false, clock wall is running"),
            ("record", SetBool.Request(data=False), "false, not recording already"),
            ("save_state", Trigger.Request(), "false, state_path is empty"),
            ("compute_jacobian", Trigger.Request(), "false, has no actuators"),
            ("reset", Trigger.Request(), "true, at rest, time 0"),
        ):
            stage.wait(lambda: stage.values.get("state") == "active")
            answer = stage.call(_service(request), service, request)
            reason = expected.partition(", ")[2]
            found = "no answer" if answer is None else str(answer.success).lower()
            found = f"{found}, {reason}" if answer is not None and reason in answer.message else found
            yield f"~/{service} of an active node, clock wall", expected, found


def doubles() -> Iterator[Row]:
    """Publish /clock beside a node that does; start two nodes apart."""
    with Stage(["-p", "publish_clock:=true"]) as stage:
        stage.node.create_publisher(Clock, "/clock", 10)
        told = stage.wait(lambda: "2 publishers of /clock" in stage.log)
        yield "a second publisher of /clock", "said", _told(told, "said", "no word")
    left, right = ["-r", "__ns:=/left"], ["-r", "__ns:=/right"]
    with Stage(left, right, name="/left/gdfe_sim") as stage:
        meshes = [stage.listen(f"/{side}/gdfe_sim/mesh", PointCloud2) for side in ("left", "right")]
        both = stage.wait(lambda: all(meshes))
        yield "two nodes in namespaces of their own", "both heard", _told(both, "both heard", "not both")
        message = PoseStamped()
        message.pose.position.z = 0.1
        stage.publish("handles/tip/target", message)
        moved = stage.wait(lambda: abs(_rise(meshes[0][-1]) - 0.1) < 1e-6)
        apart = moved and _rise(meshes[1][-1]) < 1e-9
        yield "a command to one of them", "moves that one", _told(apart, "moves that one", "not so")


def _messages(bag: Path) -> int:
    """Count the messages of a bag, read by rosbags."""
    with AnyReader([bag]) as reader:
        return sum(1 for _ in reader.messages())


def _service(request: Any) -> type:
    return SetBool if isinstance(request, SetBool.Request) else Trigger


def _told(found: Any, text: str, otherwise: str = "nothing") -> str:
    return text if found else otherwise


def _during(future: Any, state: str) -> str:
    return f"{state}, {'after' if future.done() else 'before'} they are done"


def _values(stage: Stage, *names: str) -> str:
    answer = stage.call(GetParameters, "get_parameters", GetParameters.Request(names=list(names)))
    if answer is None:
        return "no answer"
    return ", ".join(f"{each.double_value or each.integer_value:g}" for each in answer.values)


def _rise(cloud: PointCloud2) -> float:
    """Give the largest upward displacement of a mesh [m]."""
    return max(memoryview(bytes(cloud.data)).cast("f")[5::6])


GROUPS: tuple[Callable[[], Iterator[Row]], ...] = (subscribers, types, disks, parameters, work, doubles)
