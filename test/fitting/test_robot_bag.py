# SPDX-License-Identifier: Apache-2.0
"""Bags of a robot's own topics: poses, transforms, markers, clouds, commands."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from gdfe_ros.analysis.workers import connect
from gdfe_ros.cli import main
from gdfe_ros.fitting.fit import read_recordings
from gdfe_ros.fitting.trajectory import Simulations
from gdfe_ros.recording.bag_info import TopicInfo
from gdfe_ros.recording.writer import BagWriter
from gdfe_ros.scene import scene_from_text
from gdfe_ros.simulation import Command, Simulation
from test.fitting.conftest import PULLED

STORE = get_typestore(Stores.ROS2_JAZZY)
YOUNG = "materials.rubber.young"
TIMES = np.arange(1, 21)
"""Times of the messages [s]."""
START = 1_700_000_000
"""Start time of the robot's clock [s]."""
TOPICS = {
    "/cmd": "sensor_msgs/msg/JointState",
    "/pose": "geometry_msgs/msg/PoseStamped",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/markers": "visualization_msgs/msg/MarkerArray",
    "/points": "sensor_msgs/msg/PointCloud2",
    "/height": "std_msgs/msg/Float64MultiArray",
}


def _type(name: str) -> Any:
    return STORE.types[name]


def _header(seconds: float) -> Any:
    whole = int(START + seconds)
    stamp = _type("builtin_interfaces/msg/Time")(whole, round(1e9 * (START + seconds - whole)))
    return _type("std_msgs/msg/Header")(stamp, "lab")


def _point(kind: str, place: np.ndarray) -> Any:
    return _type(f"geometry_msgs/msg/{kind}")(*map(float, place))


def _straight() -> Any:
    return _type("geometry_msgs/msg/Quaternion")(0.0, 0.0, 0.0, 1.0)


def _messages(second: float, force: float, tip: np.ndarray, cloud: np.ndarray) -> dict[str, Any]:
    """Return a message of each topic; frames and markers also contain one that is not to be used."""
    head, pose = _header(second), _type("geometry_msgs/msg/Pose")
    transform, placed = _type("geometry_msgs/msg/Transform"), _type("geometry_msgs/msg/TransformStamped")
    frames = [
        placed(head, name, transform(_point("Vector3", place), _straight()))
        for name, place in (("base", np.zeros(3)), ("tip", tip))
    ]
    marker = _type("visualization_msgs/msg/Marker")
    markers = []
    for number, place in ((3, tip), (4, np.ones(3))):
        one = marker(
            header=head, ns="body", id=number, type=2, action=0, pose=pose(_point("Point", place), _straight()),
            scale=_point("Vector3", np.ones(3)), color=_type("std_msgs/msg/ColorRGBA")(1.0, 1.0, 1.0, 1.0),
            lifetime=_type("builtin_interfaces/msg/Duration")(0, 0), frame_locked=False, points=[], colors=[],
            texture_resource="", texture=_type("sensor_msgs/msg/CompressedImage")(head, "", np.zeros(0, np.uint8)),
            uv_coordinates=[], text="", mesh_resource="", mesh_file=_type("visualization_msgs/msg/MeshFile")(
                "", np.zeros(0, np.uint8)), mesh_use_embedded_materials=False,
        )  # fmt: skip
        markers.append(one)
    field = _type("sensor_msgs/msg/PointField")
    data = np.frombuffer(cloud.astype("<f4").tobytes(), np.uint8)
    fields = [field(name, 4 * place, 7, 1) for place, name in enumerate("xyz")]
    empty = np.zeros(0)
    return {
        "/height": _type(TOPICS["/height"])(_type("std_msgs/msg/MultiArrayLayout")([], 0), np.array([tip[2]])),
        "/cmd": _type(TOPICS["/cmd"])(head, ["motor"], empty, empty, np.array([force])),
        "/pose": _type(TOPICS["/pose"])(head, pose(_point("Point", tip), _straight())),
        "/tf": _type(TOPICS["/tf"])(frames),
        "/markers": _type(TOPICS["/markers"])(markers),
        "/points": _type(TOPICS["/points"])(head, 1, len(cloud), fields, False, 12, 12 * len(cloud), data, True),
    }


