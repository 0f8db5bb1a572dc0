# SPDX-License-Identifier: Apache-2.0
"""What is asked of a node, what is expected, and what was found."""

from __future__ import annotations

import math
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from geometry_msgs.msg import PoseStamped, TwistStamped
from rclpy.qos import QoSProfile, ReliabilityPolicy, qos_profile_sensor_data
from sensor_msgs.msg import JointState, PointCloud2
from stage import Stage
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger
from trajectory_msgs.msg import JointTrajectory

Row = tuple[str, str, str]
"""Asked, expected, found."""

_VALID = {"unconfigured": {1}, "inactive": {2, 3}, "active": {4}}
_TRIED = (0, 1, 2, 3, 4, 10, 99, 255)
_PATHS = {"unconfigured": (), "inactive": (1,), "active": (1, 3)}


def transitions() -> Iterator[Row]:
    """Try transitions in every state that does not have them, then those that it has."""
    for state, path in _PATHS.items():
        with Stage(["-p", "autostart:=false"]) as stage:
            for number in path:
                stage.transition(number)
            for number in sorted(set(_TRIED) - _VALID[state]):
                answer = stage.transition(number)
                yield f"transition {number} while {state}", f"false, {state}", f"{answer}, {stage.state()}"
            for number in sorted(_VALID[state]):
                yield f"transition {number} while {state}", "true", stage.transition(number)
                if state == "inactive" and number == 2:
                    stage.transition(1)
            yield f"SIGINT after that ({state})", "0", stage.end()


def commands() -> Iterator[Row]:
    """Send commands that are wrong in one way each: each is counted under its reason, and nothing moves."""
    with Stage() as stage:
        mesh = stage.listen("/gdfe_sim/mesh", PointCloud2)
        stage.wait(lambda: mesh)
        for name, expected, topic, message in _wrong():
            before = int(stage.await_report().get(f"refused: {expected}", 0))
            stage.publish(topic, message)
            stage.wait(lambda name=expected, n=before: int(stage.values.get(f"refused: {name}", 0)) > n, 10.0)
            counted = int(stage.values.get(f"refused: {expected}", 0)) - before
            yield name, f"refused: {expected}", f"refused: {expected}" if counted == 1 else f"{stage.values}"
        yield "the mesh after all of these", "at rest", "at rest" if _highest(mesh) < 1e-6 else "moved"
        stage.intrude("/gdfe_sim/handles/tip/target", String(data="x"))
        stage.publish("handles/tip/target", _pose(z=0.05))
        found = stage.wait(lambda: abs(_highest(mesh) - 0.05) < 1e-6, 20.0)
        yield "a good target, beside a publisher of another type", "carried out", "carried out" if found else "lost"


def _wrong() -> Iterator[tuple[str, str, str, Any]]:
    target, velocity = "handles/tip/target", "handles/tip/velocity"
    yield "a target in frame odom", "other frame", target, _pose(z=0.1, frame="odom")
    twist = TwistStamped()
    twist.header.frame_id, twist.twist.linear.z = "tool0", 0.1
    yield "a velocity in frame tool0", "other frame", velocity, twist
    yield "a target stamped a day ahead", "stamp ahead", target, _pose(z=0.1, ahead=86_400.0)
    yield "a target of NaN", "not finite", target, _pose(z=math.nan)
    yield "a target a kilometre away", "too far", target, _pose(z=1e3)
    long = _pose()
    long.pose.orientation.w = 2.0
    yield "a quaternion of length 2", "quaternion not of unit length", target, long
    yield "a target of a fixed handle", "handle is fixed", "handles/base/target", _pose(z=0.1)


def actuators() -> Iterator[Row]:
    """Command tendons by two publishers, by NaN, by wrong names and sizes."""
    scene = ["-p", "scene:=tendon_finger", "-p", "scene_overrides:=['']"]
    with Stage([*scene, "-p", "heartbeat:=0.0", "-p", "slew_time:=0.0", "-p", "ratee:=5"]) as stage:
        records = stage.listen("/gdfe_sim/step_record", String)
        stage.wait(lambda: records)
        for name, expected, message in (
            ("a JointState of an unknown name", "unknown name", JointState(name=["nobody"], effort=[1.0])),
            ("two efforts for one name", "wrong size", JointState(name=["flexor"], effort=[1.0, 2.0])),
            ("an infinite effort", "not finite", JointState(name=["flexor"], effort=[math.inf])),
            ("an effort out of range", "out of range", JointState(name=["flexor"], effort=[1e6])),
        ):
            stage.publish("actuation", message)
            stage.wait(lambda key=f"refused: {expected}": stage.values.get(key) == "1", 10.0)
            count = stage.values.get(f"refused: {expected}", "0")
            yield name, f"refused: {expected}", f"refused: {expected}" if count == "1" else "taken"
        stage.call(SetBool, "pause", SetBool.Request(data=True))
        stage.publish("actuation", JointState(name=["flexor", "extensor"], effort=[1.0, math.nan]))
        second = stage.node.create_publisher(JointState, "/gdfe_sim/actuation", 10)
        stage.wait(second.get_subscription_count)
        second.publish(JointState(name=["extensor"], effort=[2.0]))
        stage.wait(lambda: stage.values.get("commands taken") == "2")
        answer = stage.call(Trigger, "step")
        stage.wait(lambda: '"extensor": 2.0' in records[-1].data, 10.0)
        both = '"actuators": {"flexor": 1.0, "extensor": 2.0}' in records[-1].data
        yield "two publishers, one with NaN, before one step", "both consumed", "both consumed" if both else "one lost"
        yield "~/step while paused", "true", str(answer.success).lower()
        told = "parameter 'ratee' is unknown" in stage.log
        yield "a parameter ratee", "told", "told" if told else "silence"
        stage.publish("trajectory", JointTrajectory())
        taken = stage.wait(lambda: stage.values.get("commands taken") == "3", 10.0)
        yield "a trajectory without points", "taken", "taken" if taken else "refused"
        asked = [stage.values.get(key) for key in ("rate asked [Hz]", "rate reached [Hz]", "late per step [s]")]
        yield "the rate asked, reached, and the lateness", "all three", "all three" if all(asked) else f"{asked}"
        stage.node.create_publisher(JointState, "/gdfe_sim/actuation", qos_profile_sensor_data)
        heard = stage.wait(lambda: "best effort; allowed: reliable" in stage.values.get("unheard", ""), 10.0)
        yield "a publisher of commands, best effort", "told", "told" if heard else "silence"
        answer = stage.call(Trigger, "reset_commands")
        yield "~/reset_commands", "true", str(answer.success).lower()


