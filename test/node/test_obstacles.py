# SPDX-License-Identifier: Apache-2.0
"""Obstacles and rigid bodies of a node: commanded, following, published, recorded and replayed."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from geometry_msgs.msg import PoseStamped, TwistStamped, WrenchStamped
from rclpy.qos import DurabilityPolicy, QoSProfile
from scipy.spatial.transform import Rotation
from std_msgs.msg import Header, String

from gdfe_ros.analysis.bag_run import BagRun
from gdfe_ros.cli import main
from gdfe_ros.constraints import Pose
from gdfe_ros.errors import CommandError
from gdfe_ros.node.messages import pose_stamped
from gdfe_ros.results.contacts import contact_names
from gdfe_ros.simulation import Command
from gdfe_ros.testing import Simulator
from test.node.conftest import Tree, vector

_QOS = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
CUBE = """
name: cube
description: A cube held at its top, above a ball and beside a wall.
mesh: {bar: {size: [0.1, 0.1, 0.1], cells: [4, 4, 4]}}
materials: {soft: {law: neo_hookean, young: 2.0e5, poisson: 0.4, density: 1000}}
regions: [{material: soft}]
handles: {top: {where: {face: z+}, fixed: true}}
obstacles:
  ball: {sphere: {radius: 0.04}, at: [0.05, 0, -0.1], rotation_deg: [0, 0, 30], friction: 0.5}
  wall: {plane: [-1, 0, 0], at: [0.2, 0, 0], fixed: true}
sensors:
  pad: {where: {box: {x: [0.0, 0.05], z: [-.inf, -0.049]}}}
  rest: {where: {box: {x: [0.06, 0.1], z: [-.inf, -0.049]}}}
program:
  duration: 0.03
  obstacles: {ball: [{time: 0.0}, {time: 0.03, translation: [0, 0, 0.015], rotation_deg: [0, 10, 0]}]}
