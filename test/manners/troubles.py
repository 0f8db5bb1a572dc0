# SPDX-License-Identifier: Apache-2.0
"""What is asked of a node in trouble: steps that fail, numbers that are none, clocks that jump, too little time."""

from __future__ import annotations

import math
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from typing import Any

from geometry_msgs.msg import PoseStamped, TransformStamped
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from stage import Stage, provide
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

Row = tuple[str, str, str]

_DROP = ("-p", "scene:=drop", "-p", "scene_overrides:=['mesh.bar.cells=[10, 1, 1]', 'dynamics.step=0.001']")
_FINGER = ("-p", "scene:=tendon_finger", "-p", "scene_overrides:=['']")
_FOLLOW = ("-p", "command_max_age:=10.0", "-p")
_MANY = 20
_FIGURES = ("rate asked [Hz]", "rate reached [Hz]", "late per step [s]")


def failures() -> Iterator[Row]:
    """Have steps fail, for one of 1000 s has too many internal ones: the node pauses, and goes on from where it was."""
    with (
        tempfile.TemporaryDirectory() as folder,
        Stage([*_DROP, "-p", "clock:=lockstep", "-p", "record:=true", "-p", f"bag_path:={folder}/bag"]) as stage,
    ):
        stage.wait(lambda: stage.values.get("steps") == "1")
        yield "a step that fails", "false, active", f"{_fail(stage)}, {stage.state()}"
        told = "paused in the last good state, at 0 s" in stage.log and "~/pause false goes on" in stage.log
        yield "in the log", "the state it is in, the way on", _told(told, "the state it is in, the way on")
        report = stage.await_report()
        found = f"{report['steps failed']}, {report['clock']}"
        yield "on /diagnostics: steps failed, clock", "1, paused", found
        going = stage.call(SetBool, "pause", SetBool.Request(data=False)).success
        yield "~/pause false, ~/step after that", "true, true", f"{_word(going)}, {_step(stage)}"
        answers = [(_fail(stage), _step(stage)) for _ in range(_MANY)]
        right = sum(answer == ("false", "true") for answer in answers)
        yield f"{_MANY} more, each with a good one after it", f"{_MANY}", f"{right}"
        count = stage.await_report()["steps"]
        yield "steps made, beside the one at rest", f"{1 + _MANY}", f"{int(count) - 1}"
        stopped = stage.call(SetBool, "record", SetBool.Request(data=False))
        yield "~/record false after all of these", "true, 0 dropped", f"{_word(stopped.success)}, {_dropped(stopped)}"
        _fail(stage)
        yield "SIGINT after one more", "0", stage.end()


def numbers() -> Iterator[Row]:
    """Put numbers that are none on a followed topic and on a rigid body; put a body inside another."""
    with Stage([*_FOLLOW, "follow:=['tip=topic:/tool']"]) as stage:
        publisher = stage.node.create_publisher(PoseStamped, "/tool", 10)
        stage.wait(lambda: publisher.get_subscription_count() and stage.values.get("steps"))
        for name, reason, message in (
            ("NaN in a followed pose", "not finite", _pose(math.nan)),
            ("a zero quaternion in it", "quaternion not of unit length", _pose(w=0.0)),
            ("it is 100 s old", "stale", _pose(age=100.0)),
            ("it is 1000 s ahead", "stamp ahead", _pose(age=-1000.0)),
        ):
            publisher.publish(message)
            yield name, f"refused: {reason}", _counted(stage, reason)
        yield "the state after these", "active", stage.state()
    with Stage(["-p", "scene:=grasp", "-p", "scene_overrides:=['']", "-p", "clock:=lockstep"]) as stage:
        told = stage.listen("/gdfe_sim/refused", String, 10)
        stage.publish("bodies/part/set", _pose(math.nan))
        yield "NaN for a rigid body", "refused: not finite", _counted(stage, "not finite")
        stage.publish("bodies/part/set", _pose(-0.03))
        yield "a rigid body inside of the floor", "refused: inside of something", _counted(stage, "inside of something")
        named = stage.wait(lambda: any("bodies/part/set" in each.data for each in told), 10.0)
        yield "on ~/refused", "its topic", _told(named, "its topic")


