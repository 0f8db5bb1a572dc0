# SPDX-License-Identifier: Apache-2.0
"""Programs and recorded runs, played to a node over topics; a repeated run is compared with the recorded run."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from gdfe_ros.analysis.bag_run import BagRun, BagSteps
from gdfe_ros.analysis.replay import Replay, ReplayReport, compare_steps
from gdfe_ros.constraints import Pose
from gdfe_ros.errors import CommandError, GdfeError, RecordingError
from gdfe_ros.node.driving.orders import PoseOrder
from gdfe_ros.node.interface import NODE_NAME
from gdfe_ros.node.interface.topics import pose_key
from gdfe_ros.node.messages import actuation, pose_stamped
from gdfe_ros.recording.provenance import STATE_FILE
from gdfe_ros.recording.step import Begin, StepRecord
from gdfe_ros.scene.override import override_words
from gdfe_ros.scene.scene import Scene
from gdfe_ros.testing.client import LONGEST_WAIT, NodeConnection
from gdfe_ros.testing.consumed import ACTUATION, Consumed
from gdfe_ros.testing.node_process import NodeProcess


def play_program(
    scene: Scene,
    source: str,
    *,
    bag: Path,
    dt: float,
    steps: int | None = None,
    parameters: Mapping[str, Any] | None = None,
    tell: Callable[[float], None] = lambda _: None,
) -> float:
    """Start a node, command it step by step with a program, and stop it; return the duration of its start [s].

    The duration is the wall time until the node is ready for the first command.

    Args:
        scene: scene with a program.
        source: scene that the node loads: name, or path of its file.
        bag: directory of the recorded bag.
        dt: simulation time of a step [s].
        steps: number of steps of the program; None: the program's duration divided by dt.
        parameters: parameters of the node; they take precedence over the values for lockstep and recording.
        tell: function that is called after each step with the step's time in the program [s].

    Raises:
        CommandError: a handle turns by more than pi in one step.
        GdfeError: the node ended, did not respond, ended with an error, or another node has its name; the message
            contains the node's log if it has one.
    """
    duration = scene.program.duration
    moments = np.linspace(0.0, duration, (steps or max(1, round(duration / dt))) + 1)[1:]
    targets: dict[str, Pose] = {}
    for moment in moments:  # before the node is started
        targets = _turn(scene.program.handle_poses(moment), targets, f"the program with steps of {dt:g} s")
    topics = {key: type(each) for key, each in _messages(scene, 0.0).items()}
    settings = {
        "scene": source,
        "clock": "lockstep",
        "dt": dt,
        "record": True,
        "bag_path": str(bag),
        "command_set": list(topics),
        **(parameters or {}),
    }
    started = time.perf_counter()
    with NodeProcess(settings) as node, NodeConnection(node, f"/{NODE_NAME}", topics, patience=LONGEST_WAIT) as link:
        # Wait for step 0, the undeformed body: if it arrived later, it would be taken for that of the first command.
        link.wait_for_step(0)
        link.await_listeners()
        link.require_alone()
        first = time.perf_counter() - started
        tell(0.0)
        for moment in moments:
            last = link.step
            link.publish(_messages(scene, moment))
            link.wait_for_step(last + 1)
            tell(moment)
            link.look_for_doubles()
        if node.stop() != 0:
            raise GdfeError(f"the node ended with status {node.status}:\n{node.log}")
        return first


def _messages(scene: Scene, moment: float) -> dict[str, Any]:
    """Return a dict from command topic, relative to the node's name, to message, at the time ``moment`` [s]."""
    program, handles = scene.program, {handle.name: handle for handle in scene.handles}
    poses = program.handle_poses(moment).items()
    messages = {pose_key(handles[name]): pose_stamped(Header(), pose) for name, pose in poses}
    values = program.actuator_values(moment) | program.load_factors(moment) | program.joint_positions(moment)
    if values:
        messages[ACTUATION] = actuation({actuator.name: actuator for actuator in scene.actuators}, values)
    return messages


_SLOWER = 20.0
"""The longest wait is `LONGEST_WAIT` plus this factor times the longest wall time of a recorded step."""
_NO_CUT = -1