"""
LIFT = 0.015
"""Displacement of the ball [m] at which it is 5 mm inside the cube."""


@pytest.fixture
def cube(tmp_path: Path) -> str:
    """Return the path of a scene with a cube above a ball."""
    path = tmp_path / "cube.yaml"
    path.write_text(CUBE)
    return str(path)


def _pose(frame: str = "", *, z: float = LIFT, turn: tuple[float, float, float] = (0, 0, 0)) -> PoseStamped:
    return pose_stamped(Header(frame_id=frame), Pose((0.0, 0.0, z), turn))


def test_an_obstacle_is_commanded_as_a_handle_is(client: Any, start: Callable, cube: str) -> None:
    """A ball pressed into the cube by a target and drawn back by a velocity has the right pose, wrench and frames."""
    poses = client.listen("obstacles/ball/pose", PoseStamped)
    wrenches = client.listen("obstacles/ball/wrench", WrenchStamped)
    start(scene=cube, clock="lockstep", dt=0.01, velocity_timeout=0.03, frame_id="left/base_link")
    client.publish("obstacles/ball/target", _pose("left/ball_rest", turn=(0.0, 0.2, 0.0)))
    client.wait(lambda: len(poses) == 2 == len(wrenches))
    assert (poses[-1].pose.position.z, poses[-1].pose.orientation.y) == (LIFT, pytest.approx(np.sin(0.1)))
    assert (poses[-1].header.frame_id, wrenches[-1].header.frame_id) == ("left/ball_rest", "left/ball_centre")
    assert wrenches[-1].wrench.force.z > 1.0
    assert wrenches[0].wrench.force.z == 0.0
    moment = wrenches[-1].wrench.torque
    force = wrenches[-1].wrench.force
    assert np.linalg.norm([moment.x, moment.y, moment.z]) < 0.04 * np.linalg.norm([force.x, force.y, force.z])
    names = {name for name, _ in client.node.get_topic_names_and_types()}
    assert {name.rsplit("/", 1)[1] for name in names if "obstacles/wall" in name} == {
        "target",
        "velocity",
        "pose",
        "wrench",
    }
    assert not any("handles/ball" in name for name in names)
    twist = TwistStamped()
    twist.twist.linear.z = -0.5
    client.publish("obstacles/ball/velocity", twist)
    client.wait(lambda: len(poses) == 3)
    client.advance(4)  # the velocity is in force for three steps
    client.wait(lambda: len(poses) == 7)
    heights = [message.pose.position.z for message in poses[2:]]
    np.testing.assert_allclose(heights, [0.010, 0.005, 0.0, 0.0, 0.0], atol=1e-9)
    assert wrenches[-1].wrench.force.z == 0.0


def test_wrong_commands_to_obstacles_are_refused(client: Any, start: Callable, cube: str) -> None:
    """Commands to a fixed or unknown obstacle, in the wrong section or in another frame are refused with a remedy."""
    process = start(scene=cube, clock="lockstep")
    client.publish("obstacles/wall/target", _pose())
    client.wait(lambda: client.diagnostics().get("refused: handle is fixed") == "1")
    remedy = "obstacle 'wall' is fixed in the scene and takes no commands; remedy: put obstacles.wall.fixed=false"
    assert remedy in process.log
    client.publish("obstacles/ball/target", _pose("ball"))
    client.wait(lambda: "header.frame_id is 'ball'; allowed: empty, 'base_link' or 'ball_rest'" in process.log)
    for topic in ("obstacles/bal/target", "handles/ball/velocity", "obstacles/top/target"):
        kind = TwistStamped if topic.endswith("velocity") else PoseStamped
        client.node.create_publisher(kind, client.full(topic), 10)
    client.wait(lambda: client.diagnostics().get("refused: unknown name") == "3")
    assert "no 'bal' among its obstacles; did you mean 'ball'? obstacles: ball, wall" in process.log
    assert "no 'ball' among its handles; its topics are ~/obstacles/ball/...; handles: top" in process.log
    assert "no 'top' among its obstacles; its topics are ~/handles/top/...; obstacles: ball, wall" in process.log
    assert len(client.records()) == 1


def test_an_obstacle_has_frames_and_follows_one(client: Any, start: Callable, tree: Tree, cube: str) -> None:
    """An obstacle has frames on TF and follows a frame, also after a reset."""
    heard, poses = tree.heard, client.listen("obstacles/ball/pose", PoseStamped)
    process = start(scene=cube, follow=["ball=frame:tool0"])
    client.wait(lambda: "ball_rest" in heard and "ball" in heard)
    assert {"ball", "ball_rest", "ball_centre", "wall", "wall_rest", "wall_centre", "top", "pad_sensor"} <= set(heard)
    np.testing.assert_allclose(_origin(heard["pad_sensor"]), [0.025, 0.0, -0.05], atol=1e-9)
    assert _origin(heard["ball_rest"]) == [0.05, 0.0, -0.1]
    client.wait(lambda: client.node.count_subscribers("/tf") >= 2)
    tree.tell("base_link", "tool0", [0.05, 0.0, -0.1 + LIFT], turn=Rotation.from_rotvec([0.0, 0.2, 0.0]))
    client.wait(lambda: poses and poses[-1].pose.position.z == pytest.approx(LIFT))
    client.wait(lambda: _origin(heard["ball"])[2] == pytest.approx(LIFT - 0.1))
    assert heard["ball"].transform.rotation.y == pytest.approx(np.sin(0.1))
    assert heard["ball_centre"].transform.rotation.y == 0.0
    assert heard["wall"].transform.rotation.w == 1.0
    client.publish("obstacles/ball/target", _pose())
    client.wait(lambda: client.diagnostics().get("refused: handle follows") == "1")
    assert "obstacle 'ball' follows frame tool0 and takes no commands" in process.log
    count = len(poses)
    client.trigger("reset")
    client.wait(lambda: len(poses) > count + 1 and poses[-1].pose.position.z == pytest.approx(LIFT))


def test_a_target_in_the_frame_of_an_obstacle_is_beside_it(
    client: Any, start: Callable, interfaces: Callable, cube: str
) -> None:
    """A target in the moved ball's own frame is relative to the ball."""
    interfaces("tf2_msgs")
    poses = client.listen("obstacles/ball/pose", PoseStamped)
    start(scene=cube, clock="lockstep")
    for count, frame in ((2, ""), (3, "ball_centre"), (4, "ball")):
        client.publish("obstacles/ball/target", _pose(frame, z=0.004))
        client.wait(lambda count=count: len(poses) == count)
    np.testing.assert_allclose([message.pose.position.z for message in poses], [0, 0.004, 0.008, 0.012], atol=1e-12)