def jumps() -> Iterator[Row]:
    """Follow a /clock that jumps ahead, on to epoch time, and back, with a body that has mass."""
    with Stage([*_DROP, "-p", "clock:=external", "-p", "use_sim_time:=true", "-p", "dt:=0.02"]) as stage:
        publisher = stage.node.create_publisher(Clock, "/clock", 10)
        stage.wait(lambda: publisher.get_subscription_count() and stage.values.get("state") == "active")
        for name, begin, word in (
            ("/clock from 100 s", 100.0, ""),
            ("it jumps ahead to 1100 s", 1100.0, "the clock jumped ahead from 100"),
            ("it jumps ahead to epoch time", 1.7e9, "the clock jumped ahead from 1100"),
            ("it jumps back to 5 s", 5.0, "the clock jumped back from 1.7"),
        ):
            before = float(stage.await_report()["simulation time [s]"])
            _show(stage, publisher, begin)
            report = stage.await_report()
            gone = float(report["simulation time [s]"]) - before
            told = not word or word in stage.log
            found = f"{'some steps' if 0.0 < gone < 1.0 else f'{gone} s'}, {_told(told, 'said', 'no word')}"
            yield name, "some steps, said", found
            behind = float(report["behind the clock [s]"])
            yield "seconds behind it", "below 1", "below 1" if behind < 1.0 else f"{behind}"


def frames() -> Iterator[Row]:
    """Tell of a followed frame with numbers and stamps that make no sense, and out of order."""
    provide("tf2_msgs")
    from tf2_msgs.msg import TFMessage

    with Stage([*_FOLLOW, "follow:=['tip=frame:tool']"]) as stage:
        pose = stage.listen("/gdfe_sim/handles/tip/pose", PoseStamped)
        publisher = stage.node.create_publisher(TFMessage, "/tf", 10)
        stage.wait(lambda: publisher.get_subscription_count() and pose)
        publisher.publish(TFMessage(transforms=[_transform(0.02)]))
        followed = stage.wait(lambda: abs(pose[-1].pose.position.z - 0.02) < 1e-6, 20.0)
        yield "a followed frame", "followed", _told(followed, "followed")
        for name, reason, transform in (
            ("NaN in it", "not finite", _transform(math.nan)),
            ("a zero quaternion in it", "quaternion not of unit length", _transform(0.0, w=0.0)),
            ("it is 100 s old", "stale", _transform(0.0, age=100.0)),
            ("it is 1000 s ahead", "stamp ahead", _transform(0.0, age=-1000.0)),
        ):
            publisher.publish(TFMessage(transforms=[transform]))
            yield name, f"refused: {reason}", _counted(stage, reason)
        for z, age in ((0.05, 0.0), (0.03, 1.0)):
            publisher.publish(TFMessage(transforms=[_transform(z, age=age)]))
        latest = stage.wait(lambda: abs(pose[-1].pose.position.z - 0.05) < 1e-6, 20.0)
        stage.await_report()
        latest = latest and abs(pose[-1].pose.position.z - 0.05) < 1e-6
        yield "two, the older one last", "the later stamp counts", _told(latest, "the later stamp counts")
        yield "the state, tracebacks", "active, 0", f"{stage.state()}, {stage.log.count('Traceback')}"