class NodeReplay:
    """Replays a bag: a node in lockstep with the bag's scene receives the recorded commands, and writes a new bag.

    Steps that consumed no commands are made by the service ``~/step``. Before a step of another duration, the parameter
    ``dt`` is set. If a deadline ended a solve in the recorded run, the parameter ``cut_after`` ends the solve at the
    same point. A bag that begins in the middle of a run contains its first state, and the node loads this state.

    Args:
        run: recorded run.
        overrides: dict from dotted key to the value that replaces the scene's. With overrides the runs differ, and no
            solve is ended early.

    Raises:
        CommandError: a handle turns by more than pi in one step.
        RecordingError: the bag lacks data that a replay needs.
        SceneError: the overrides do not fit the scene.
    """

    def __init__(self, run: BagRun, *, overrides: Mapping[str, Any] | None = None) -> None:
        self._run, self._overrides = run, dict(overrides or {})
        replay = Replay(run, overrides=overrides)
        if replay.end:
            raise RecordingError(f"{replay.end}; without --ros the steps before it are replayed")
        self._simulation = replay.simulation
        self._consumed = Consumed(run)
        self._name = f"/gdfe_replay_{os.getpid()}/{NODE_NAME}"
        self._patience = LONGEST_WAIT + _SLOWER * max(record.wall_time for record in run.records)
        targets = dict(replay.simulation.targets)
        for record in run.records:
            _require_a_node(run, record)
            text = f"step {record.step} of bag {run.reader.path} can only be replayed without --ros"
            targets = _turn(record.handles, {} if record.begin is Begin.REST else targets, text) | record.handles
            if len(record.bodies) > 1 and not self._consumed.inputs:
                text = f"step {record.step} of bag {run.reader.path} puts several bodies in a run without other inputs"
                raise RecordingError(f"{text}; replay it without --ros")

    def run(self) -> ReplayReport:
        """Replay the whole bag and return the comparison.

        Raises:
            GdfeError: the node ended or did not respond.
        """
        started = time.perf_counter()
        with TemporaryDirectory(prefix="gdfe_replay_") as folder:
            self._repeat(Path(folder))
            return self._compare(BagRun(Path(folder) / "bag"), started)

    def _repeat(self, folder: Path) -> None:
        """Run a node with the recorded commands; it writes its bag in ``folder``."""
        source = self._run.reader.run
        (folder / "scene.yaml").write_text(source.scene, encoding="utf-8")
        if STATE_FILE in source.files:
            (folder / STATE_FILE).write_bytes(source.files[STATE_FILE])
        keys = (*self._consumed.puts, *self._consumed.inputs)
        topics = {key: JointState if key == ACTUATION else PoseStamped for key in keys}
        with (
            NodeProcess(self._parameters(folder), namespace=self._name.rpartition("/")[0]) as process,
            NodeConnection(process, self._name, topics, patience=self._patience) as link,
        ):
            link.meet()
            link.transition("configure")
            link.await_listeners()
            self._play(link)
            if process.stop() != 0:
                raise RecordingError(f"the replaying node ended with status {process.status}:\n{process.log}")

    def _parameters(self, folder: Path) -> dict[str, Any]:
        return {
            "scene": str(folder / "scene.yaml"),
            "scene_overrides": override_words(self._overrides) or [""],
            "autostart": False,
            "clock": "lockstep",
            "command_set": self._consumed.inputs or [""],
            "record": True,
            "bag_path": str(folder / "bag"),
            "state_path": str(folder / STATE_FILE),
        }

    def _play(self, link: NodeConnection) -> None:
        dt, cut = None, _NO_CUT
        for count, record in enumerate(self._run.records):
            place = _NO_CUT if record.cut_after is None or self._overrides else record.cut_after
            if place != cut:
                link.set(cut_after=place)
            if record.dt not in (0.0, dt):
                link.set(dt=record.dt)
                dt = record.dt
            cut = place
            self._step(link, count, record)
            link.wait_for_step(count)

    def _step(self, link: NodeConnection, count: int, record: StepRecord) -> None:
        """Make the node repeat the step of a record."""
        if count == 0 or record.begin is Begin.REST:
            if count > 0:
                self._simulation.reset()
                link.trigger("reset")
            else:
                if record.begin is Begin.LOADED:
                    link.trigger("load_state")
                link.transition("activate")
            self._consumed.start(self._simulation.targets, self._simulation.commands | self._simulation.joint_goals)
        elif messages := self._consumed.messages(record):
            link.publish(messages)
        else:
            link.trigger("step")

    def _compare(self, again: BagRun, started: float) -> ReplayReport:
        steps = BagSteps(self._run)
        pairs = zip(steps, BagSteps(again), strict=True)
        repeated = ((first, second.samples, second.record.converged) for first, second in pairs)
        given = {"started": started, "inexact": self._consumed.inexact}
        return compare_steps(steps, repeated, changed=bool(self._overrides), **given)


def _turn(poses: Mapping[str, Pose], last: Mapping[str, Pose], what: str) -> dict[str, Pose]:
    """Return the targets of a node after messages with ``poses``; its ``last`` targets are by default at rest.

    Raises:
        CommandError: a handle would turn by more than pi; the text begins with ``what``.
    """
    targets = dict(last)
    try:
        for name, pose in poses.items():
            before = last.get(name, Pose())
            targets[name] = PoseOrder.toward(name, pose, before).after(before)
    except CommandError as error:
        raise CommandError(f"{what}: {error}") from error
    return targets


def _require_a_node(run: BagRun, record: StepRecord) -> None:
    """Check a record that a node can only repeat by publishing its initial state.

    This is the first record of the run, and the first record after a reset: a node makes no step there.

    Raises:
        RecordingError: such a record has a command or a duration.
    """
    begins = record is run.records[0] or record.begin is Begin.REST
    if begins and (record.dt or record.handles or record.actuators or record.loads or record.bodies or record.joints):
        raise RecordingError(
            f"step {record.step} of bag {run.reader.path} begins a run with a command or a time step, where a node "
            "only publishes the state; replay it without --ros"
        )