@pytest.fixture
def robot_bag(tmp_path: Path) -> Path:
    """Record a robot: the bar under rising loads, observed by four systems on one clock."""
    simulation, rng = Simulation(scene_from_text(PULLED)), np.random.default_rng(4)
    infos = []
    for name, kind in TOPICS.items():
        definition, _ = STORE.generate_msgdef(kind, ros_version=2)
        infos.append(TopicInfo(name=name, type=kind, definition=definition, type_hash=STORE.hash_rihs01(kind)))
    writer = BagWriter(tmp_path / "robot", infos)
    for second in TIMES:
        force = 1e3 * 0.05 * 2.0 * second / TIMES[-1]  # millinewtons
        simulation.step(Command(loads={"pull": 20e-3 * force}))
        tip = simulation.probe_positions()["tip"] + 2e-5 * rng.standard_normal(3)
        surface = simulation.positions[simulation.mesh.boundary.quads].mean(axis=1)
        for topic, message in _messages(float(second), force, tip, surface).items():
            writer.write(topic, STORE.serialize_cdr(message, TOPICS[topic]), (START + int(second)) * 10**9)
    writer.close({})
    return tmp_path / "robot"


@pytest.mark.parametrize(
    "entry",
    [
        "{probe: tip, topic: /pose}",
        "{probe: tip, topic: /tf, frame_id: tip}",
        "{probe: tip, topic: /markers, marker: body/3}",
        "{cloud: surface, topic: /points}",
        "{probe: tip, topic: /height, along: [0, 0, 1]}",
        "{probe: tip, topic: /pose, along: [0, 0, -2]}",
    ],
)
def test_a_robot_is_fitted(entry: str, robot_bag: Path, write_scene: Callable, tmp_path: Path) -> None:
    """With each kind of topic, and commands from a JointState in millinewtons, the modulus is found within 1 %."""
    match, out = tmp_path / "match.yaml", tmp_path / "out"
    command = "{topic: /cmd, joint: motor, unit: mN}"
    text = Path(write_scene()).read_text().replace("force: [0, 0, -0.05]", "force: [0, 0, -1.0]")
    match.write_text(f"compare: {{seen: {entry}}}\ncommands: {{pull: {command}}}\n")
    given = ["--match", str(match), "--vary", f"{YOUNG}=5e4..8e5", "--workers", "1", "--out", str(out)]
    assert main(["fit", write_scene(text), str(robot_bag), *given]) == 0
    found = json.loads((out / "fit.json").read_text())["parameters"][YOUNG]["value"]
    assert found == pytest.approx(2e5, rel=0.01)


def _write(path: Path, messages: list[dict[str, Any]], epoch: int) -> None:
    """Write a bag of commands and poses, one of each in 0.1 s of the recorder's clock, from ``epoch`` [s] on."""
    kinds = {name: TOPICS[name] for name in ("/cmd", "/pose")}
    infos = [TopicInfo(name=n, type=k, definition=STORE.generate_msgdef(k, ros_version=2)[0]) for n, k in kinds.items()]
    writer = BagWriter(path, infos)
    for number, each in enumerate(messages):
        for topic, kind in kinds.items():
            writer.write(topic, STORE.serialize_cdr(each[topic], kind), epoch * 10**9 + number * 10**8)
    writer.close({})


def test_a_commanded_handle_turns_on_and_on(tmp_path: Path) -> None:
    """A handle that is commanded by quaternions through two turns, in steps of 0.5 rad, does not turn back at pi."""
    angles, messages = np.arange(0.0, 12.6, 0.5), []
    for number, angle in enumerate(angles):
        messages.append(_messages(float(number), 0.0, np.zeros(3), np.zeros((1, 3))))
        quaternion = messages[-1]["/pose"].pose.orientation
        quaternion.y, quaternion.w = np.sin(0.5 * angle), np.cos(0.5 * angle)
    _write(tmp_path / "bag", messages, START)
    match = tmp_path / "match.yaml"
    match.write_text("compare: {seen: {probe: tip, topic: /pose}}\ncommands: {base: {topic: /pose}}\n")
    scene = scene_from_text(PULLED.replace("fixed: true", "fixed: false"))
    (recording,) = read_recordings([tmp_path / "bag"], match, scene)
    found = [command.handles["base"].rotation for command in recording.schedule.commands]
    np.testing.assert_allclose(found, angles[:, None] * [0.0, 1.0, 0.0], atol=1e-12)