def demands() -> Iterator[Row]:
    """Ask for steps and trajectories as actions, and to play meanwhile."""
    provide("simulation_interfaces")
    from simulation_interfaces.action import SimulateSteps
    from simulation_interfaces.srv import SetSimulationState

    with Stage() as stage:
        stage.wait(lambda: stage.values.get("state") == "active")
        stage.call(SetBool, "pause", SetBool.Request(data=True))
        goal = stage.goal(SimulateSteps, "simulate_steps", SimulateSteps.Goal(steps=1_000_000))
        request = SetSimulationState.Request()
        request.state.state = 1
        answer = stage.call(SetSimulationState, "set_simulation_state", request)
        found = "refused" if answer.result.result != 1 and "cancel it" in answer.result.error_message else "played"
        yield "PLAYING while the action simulates steps", "refused", found
        answer = stage.call(SetBool, "pause", SetBool.Request(data=False))
        yield "~/pause false meanwhile", "false", _word(answer.success)
        cancelled = goal.cancel_goal_async()
        stage.wait(cancelled.done)
        answer = stage.call(SetSimulationState, "set_simulation_state", request)
        yield "PLAYING after it was cancelled", "played", _told(answer.result.result == 1, "played", "refused")
    provide("control_msgs")
    from control_msgs.action import FollowJointTrajectory

    with Stage([*_FINGER, "-p", "clock:=fast", "-p", "heartbeat:=0.0", "-p", "dt:=0.05"]) as stage:
        stage.wait(lambda: stage.values.get("state") == "active")
        for name, joint, expected in (("a trajectory as a goal", "flexor", "0"), ("of a joint unknown", "arm", "-2")):
            trajectory = JointTrajectory(joint_names=[joint], points=[JointTrajectoryPoint(positions=[1.0])])
            trajectory.points[0].time_from_start.sec = 1
            goal = FollowJointTrajectory.Goal(trajectory=trajectory)
            result = stage.goal(FollowJointTrajectory, "follow_joint_trajectory", goal).get_result_async()
            stage.wait(result.done)
            yield f"{name}: its error code", expected, f"{result.result().result.error_code}"


def hurry() -> Iterator[Row]:
    """Ask for more than there is time for: a rate, and a command within a deadline."""
    with Stage(["-p", "scene_overrides:=['']", "-p", "rate:=1000.0", "-p", "dt:=0.001"]) as stage:
        target = iter(range(1, 100_000))

        def late() -> bool:
            stage.publish("handles/tip/target", _pose(1e-5 * next(target)))
            return int(stage.values.get("overruns", 0)) > 100

        told = stage.wait(late)
        asked, reached, late_by = (stage.values.get(key, "0") for key in _FIGURES)
        right = told and asked == "1000" and 0.0 < float(reached) < 1000.0 and float(late_by) > 0.0
        found = _told(right, "asked, reached, late", f"{asked}, {reached}, {late_by}")
        yield "1000 steps a second of a large bar", "asked, reached, late", found
    with Stage([*_FINGER, "-p", "deadline:=1.0", "-p", "slew_time:=40.0"]) as stage:
        records = stage.listen("/gdfe_sim/step_record", String)
        stage.wait(lambda: records)
        stage.publish("actuation", JointState(name=["flexor"], effort=[3.0]))
        told = stage.wait(lambda: "flexor at" in stage.values.get("on their way", ""), 20.0)
        yield "a tension that is too far for a step", "told on its way", _told(told, "told on its way")
        there = stage.wait(lambda: any('"flexor": 3.0' in record.data for record in records))
        yield "the same, later", "there", _told(there, "there")
        converged = stage.wait(lambda: stage.values["converged"] == "True" and "on their way" not in stage.values)
        yield "the last step", "converged", _told(converged, "converged", "not converged")


