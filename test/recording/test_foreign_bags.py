# SPDX-License-Identifier: Apache-2.0
"""Bags of other recorders: SQLite, compressed, split, ROS 1; messages of any type by a path."""

from __future__ import annotations

import shutil
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from gdfe_ros import Command, Simulation
from gdfe_ros.cli import BAD_INPUT, main
from gdfe_ros.errors import GdfeError, RecordingError
from gdfe_ros.fitting.bag_topics import TopicValues
from gdfe_ros.fitting.match import CompareModel
from gdfe_ros.recording.bag_info import TopicInfo
from gdfe_ros.recording.decoding import array_decoder
from gdfe_ros.recording.foreign_bag import ForeignBag, open_bag
from gdfe_ros.recording.reader import BagReader
from gdfe_ros.scene import scene_from_text

SCENE = """
name: beam
mesh: {bar: {size: [0.10, 0.02, 0.02], cells: [10, 2, 2]}}
materials: {silicone: {law: neo_hookean, young: 3.0e5, poisson: 0.45, density: 1070}}
regions: [{material: silicone}]
handles: {base: {where: {face: x-}, fixed: true}}
actuators: {tendon: {cable: {points: [[0.0, 0.0, 0.008], [0.098, 0.0, 0.008]], range: [0.0, 10.0]}}}
probes: {tip: [0.10, 0.0, 0.0]}
"""
MATCH = """
compare:
  tip: {probe: tip, topic: /mocap/finger}
commands:
  tendon: {topic: /motors/command, joint: motor1, field: effort, unit: N}
"""
START = 1_700_000_000_000_000_000
SQLITE, MCAP = StoragePlugin.SQLITE3, StoragePlugin.MCAP
FILE, MESSAGE = CompressionMode.FILE, CompressionMode.MESSAGE
MODERN, OLD, NOETIC = Stores.ROS2_JAZZY, Stores.ROS2_FOXY, Stores.ROS1_NOETIC
DEFINITIONS = {
    "mocap4r2_msgs/msg/RigidBody": "string rigid_body_name\ngeometry_msgs/Pose pose\n",
    "mocap4r2_msgs/msg/RigidBodies": "std_msgs/Header header\nuint32 frame_number\n"
    "mocap4r2_msgs/RigidBody[] rigid_bodies\n",
    "tf2_msgs/msg/TFMessage": "geometry_msgs/TransformStamped[] transforms\n",
    "robot_msgs/msg/State": "float64[3] tip\nfloat32 force\nfloat64[] pressures\n",
}  # fmt: skip


@pytest.fixture(scope="module")
def rows() -> list[tuple[int, float, np.ndarray]]:
    """Return times [ns], forces [N] and tip positions (3,) [m] of a beam that a tendon bends."""
    simulation = Simulation(scene_from_text(SCENE))
    found = []
    for k, force in enumerate(np.linspace(0.0, 2.0, 9)):
        simulation.step(Command(actuators={"tendon": float(force)}))
        found.append((START + k * 100_000_000, float(force), np.array(simulation.probe_positions()["tip"])))
    return found