def test_every_point_that_touches_is_told(ros: Any, cube: str, tmp_path: Path) -> None:
    """Contact points and forces of an obliquely pressed ball sum to its wrench, and the sensors divide it."""
    names = []
    with Simulator(cube, bag=tmp_path / "bag") as simulator:
        ros.node("listener").create_subscription(String, f"{simulator.name}/contact_names", names.append, _QOS)
        assert not len(simulator.state.contacts)
        state = simulator.step(Command(handles={"ball": Pose((0.004, 0.0, 1.5 * LIFT), (0.0, 0.1, 0.0))}))
        ros.wait(lambda: names)
    assert json.loads(names[0].data) == ["ball", "wall"]
    points, middle = state.contacts, np.array([0.054, 0.0, 1.5 * LIFT - 0.1])
    assert len(points) >= 2
    assert set(points["contact"]) == {0}
    places, normals = _vectors(points, "xyz"), _vectors(points, ("nx", "ny", "nz"))
    forces = _vectors(points, ("fx", "fy", "fz")) + _vectors(points, ("tx", "ty", "tz"))
    assert np.abs(_vectors(points, ("tx", "ty", "tz"))).max() > 0.01
    np.testing.assert_allclose(places, state.positions[points["vertex"]])
    arms = places - middle
    np.testing.assert_allclose(normals, arms / np.linalg.norm(arms, axis=1)[:, None], atol=1e-5)
    np.testing.assert_allclose(points["gap"], np.linalg.norm(arms, axis=1) - 0.04, atol=1e-7)
    wrench = np.concatenate([forces.sum(axis=0), np.cross(arms, forces).sum(axis=0)])
    np.testing.assert_allclose(state.wrenches["ball"], wrench, atol=1e-5 * np.linalg.norm(wrench))
    rest = simulator.scene.mesh.vertices
    mine = rest[points["vertex"], 0] < 0.051
    centre = state.positions[(rest[:, 0] < 0.051) & (rest[:, 2] < -0.049)].mean(axis=0)
    felt = [forces[mine].sum(axis=0), np.cross(places - centre, forces)[mine].sum(axis=0)]
    np.testing.assert_allclose(state.sensors["pad"], np.concatenate(felt), atol=1e-4)
    np.testing.assert_allclose(
        state.sensors["pad"][:3] + state.sensors["rest"][:3], state.wrenches["ball"][:3], atol=1e-9
    )


def test_runs_with_obstacles_are_replayed_to_the_bit(tmp_path: Path, cube: str, capsys: Any, replays: Callable) -> None:
    """A run with a turning, pressed ball is replayed with and without a node, reported, exported and played."""
    bag = tmp_path / "bag"
    with Simulator(cube, bag=bag) as simulator:
        for share in (0.7, 1.0):
            state = simulator.step(Command(handles={"ball": Pose((0, 0, share * LIFT), (0.1, 0.3 * share, 0))}))
            assert state.poses["ball"].translation == (0.0, 0.0, share * LIFT)
    assert state.wrenches["ball"][2] > 1.0
    assert not state.wrenches["wall"].any()
    compared = {("obstacles/ball/wrench", "wrench.force.z"), ("sensors/pad/wrench", "wrench.torque.y")}
    assert compared | {("contacts", "fz"), ("contacts", "vertex")} <= replays(bag, node=True)
    assert main(["replay", str(bag)]) == 0
    assert main(["report", str(bag), "--out", str(tmp_path / "report.html")]) == 0
    page = (tmp_path / "report.html").read_text()
    for text in ("Position of ball, from rest", "ball, wall (fixed)", "found z", "Forces on contact sensors"):
        assert text in page
    assert main(["export", str(bag), "--to", "csv", "--out", str(tmp_path / "run.csv")]) == 0
    first, *_, last = (tmp_path / "run.csv").read_text().splitlines()
    row = dict(zip(first.split(","), last.split(","), strict=True))
    assert float(row["obstacles/ball/wrench.wrench.force.z [N in ball_centre]"]) == state.wrenches["ball"][2]
    assert float(row["contacts.points"]) == len(state.contacts) > 0
    assert main(["export", str(bag), "--to", "npz", "--out", str(tmp_path / "run.npz")]) == 0
    arrays = np.load(tmp_path / "run.npz")
    assert np.array_equal(arrays["contacts/fz"][arrays["contacts/row"] == 2], state.contacts["fz"])
    assert main(["demo", cube, "--out", str(tmp_path / "demo")]) == 0
    said = capsys.readouterr().out
    for text in ("ball: force", "sensor pad: force"):
        assert text in said