def resets() -> Iterator[Row]:
    """Put a rigid body aside and the wrist up, and take back the one without the other."""
    with Stage(["-p", "scene:=grasp", "-p", "scene_overrides:=['']", "-p", "clock:=lockstep"]) as stage:
        part = stage.listen("/gdfe_sim/bodies/part/pose", PoseStamped)
        wrist = stage.listen("/gdfe_sim/handles/wrist/pose", PoseStamped)
        stage.wait(lambda: part and wrist)
        stage.publish("bodies/part/set", _pose(0.02))
        stage.publish("handles/wrist/target", _pose(0.002))
        moved = stage.wait(lambda: part[-1].pose.position.z > 0.01 and wrist[-1].pose.position.z > 0.0015)
        yield "a rigid body put up, a handle too", "there", _told(moved, "there")
        answer = stage.call(Trigger, "reset_bodies")
        yield "~/reset_bodies, ~/step", "true, true", f"{_word(answer.success)}, {_step(stage)}"
        back = stage.wait(lambda: abs(part[-1].pose.position.z) < 0.005)
        stays = back and wrist[-1].pose.position.z > 0.0015
        yield "the body, the handle", "back, stays", f"{_told(back, 'back', 'up')}, {_told(stays, 'stays', 'back')}"
        answer = stage.call(Trigger, "reset_shape")
        rest = stage.wait(lambda: abs(wrist[-1].pose.position.z) < 1e-9)
        found = f"{_word(answer.success)}, {_told(rest, 'at rest', 'moved')}"
        yield "~/reset_shape, the handle", "true, at rest", found
        stage.publish("handles/wrist/target", _pose(0.002))
        stage.wait(lambda: wrist[-1].pose.position.z > 0.0015)
        answer = stage.call(Trigger, "reset_commands")
        found = f"{_word(answer.success)}, {_step(stage)}"
        yield "~/reset_commands, ~/step", "true, true", found
        rest = stage.wait(lambda: abs(wrist[-1].pose.position.z) < 1e-9)
        yield "the handle after that", "at rest", _told(rest, "at rest", "moved")


def programs() -> Iterator[Row]:
    """Ask an example with several robots for help, and with an argument that it does not have."""
    for given, expected in (("--help", "0, usage"), ("three", "2, one line")):
        command = [sys.executable, "-m", "gdfe_ros.examples.two_robots", given]
        done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
        said = "usage" if done.stdout.startswith("usage") else "one line"
        found = "traceback" if "Traceback" in done.stderr else said
        yield f"two_robots {given}", expected, f"{done.returncode}, {found}"


GROUPS: tuple[Callable[[], Iterator[Row]], ...] = (failures, numbers, jumps, frames, demands, hurry, resets, programs)


def _fail(stage: Stage) -> str:
    """Ask for a step that no simulation makes, and give the answer."""
    _set_dt(stage, 1e3)
    answer = _step(stage)
    _set_dt(stage, 0.01)
    return answer


def _set_dt(stage: Stage, seconds: float) -> None:
    message = Parameter("dt", value=seconds).to_parameter_msg()
    stage.call(SetParameters, "set_parameters", SetParameters.Request(parameters=[message]))


def _step(stage: Stage) -> str:
    return _word(stage.call(Trigger, "step").success)


def _dropped(answer: Any) -> str:
    return answer.message.rpartition(", ")[2]


def _counted(stage: Stage, reason: str) -> str:
    """Wait until one command is counted as refused for a reason."""
    found = stage.wait(lambda: stage.values.get(f"refused: {reason}") == "1", 10.0)
    return f"refused: {reason}" if found else "not counted"


def _show(stage: Stage, publisher: Any, begin: float) -> None:
    """Show times on /clock for a second, from a moment [s] on."""
    for count in range(50):
        nanoseconds = round(1e9 * begin) + count * 20_000_000
        message = Clock()
        message.clock.sec, message.clock.nanosec = divmod(nanoseconds, 10**9)
        publisher.publish(message)
        stage.wait(lambda: False, 0.02)


def _pose(z: float = 0.0, *, w: float = 1.0, age: float | None = None) -> PoseStamped:
    message = PoseStamped()
    message.pose.position.z, message.pose.orientation.w = z, w
    _stamp(message, age)
    return message


def _transform(z: float, *, w: float = 1.0, age: float = 0.0) -> TransformStamped:
    """Tell of the frame ``tool``, so far above the tip's at rest [m]."""
    message = TransformStamped(child_frame_id="tool")
    message.header.frame_id, message.transform.translation.z, message.transform.rotation.w = "tip_rest", z, w
    _stamp(message, age)
    return message


def _stamp(message: Any, age: float | None) -> None:
    if age is not None:
        moment = time.time_ns() - round(age * 1e9)
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(moment, 10**9)


def _word(success: bool) -> str:
    return str(success).lower()


def _told(found: Any, text: str, otherwise: str = "nothing") -> str:
    return text if found else otherwise