class Maker:
    """Maker of messages of a typestore."""

    def __init__(self, store: Stores) -> None:
        self.store = get_typestore(store)
        self._one = store is NOETIC
        for name, text in DEFINITIONS.items():
            if name in self.store.types:
                continue
            self.store.register(get_types_from_msg(text, name))

    def __call__(self, kind: str, *values: Any, **named: Any) -> Any:
        """Return a message."""
        return self.store.types[kind](*values, **named)

    def header(self, time: int, frame: str = "world") -> Any:
        """Return a header with a time [ns]."""
        stamp = self("builtin_interfaces/msg/Time", sec=time // 10**9, nanosec=time % 10**9)
        sequence = {"seq": 0} if self._one else {}
        return self("std_msgs/msg/Header", **sequence, stamp=stamp, frame_id=frame)

    def pose(self, place: np.ndarray) -> Any:
        """Return an upright pose at a place [m]."""
        point = self("geometry_msgs/msg/Point", *map(float, place))
        return self("geometry_msgs/msg/Pose", point, self("geometry_msgs/msg/Quaternion", 0.0, 0.0, 0.0, 1.0))

    def recording(self, rows: list) -> Iterator[tuple[str, Any, int]]:
        """Yield the messages of the robot."""
        for time, force, place in rows:
            state = {"name": ["motor1"], "position": np.zeros(0), "velocity": np.zeros(0), "effort": np.array([force])}
            yield "/motors/command", self("sensor_msgs/msg/JointState", header=self.header(time, ""), **state), time
            stamped = self("geometry_msgs/msg/PoseStamped", self.header(time), self.pose(place))
            yield "/mocap/finger", stamped, time + 50_000_000


def write(
    path: Path, messages: Any, maker: Maker, *, storage: StoragePlugin | None, mode: Any = None, version: int = 9
) -> Path:
    """Write a bag by rosbags; without a storage, a ROS 1 bag. Return its path."""
    if storage is None:
        writer = Writer1(path)
        if mode is not None:
            writer.set_compression(mode)
        with writer as bag:
            _fill(bag, messages, maker, maker.store.serialize_ros1)
        return path
    writer = Writer2(path, version=version, storage_plugin=storage)
    if mode is not None:
        writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer as bag:
        _fill(bag, messages, maker, maker.store.serialize_cdr)
    return path


def _fill(bag: Any, messages: Any, maker: Maker, serialise: Any) -> None:
    connections: dict[str, Any] = {}
    for topic, message, time in messages:
        if topic not in connections:
            connections[topic] = bag.add_connection(topic, message.__msgtype__, typestore=maker.store)
        bag.write(connections[topic], time, serialise(message, message.__msgtype__))


KINDS = {
    "MCAP": (MODERN, MCAP, None, 9),
    "MCAP, files compressed": (MODERN, MCAP, FILE, 9),
    "MCAP, messages compressed": (MODERN, MCAP, MESSAGE, 9),
    "SQLite": (MODERN, SQLITE, None, 9),
    "SQLite, files compressed": (MODERN, SQLITE, FILE, 9),
    "SQLite, messages compressed": (MODERN, SQLITE, MESSAGE, 9),
    "SQLite of Foxy": (OLD, SQLITE, None, 8),
    "ROS 1": (NOETIC, None, None, 0),
    "ROS 1, bz2": (NOETIC, None, Writer1.CompressionFormat.BZ2, 0),
    "ROS 1, lz4": (NOETIC, None, Writer1.CompressionFormat.LZ4, 0),
}


def make(folder: Path, rows: list, kind: str) -> Path:
    """Write the robot's recording as a bag of a kind; return its path."""
    store, storage, mode, version = KINDS[kind]
    maker = Maker(store)
    path = folder / ("bag.bag" if storage is None else "bag")
    return write(path, maker.recording(rows), maker, storage=storage, mode=mode, version=version)


def bare(folder: Path, rows: list, kind: str) -> Path:
    """Return the only file of a bag, without its directory, under a name without a suffix."""
    return Path(shutil.move(stored(make(folder, rows, kind)), folder / "recorded"))


def stored(path: Path) -> Path:
    """Return the only file of a bag."""
    return path if path.is_file() else next(each for each in path.iterdir() if each.suffix != ".yaml")


def split(folder: Path, rows: list, storage: StoragePlugin) -> Path:
    """Write a bag of three files, as `ros2 bag record -d` does; return its directory."""
    maker, whole = Maker(MODERN), folder / "split"
    whole.mkdir()
    names, info = [], {}
    for k in range(3):
        part = write(folder / f"part_{k}", maker.recording(rows[3 * k : 3 * k + 3]), maker, storage=storage)
        (file,) = [each for each in part.iterdir() if each.suffix != ".yaml"]
        names.append(f"split_{k}{file.suffix}")
        shutil.copy(file, whole / names[-1])
        own = yaml.safe_load((part / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
        info = info or own
        for mine, other in zip(info["topics_with_message_count"], own["topics_with_message_count"], strict=True):
            mine["message_count"] += other["message_count"] if k else 0
    info |= {"relative_file_paths": names, "files": []}
    (whole / "metadata.yaml").write_text(yaml.safe_dump({"rosbag2_bagfile_information": info}))
    return whole


def tips(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Return times (m,) [s] and positions (m, 3) [m] of the topic of poses."""
    return TopicValues(open_bag(path)).of(CompareModel(probe="tip", topic="/mocap/finger"), "here")


@pytest.mark.parametrize("kind", list(KINDS))
def test_each_kind_has_the_same_messages(tmp_path: Path, rows: list, kind: str) -> None:
    """Times and positions are those that were written, from each kind of bag."""
    times, places = tips(make(tmp_path, rows, kind))
    np.testing.assert_allclose(times, [1e-9 * time for time, _, _ in rows], rtol=0, atol=1e-6)
    np.testing.assert_array_equal(places, [place for _, _, place in rows])


@pytest.mark.parametrize("kind", list(KINDS))
def test_bare_files_are_known_by_their_bytes(tmp_path: Path, rows: list, kind: str) -> None:
    """A file without its directory, and without a suffix, is read."""
    np.testing.assert_array_equal(tips(bare(tmp_path, rows, kind))[1], [place for _, _, place in rows])


@pytest.mark.parametrize("storage", [SQLITE, MCAP])
@pytest.mark.parametrize("described", [True, False])
def test_split_bags(tmp_path: Path, rows: list, storage: StoragePlugin, described: bool) -> None:
    """A bag of three files has the messages of all; SQLite files need no metadata.yaml."""
    path = split(tmp_path, rows, storage)
    if not described:
        (path / "metadata.yaml").unlink()
    if not described and storage is MCAP:
        with pytest.raises(RecordingError, match=r"its recording was cut off\. Repair it: gdfe recover"):
            open_bag(path)
        return
    np.testing.assert_array_equal(tips(path)[1], [place for _, _, place in rows])


@pytest.mark.parametrize("kind", ["SQLite, files compressed", "SQLite of Foxy", "ROS 1"])
def test_a_modulus_is_fitted_from_each(tmp_path: Path, rows: list, kind: str, capsys: Any) -> None:
    """300 000 Pa are fitted within 0.1 % from a recording with this modulus."""
    (tmp_path / "scene.yaml").write_text(SCENE)
    (tmp_path / "match.yaml").write_text(MATCH)
    given = [
        "fit",
        str(tmp_path / "scene.yaml"),
        str(make(tmp_path, rows, kind)),
        "--match",
        str(tmp_path / "match.yaml"),
    ]
    more = ["--vary", "materials.silicone.young=1e5..2e5..1e6", "--out", str(tmp_path / "out"), "--workers", "1"]
    assert main([*given, *more]) == 0
    found = yaml.safe_load((tmp_path / "out" / "scene.yaml").read_text())["materials"]["silicone"]["young"]
    assert found == pytest.approx(3e5, rel=1e-3)


def typed(maker: Maker, time: int, place: np.ndarray) -> dict[str, Any]:
    """Return messages of many types with a place [m], by topic."""
    head, pose = maker.header(time), maker.pose(place)
    far = maker.pose(place + 1.0)
    vector = maker("geometry_msgs/msg/Vector3", *map(float, place))
    none = maker("geometry_msgs/msg/Vector3", 0.0, 0.0, 0.0)
    turn = maker("geometry_msgs/msg/Quaternion", 0.0, 0.0, 0.0, 1.0)
    moved = maker("geometry_msgs/msg/Transform", vector, turn)
    covered = maker("geometry_msgs/msg/PoseWithCovariance", pose, np.zeros(36))
    twist = maker("geometry_msgs/msg/TwistWithCovariance", maker("geometry_msgs/msg/Twist", none, none), np.zeros(36))
    placed = maker("geometry_msgs/msg/TransformStamped", head, "tip", moved)
    bodies = [maker("mocap4r2_msgs/msg/RigidBody", name, each) for name, each in (("base", far), ("tip", pose))]
    return {
        "/pose": pose,
        "/stamped": maker("geometry_msgs/msg/PoseStamped", head, pose),
        "/covered": maker("geometry_msgs/msg/PoseWithCovarianceStamped", head, covered),
        "/odometry": maker("nav_msgs/msg/Odometry", head, "tip", covered, twist),
        "/poses": maker("geometry_msgs/msg/PoseArray", head, [pose]),
        "/many": maker("geometry_msgs/msg/PoseArray", head, [far, pose]),
        "/point": pose.position,
        "/vector": maker("geometry_msgs/msg/Vector3Stamped", head, vector),
        "/transform": placed,
        "/tf": maker("tf2_msgs/msg/TFMessage", [placed]),
        "/wrench": maker("geometry_msgs/msg/WrenchStamped", head, maker("geometry_msgs/msg/Wrench", vector, none)),
        "/mocap": maker("mocap4r2_msgs/msg/RigidBodies", head, 7, bodies),
        "/state": maker("robot_msgs/msg/State", place, float(place[0]), place),
    }


TYPED = [
    ("/pose", None), ("/stamped", None), ("/covered", None), ("/odometry", None), ("/poses", None), ("/point", None),
    ("/vector", None), ("/transform", None), ("/tf", None), ("/wrench", None), ("/many", "poses[1]"),
    ("/many", "poses[-1].position"), ("/mocap", "rigid_bodies[1].pose.position"), ("/mocap", "rigid_bodies[1].pose"),
    ("/mocap", "rigid_bodies[rigid_body_name=tip].pose"), ("/state", "tip"), ("/odometry", "pose.pose.position"),
]  # fmt: skip


@pytest.fixture(scope="module")
def several(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Write messages of many types into a bag of each kind; return the paths."""
    folder, found = tmp_path_factory.mktemp("typed"), {}
    for name, (store, storage) in {
        "sqlite": (MODERN, SQLITE),
        "mcap": (MODERN, MCAP),
        "one.bag": (NOETIC, None),
    }.items():
        maker = Maker(store)
        rows = [(START + k * 10**9, np.array([0.1 * k, 0.2, -0.3])) for k in range(4)]
        messages = [
            (topic, message, time) for time, place in rows for topic, message in typed(maker, time, place).items()
        ]
        found[name] = write(folder / name, messages, maker, storage=storage)
    return found


@pytest.mark.parametrize("name", ["sqlite", "mcap", "one.bag"])
@pytest.mark.parametrize(("topic", "path"), TYPED)
def test_places_in_messages_of_many_types(several: dict[str, Path], name: str, topic: str, path: str | None) -> None:
    """The place is found in each type, with the definitions of the bag, in ROS 1 and in ROS 2."""
    model = CompareModel(probe="tip", topic=topic, path=path)
    times, places = TopicValues(open_bag(several[name])).of(model, "here")
    np.testing.assert_allclose(places, [[0.1 * k, 0.2, -0.3] for k in range(4)], atol=1e-15)
    np.testing.assert_allclose(times - 1e-9 * START, np.arange(4), atol=1e-5)


@pytest.mark.parametrize(("path", "expected"), [("force", 0.3), ("tip[0]", 0.3), ("pressures[1]", 0.2)])
def test_numbers_by_a_path(several: dict[str, Path], path: str, expected: float) -> None:
    """A path leads to a number of any type."""
    _, found = TopicValues(open_bag(several["sqlite"])).of(CompareModel(force="x", topic="/state", path=path), "here")
    assert found[-1] == pytest.approx([expected], rel=1e-6)


@pytest.mark.parametrize(
    ("topic", "path", "told"),
    [
        ("/mocap", None, "has the type mocap4r2_msgs/msg/RigidBodies; known: .*remedy: `path`"),
        ("/mocap", "rigid_body[0]", "no field 'rigid_body'; did you mean 'rigid_bodies'"),
        ("/mocap", "rigid_bodies[5].pose", "never has 'rigid_bodies"),
        ("/mocap", "rigid_bodies[rigid_body_name=hand]", "never has 'rigid_bodies"),
        ("/mocap", "rigid_bodies.pose", "there is no field 'pose'; fields: none"),
        ("/mocap", "header[0]", "belongs to a sequence"),
        ("/mocap", "rigid_bodies[x]", "is no field, \\[index\\] or \\[field=text\\]"),
        ("/mocap", "rigid_bodies[0].rigid_body_name", "leads to str; remedy: a path to a number"),
        ("/many", None, "has 2 poses a message; remedy: `path: poses\\[0\\]`"),
    ],
)
def test_wrong_paths_are_explained(several: dict[str, Path], topic: str, path: str | None, told: str) -> None:
    """A wrong path is refused with the fields that there are."""
    with pytest.raises(GdfeError, match=told):
        TopicValues(open_bag(several["sqlite"])).of(CompareModel(probe="tip", topic=topic, path=path), "here")


@pytest.mark.parametrize("keep", [0.3, 0.7])
@pytest.mark.parametrize("kind", [kind for kind in KINDS if "MCAP" not in kind])
def test_recover_is_suggested_only_for_mcap(tmp_path: Path, rows: list, kind: str, keep: float) -> None:
    """A bag of another kind that is cut off is refused by its kind, with a remedy for it, without a Python error."""
    path = make(tmp_path, rows * 20, kind)
    file = stored(path)
    content = file.read_bytes()
    file.write_bytes(content[: int(keep * len(content))])
    with pytest.raises(RecordingError) as error:
        tips(path)
    text = str(error.value)
    assert "remedy" in text
    assert "gdfe recover" not in text
    assert "Error" not in text


@pytest.mark.parametrize("command", [["replay"], ["report"], ["recover"]])
@pytest.mark.parametrize("kind", ["SQLite", "SQLite, files compressed", "ROS 1"])
def test_commands_for_own_bags_name_the_kind(
    tmp_path: Path, rows: list, kind: str, command: list[str], capsys: Any
) -> None:
    """Commands that need a bag of this package say which kind the given one is, and what reads it."""
    path = make(tmp_path, rows, kind)
    assert main([*command, str(path)]) == BAD_INPUT
    told = capsys.readouterr().err
    assert "remedy: `gdfe fit` reads it" in told
    assert "Repair" not in told


def test_a_type_without_definition_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rows: list) -> None:
    """A type that neither the bag nor ROS 2 defines is refused with a remedy."""
    bag = ForeignBag(make(tmp_path, rows, "SQLite"))
    with pytest.raises(RecordingError, match="has no definition of my_msgs/msg/X; remedy: record it again"):
        bag.decoder()("my_msgs/msg/X", b"")
    assert isinstance(open_bag(make(tmp_path / "other", rows, "MCAP")), BagReader)
    assert bag.run is None


def test_definitions_of_idl_files_are_read() -> None:
    """A definition made of IDL files, as MCAP bags of types without .msg files have it, is decoded."""
    rule, kind = "=" * 80 + "\n", "robot_msgs/msg/Force"
    text = f"{rule}IDL: {kind}\nmodule robot_msgs {{ module msg {{ struct Force {{ double newton; }}; }}; }};\n"
    decode = array_decoder([TopicInfo(name="/force", type=kind, definition=text)])
    assert decode(kind, b"\0\1\0\0" + struct.pack("<d", 2.5)).newton == 2.5