def test_a_bag_replays_without_the_file_of_an_obstacle(tmp_path: Path, cube: str, replays: Callable) -> None:
    """A bag with a ball of triangles replays without the files of the ball and the scene."""
    trimesh.creation.icosphere(subdivisions=3, radius=40.0).export(tmp_path / "ball.stl")
    scene, bag = Path(cube), tmp_path / "bag"
    scene.write_text(CUBE.replace("{sphere: {radius: 0.04}", "{mesh: {file: ball.stl, scale: 0.001}"))
    with Simulator(scene, bag=bag) as simulator:
        state = simulator.step(Command(handles={"ball": Pose((0.0, 0.0, LIFT), (0.0, 0.1, 0.0))}))
    assert state.poses["ball"].translation == (0.0, 0.0, LIFT)
    assert state.wrenches["ball"][2] > 1.0
    scene.unlink()
    (tmp_path / "ball.stl").unlink()
    replays(bag)


def test_states_with_obstacles_are_saved_and_loaded(client: Any, start: Callable, cube: str, tmp_path: Path) -> None:
    """A state saved in contact and loaded later has the same next step."""
    start(scene=cube, clock="lockstep", state_path=str(tmp_path / "state"))
    client.publish("obstacles/ball/target", _pose(turn=(0.0, 0.1, 0.0)))
    client.wait_steps(2)
    client.trigger("save_state")
    meshes = []
    for _ in range(2):
        count = len(client.received["mesh"])
        client.publish("obstacles/ball/target", _pose(z=1.2 * LIFT, turn=(0.0, 0.3, 0.0)))
        client.wait(lambda count=count: len(client.received["mesh"]) > count)
        meshes.append(client.mesh())
        client.trigger("load_state")
        client.wait(lambda count=count: len(client.received["mesh"]) > count + 1)
    assert np.array_equal(*meshes)
    assert np.abs(meshes[0][:, 3:]).max() > 1e-3


def test_a_scene_has_obstacles_and_bodies_but_no_handles(tmp_path: Path, slab: Path, replays: Callable) -> None:
    """A slab on a table with a box on it carries the weights and replays; a free box takes no command."""
    bag = tmp_path / "bag"
    with Simulator(slab, bag=bag, parameters={"dt": 0.02}) as simulator:
        states = [simulator.step(Command(handles={"table": Pose((0.0, 0.0, 1e-5 * k))})) for k in range(25)]
        with pytest.raises(CommandError, match="body 'part' moves freely and follows no target"):
            simulator.step(Command(handles={"part": Pose()}))
    assert contact_names(simulator.scene.handles) == ["table", "part", "part on table"]
    weight = 9.81 * 1500 * 0.04 * 0.03 * 0.02
    own = 9.81 * 1000 * 0.1 * 0.1 * 0.04
    carried = np.mean([state.wrenches["table"][2] for state in states[15:]])
    assert carried == pytest.approx(own + weight, rel=0.05)
    assert np.mean([state.wrenches["part"][2] for state in states[15:]]) == pytest.approx(-weight, rel=0.05)
    assert set(states[-1].contacts["contact"]) == {0, 1}
    assert -0.002 < states[-1].poses["part"].translation[2] < 0.0
    replays(bag, node=True)