@pytest.mark.parametrize("epoch", [0, START])
def test_a_bag_is_read_up_to_a_restart(epoch: int, tmp_path: Path) -> None:
    """A bag is read up to a reset of the simulator's clock, with a remark; a message 50 ms late is sorted in.

    The first stamp, 0, is a time also if the recorder's clock is another one.
    """
    messages = [
        _messages(stamp - START, 0.02, np.full(3, float(number)), np.zeros((1, 3)))
        for number, stamp in enumerate([0.0, 0.3, 0.25, 0.5, 0.0, 0.3, 0.6, 0.9])
    ]
    _write(tmp_path / "bag", messages, epoch)
    match = tmp_path / "match.yaml"
    match.write_text("compare: {seen: {probe: tip, topic: /pose}}\ncommands: {pull: {topic: /cmd, joint: motor}}\n")
    (recording,) = read_recordings([tmp_path / "bag"], match, scene_from_text(PULLED))
    np.testing.assert_allclose(recording.series[0].times, [0.0, 0.25, 0.3, 0.5], atol=1e-6)
    np.testing.assert_allclose(recording.series[0].values[:, 0], [0.0, 2.0, 1.0, 3.0])
    np.testing.assert_allclose(recording.schedule.times, recording.series[0].times)
    (remark,) = recording.remarks
    assert remark.startswith("read only up to t = 0.5 s, where the stamps of topic /pose go back by 0.5 s")


@pytest.mark.parametrize(
    ("compare", "command", "message"),
    [
        ("{probe: tip, topic: /tf, frame_id: top}", "{topic: /cmd, joint: motor}", "never has 'top'; it has base, tip"),
        ("{probe: tip, topic: /pose}", "{topic: /cmd, joint: moter}", "topic /cmd never has 'moter'; it has motor"),
        ("{probe: tip, topic: /pose}", "{topic: /cmd, joint: motor, field: position}", "has no position of motor"),
        ("{cloud: vertices, topic: /points}", "{topic: /cmd, joint: motor}", "remedy: cloud: surface"),
        ("{cloud: surface, topic: /pose}", "{topic: /cmd, joint: motor}", "a PointCloud2 is needed"),
        ("{probe: tip, topic: /height}", "{topic: /cmd, joint: motor}", "has one number a message; along what?"),
    ],
)
def test_what_a_topic_does_not_have(
    compare: str, command: str, message: str, robot_bag: Path, write_scene: Callable, tmp_path: Path, capsys: Any
) -> None:
    """A frame, joint, field or kind that a topic lacks is refused with what the topic has."""
    match = tmp_path / "match.yaml"
    match.write_text(f"compare: {{seen: {compare}}}\ncommands: {{pull: {command}}}\n")
    given = ["--match", str(match), "--vary", f"{YOUNG}=5e4..8e5", "--workers", "1"]
    assert main(["fit", write_scene(), str(robot_bag), *given]) == 2
    assert message in capsys.readouterr().err


@pytest.mark.exact("the processes that it starts shift nothing")
def test_workers_find_what_one_process_finds(robot_bag: Path, tmp_path: Path, kill_one: Callable) -> None:
    """Two worker processes, one of which is killed, give the same trajectories to the last bit as this process."""
    match = tmp_path / "match.yaml"
    match.write_text("compare: {seen: {probe: tip, topic: /pose}}\ncommands: {pull: {topic: /cmd, joint: motor}}\n")
    recordings = read_recordings([robot_bag], match, scene_from_text(PULLED))
    tasks = [({YOUNG: value}, recordings[0], np.inf) for value in (2e6, 4e6)]
    found = []
    with connect(None, 2) as workers:
        for client in (None, workers):
            if client is not None:
                kill_one(client)
            found.append([trajectory.outputs[0] for trajectory in Simulations(PULLED, client).run(tasks)])
    for alone, shared in zip(*found, strict=True):
        np.testing.assert_array_equal(alone, shared)