def latecomers() -> Iterator[Row]:
    """Move with nobody listening, then listen; stop and listen again."""
    with Stage(["-p", "clock:=lockstep"]) as stage:
        stage.wait(lambda: stage.values.get("steps") == "1")
        stage.publish("handles/tip/target", _pose(z=0.1))
        stage.wait(lambda: stage.values.get("steps") == "2")
        volatile = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
        for name, qos in (("latched", None), ("volatile, best effort", volatile)):
            mesh = stage.listen("/gdfe_sim/mesh", PointCloud2, *([qos] if qos else []))
            shown = stage.wait(lambda mesh=mesh: abs(_highest(mesh) - 0.1) < 1e-6, 20.0)
            yield f"listen late to ~/mesh ({name})", "the present state", "the present state" if shown else "nothing"
        stamp = mesh[-1].header.stamp
        close = abs(stamp.sec + 1e-9 * stamp.nanosec - time.time()) < 600.0
        yield "the stamp of that mesh", "wall time", "wall time" if close else f"{stamp.sec} s"
        stage.publish("handles/tip/target", _pose(z=0.2, ahead=-1.0))
        stage.publish("handles/tip/target", _pose(z=0.2, ahead=-9.0))
        stage.wait(lambda: stage.values.get("refused: out of order") == "1", 10.0)
        yield "a stamp before the last one's", "1 refused", f"{stage.values.get('refused: out of order', 0)} refused"


def names() -> Iterator[Row]:
    """Remaps, a namespace, two nodes of one name."""
    with Stage(["-r", "~/mesh:=/cloud", "-r", "__ns:=/robot"], name="/robot/gdfe_sim") as stage:
        cloud = stage.listen("/cloud", PointCloud2)
        yield "~/mesh:=/cloud in namespace /robot", "heard", "heard" if stage.wait(lambda: cloud) else "nothing"
        yield "its state", "active", stage.state()
    with Stage((), ()) as stage:
        told = stage.wait(lambda: stage.log.count("2 nodes are called /gdfe_sim") == 2, 60.0)
        yield "two nodes of one name", "both warn", "both warn" if told else "no word"
        yield "SIGINT to both", "0, 0", stage.end()


def starts() -> Iterator[Row]:
    """Start with help, with unknown arguments, with bad files of parameters; record where nothing can be written."""
    with tempfile.TemporaryDirectory() as folder:
        broken = Path(folder) / "broken.yaml"
        broken.write_text("a: [b\n c: d", encoding="utf-8")
        for name, given, expected in (
            ("--help", ["--help"], "0, usage"),
            ("an unknown argument", ["bend5"], "2, one line"),
            ("a params file that is missing", ["--ros-args", "--params-file", "/nonexistent.yaml"], "2, one line"),
            ("a params file that is broken", ["--ros-args", "--params-file", str(broken)], "2, one line"),
            ("rate:=0", ["--ros-args", "-p", "rate:=0"], "2, one line"),
        ):
            command = [sys.executable, "-m", "gdfe_ros.node", *given]
            done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
            said = "usage" if done.stdout.startswith("usage") else "one line"
            found = "traceback" if "Traceback" in done.stderr else said
            yield f"start with {name}", expected, f"{done.returncode}, {found}"
        with Stage(["-p", f"bag_path:={broken}/bag"]) as stage:
            stage.wait(lambda: stage.values.get("state") == "active")
            answer = stage.call(SetBool, "record", SetBool.Request(data=True))
            found = "no answer" if answer is None else str(answer.success).lower()
            yield "~/record to a place that is no directory", "false, active", f"{found}, {stage.state()}"


GROUPS: tuple[Callable[[], Iterator[Row]], ...] = (transitions, commands, actuators, latecomers, names, starts)


def _pose(*, z: float = 0.0, frame: str = "", ahead: float | None = None) -> PoseStamped:
    message = PoseStamped()
    message.header.frame_id, message.pose.position.z = frame, z
    if ahead is not None:
        moment = time.time_ns() + round(ahead * 1e9)
        message.header.stamp.sec, message.header.stamp.nanosec = moment // 10**9, moment % 10**9
    return message


def _highest(clouds: list[PointCloud2]) -> float:
    """Give the largest upward displacement of the last mesh [m]; 0 before the first."""
    if not clouds:
        return 0.0
    return max(memoryview(bytes(clouds[-1].data)).cast("f")[5::6])