def test_a_rigid_body_is_put_by_topic(slab: Path, client: Any, start: Callable) -> None:
    """A box is put beside the slab in two frames; unknown names, invalid numbers and far places are refused by name."""
    poses = client.listen("bodies/part/pose", PoseStamped)
    process = start(scene=str(slab), clock="lockstep", frame_id="left/base_link")
    for count, (frame, z) in enumerate((("", 0.3), ("left/part_rest", 0.2)), start=2):
        client.publish("bodies/part/set", _pose(frame, z=z, turn=(0.0, 0.0, 0.1)))
        client.wait(lambda count=count: len(poses) == count)
        assert poses[-1].pose.position.z == pytest.approx(z, abs=2e-3)
        assert poses[-1].pose.orientation.z == pytest.approx(np.sin(0.05), abs=1e-6)
    client.publish("bodies/part/set", _pose(z=20.0))
    client.wait(lambda: "20 m from rest; allowed:" in process.log)
    client.publish("bodies/part/set", _pose("elsewhere"))
    client.wait(lambda: "header.frame_id is 'elsewhere'" in process.log)
    for topic in ("bodies/prt/set", "bodies/table/set"):
        client.node.create_publisher(PoseStamped, client.full(topic), 10)
    client.wait(lambda: client.diagnostics().get("refused: unknown name") == "2")
    assert "takes commands on ~/bodies/part/set, ~/obstacles/table/target" in process.log
    assert "no 'prt' among its bodies; did you mean 'part'? bodies: part" in process.log
    assert "no 'table' among its bodies; its topics are ~/obstacles/table/...; bodies: part" in process.log
    assert len(poses) == 3
    client.publish("bodies/part/set", _pose(z=-0.05))
    client.wait(lambda: client.diagnostics().get("refused: inside of something") == "1")
    assert "m inside of obstacle 'table'; remedy: shift it by" in process.log
    assert "command on /gdfe_sim/bodies/part/set refused: body" in process.log


def test_bodies_that_were_put_are_replayed_to_the_bit(tmp_path: Path, slab: Path, replays: Callable) -> None:
    """A box put twice while a table moves is in the bag, in both replays and in the exports."""
    bag = tmp_path / "bag"
    with Simulator(slab, bag=bag, parameters={"dt": 0.02}) as simulator:
        for step in range(12):
            bodies = {3: {"part": Pose((0.01, 0.0, 0.1), (0.3, 0.2, 0.1))}, 6: {"part": Pose((0.0, 0.0, 0.01))}}
            table = Pose((0.0, 0.0, 1e-5 * step))
            state = simulator.step(Command(handles={"table": table}, bodies=bodies.get(step, {})))
            if step == 3:
                np.testing.assert_allclose(state.poses["part"].translation, [0.01, 0.0, 0.1], atol=5e-3)
        with pytest.raises(CommandError, match="no free body 'table' in scene 'slab'; bodies: part"):
            simulator.step(Command(bodies={"table": Pose()}))
    assert state.poses["part"].translation[2] < 0.01
    replays(bag, node=True)
    assert [list(record.bodies) for record in BagRun(bag).records if record.bodies] == [["part"], ["part"]]
    assert main(["export", str(bag), "--to", "csv", "--out", str(tmp_path / "run.csv")]) == 0
    first, *rows = (tmp_path / "run.csv").read_text().splitlines()
    column = first.split(",").index("set.part.z [m]")
    assert [float(row.split(",")[column]) for row in rows if row.split(",")[column]] == [0.1, 0.01]


def _vectors(points: np.ndarray, names: Iterable[str]) -> np.ndarray:
    return np.stack([points[name] for name in names], axis=1).astype(float)


def _origin(transform: Any) -> list[float]:
    return vector(transform.transform.translation)
