# SPDX-License-Identifier: Apache-2.0
"""Robots load as their makers distribute them; kinematics and torques are those of pinocchio's own reader."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from importlib.metadata import distribution
from pathlib import Path

import numpy as np
import pytest

from gdfe_ros import load_scene
from gdfe_ros.arms.dynamics import LinkDynamics, LinkFrame
from gdfe_ros.arms.meshes import find_mesh
from gdfe_ros.arms.urdf import parse_urdf
from gdfe_ros.errors import ArmError, SceneError
from gdfe_ros.scene import scene_from_text
from gdfe_ros.scene.solvable import remarks
from gdfe_ros.solver.settings import Policy
from test.arms.conftest import TWO_LINKS
from test.arms.robots import IIWA, ROBOTS, write_scene
from test.arms.written import ARMS, write_arm
from test.written import run_python

pin = pytest.importorskip("pinocchio")

CASE = Path(__file__).parents[1] / "data" / "cases" / "urdf" / "two_link.urdf"
MADE = [
    "ur_description/urdf/ur3_robot.urdf",
    "ur_description/urdf/ur3_gripper.urdf",
    "ur_description/urdf/ur5_robot.urdf",
    "ur_description/urdf/ur5_gripper.urdf",
    "ur_description/urdf/ur10_robot.urdf",
    "panda_description/urdf/panda.urdf",
    "panda_description/urdf/panda_collision.urdf",
    "kinova_description/robots/kinova.urdf",
    "so_arm_description/urdf/so100.urdf",
    "so_arm_description/urdf/so101.urdf",
    "xarm_description/urdf/xarm7.urdf",
    "z1_description/urdf/z1.urdf",
    "talos_data/robots/talos_left_arm.urdf",
    "baxter_description/urdf/baxter.urdf",
    "allegro_hand_description/urdf/allegro_right_hand.urdf",
    "finger_edu_description/robots/finger_edu.urdf",
    "double_pendulum_description/urdf/double_pendulum_continuous.urdf",
]
AIRO = ["arms/ur3e/ur3e", "arms/ur5e/ur5e", "grippers/robotiq_2f_85/urdf/robotiq_2f_85"]
"""Files of airo-models, which are the makers' own."""


@pytest.mark.parametrize("robot", MADE)
def test_kinematics_and_torques_are_pinocchios(robot: str) -> None:
    """Frames of all links and the torques that hold the arm are those of the unchanged file, to 1e-9."""
    for ours, theirs in _beside_pinocchio(ROBOTS / robot):
        np.testing.assert_allclose(ours, theirs, atol=1e-9)


@pytest.mark.parametrize("robot", AIRO)
def test_kinematics_of_arms_and_grippers_of_airo_are_pinocchios(robot: str) -> None:
    """The same for the files of airo-models, whose prefix `drake` is not declared; ROS' own parser reads them, too."""
    for ours, theirs in _beside_pinocchio(_of_airo(robot)):
        np.testing.assert_allclose(ours, theirs, atol=1e-9)


@pytest.mark.parametrize("robot", ["ur3e", "ur5e"])
def test_lengths_of_written_arms_are_the_makers(robot: str, tmp_path: Path) -> None:
    """Each joint of the written file is where the maker's own file has it."""
    made, given = (
        LinkDynamics(parse_urdf(path.read_text(), velocity=1.0), LinkFrame(np.zeros(3), np.eye(3)))
        for path in (write_arm(robot, tmp_path), _of_airo(f"arms/{robot}/{robot}"))
    )
    q = np.random.default_rng(1).uniform(-3.0, 3.0, 6)
    ours, theirs = made.frames(q), given.frames(q)
    links = [f"link_{number}" for number in range(2, 8)]
    names = ["shoulder_link", "upper_arm_link", "forearm_link", "wrist_1_link", "wrist_2_link", "wrist_3_link"]
    for own, name in zip(links, names, strict=True):
        np.testing.assert_allclose(ours[own].origin, theirs[name].origin, atol=1e-9)
        np.testing.assert_allclose(ours[own].axes, theirs[name].axes, atol=1e-8)


@pytest.mark.parametrize(
    ("robot", "flange", "joints"), [("arms/ur3e/ur3e", "tool0", 6), (AIRO[2], "left_inner_finger_pad", 1)]
)
def test_an_arm_of_airo_carries_a_body(robot: str, flange: str, joints: int, tmp_path: Path) -> None:
    """The makers' UR3e and 2F-85 load unchanged, with all their meshes."""
    arm = load_scene(write_scene(tmp_path, _of_airo(robot), flange)).arms[0]
    assert len(arm.joints) == joints
    assert not [text for text in arm.remarks if "left out" in text]


def test_kinematics_of_an_iiwa_are_pinocchios() -> None:
    """The same for the iiwa of ROS-Industrial, whose links have no masses."""
    for ours, theirs in _beside_pinocchio(IIWA):
        np.testing.assert_allclose(ours, theirs, atol=1e-9)


@pytest.mark.parametrize("robot", [*ARMS, "2f85"])
def test_kinematics_and_torques_of_written_arms_are_pinocchios(robot: str, tmp_path: Path) -> None:
    """The same for arms that no package has, with the lengths and in the form of their makers' files."""
    for ours, theirs in _beside_pinocchio(write_arm(robot, tmp_path)):
        np.testing.assert_allclose(ours, theirs, atol=1e-9)


@pytest.mark.parametrize("robot", ["iiwa", *ARMS, "2f85"])
def test_a_written_arm_carries_a_body(robot: str, tmp_path: Path) -> None:
    """Each carries a soft body; missing velocity limits are asked for once, missing meshes are left out."""
    path, flange = (
        (IIWA, "tool0") if robot == "iiwa" else (write_arm(robot, tmp_path), f"link_{len(ARMS.get(robot, ()))}")
    )
    more = ", velocity: 1.0"
    if robot in ARMS and robot != "gen3":
        with pytest.raises(SceneError, match="velocity") as caught:
            load_scene(write_scene(tmp_path, path, flange))
        assert str(caught.value).count("remedy") == 1
    arm = load_scene(write_scene(tmp_path, path, flange if robot != "2f85" else "left_finger_tip", more)).arms[0]
    assert len(arm.joints) == (1 if robot == "2f85" else 7 if robot in ("fr3", "gen3", "iiwa") else 6)
    assert any("left out of pictures" in text for text in arm.remarks) is (robot != "iiwa")


def _of_airo(robot: str) -> Path:
    return Path(distribution("airo-models").locate_file(f"airo_models/{robot}.urdf"))


def _beside_pinocchio(path: Path) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield our origins and axes of all links, and the torques that hold the arm, each with that of pinocchio."""
    own = LinkDynamics(parse_urdf(path.read_text(), velocity=1.0), LinkFrame(np.zeros(3), np.eye(3)))
    # pinocchio refuses joints without a velocity limit.
    model = pin.buildModelFromXML(re.sub(r"<limit (?![^>]*velocity)", '<limit velocity="1.0" ', path.read_text()))
    data, gravity = model.createData(), np.array([0.0, 0.0, -9.81])
    rng, commanded = np.random.default_rng(4), {joint.name: k for k, joint in enumerate(own.joints)}
    for _ in range(3):
        q = np.array([rng.uniform(max(j.limits.lower, -3.0), min(j.limits.upper, 3.0)) for j in own.joints])
        full, spread = pin.neutral(model), np.zeros((model.nv, len(q)))
        for number, name in enumerate(model.names[1:], start=1):
            mimic = own.description.joints[name].mimic
            master, factor, offset = (
                (name, 1.0, 0.0) if mimic is None else (mimic.joint, mimic.multiplier, mimic.offset)
            )
            value, joint = factor * q[commanded[master]] + offset, model.joints[number]
            full[joint.idx_q : joint.idx_q + joint.nq] = [value] if joint.nq == 1 else [np.cos(value), np.sin(value)]
            spread[joint.idx_v, commanded[master]] = factor
        pin.framesForwardKinematics(model, data, full)
        for name, frame in own.frames(q).items():
            place = data.oMf[model.getFrameId(name, pin.FrameType.BODY)]
            yield frame.origin, place.translation
            yield frame.axes, place.rotation
        torques = spread.T @ pin.computeGeneralizedGravity(model, data, full)
        still = np.zeros_like(q)
        yield own.efforts(q, still, still, gravity=gravity, pushes={}), torques


@pytest.mark.parametrize(
    ("robot", "flange", "drawn"),
    [
        ("ur_description/urdf/ur3_robot.urdf", "tool0", 8),
        ("ur_description/urdf/ur5_robot.urdf", "tool0", 8),
        ("panda_description/urdf/panda.urdf", "panda_hand", 11),
        ("kinova_description/robots/kinova.urdf", "j2s6s200_end_effector", 17),
        ("so_arm_description/urdf/so101.urdf", "gripper_link", 17),
        ("xarm_description/urdf/xarm7.urdf", "link7", 8),
    ],
)
def test_a_distributed_arm_loads_unchanged(tmp_path: Path, robot: str, flange: str, drawn: int) -> None:
    """The file loads with all of its visual meshes and with the collision meshes of its links."""
    arm = load_scene(write_scene(tmp_path, ROBOTS / robot, flange)).arms[0]
    assert len(arm.visuals) == drawn
    assert len(arm.links) > 5
    assert not any("left out of pictures" in text for text in arm.remarks)
    points = np.concatenate([visual.faces.reshape(-1, 3) for visual in arm.visuals])
    assert 0.05 < np.ptp(points, axis=0).max() < 1.5  # of one link, in metres


def test_the_case_of_two_links(tmp_path: Path) -> None:
    """Missing .dae meshes are left out with a remark, and the flange and torques are those of the README of cases."""
    scene = load_scene(write_scene(tmp_path, CASE, "tool0"))
    arm = scene.arms[0]
    q, gravity = np.array([0.6, -0.9]), np.array([0.0, 0.0, -9.81])
    place = arm.dynamics.frames(q)["flange"].origin - [-20, 0, 0]
    np.testing.assert_allclose(place, [0.11029, 0.0, 0.48867], atol=1e-5)
    torques = arm.dynamics.efforts(q, np.zeros(2), np.zeros(2), gravity=gravity, pushes={})
    np.testing.assert_allclose(torques, [-2.61814, 0.28991], atol=1e-5)
    told = [text for text in remarks(scene, Policy.ENERGY) if "left out of pictures: the mesh is missing" in text]
    assert len(told) == 3
    assert "base.dae" in told[0]
    assert "packages: {two_link_description:" in told[0]
    assert len(arm.visuals) == 3  # collision shapes are drawn instead
    assert len(scene_from_text(scene.source).arms[0].visuals) == 3


@pytest.mark.parametrize(
    ("urdf", "mesh"),
    [
        ("robots/my_arm/urdf/arm.urdf", "robots/my_arm/meshes/one.stl"),
        ("my_arm/urdf/arm.urdf", "my_arm/meshes/one.stl"),
        ("robots/arm.urdf", "robots/my_arm/meshes/one.stl"),
        ("arm.urdf", "meshes/one.stl"),
        ("copy_of_arm/urdf/arm.urdf", "copy_of_arm/meshes/one.stl"),
        ("elsewhere/arm.urdf", "install/share/my_arm/meshes/one.stl"),
    ],
)
def test_packages_are_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, urdf: str, mesh: str) -> None:
    """A package:// is found around the URDF, also in a folder of another name, and in AMENT_PREFIX_PATH."""
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "install"))
    for name in (urdf, mesh):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    folder = (tmp_path / urdf).parent
    assert find_mesh("package://my_arm/meshes/one.stl", folder=folder, packages={}) == tmp_path / mesh


def test_a_missing_reader_is_named() -> None:
    """Where pycollada is not installed, a .dae says so, and not that it is damaged."""
    mesh = ROBOTS / "ur_description" / "meshes" / "ur5" / "visual" / "wrist3.dae"
    code = "import sys; sys.modules['collada'] = None\nfrom pathlib import Path\n"
    code += f"from gdfe_ros.arms.meshes import read_surface; read_surface('wrist3.dae', Path({str(mesh)!r}))"
    done = run_python(code)
    assert "missing `pip install pycollada`; remedy: pip install 'gdfe_ros[arm]'" in done.stderr


def test_a_package_in_a_folder_of_another_name_is_told(tmp_path: Path) -> None:
    """Meshes that are taken from a folder without the package's name are no secret."""
    shutil.copytree(ROBOTS / "z1_description" / "meshes", tmp_path / "robots" / "z1_description" / "meshes")
    shutil.copy(ROBOTS / "z1_description" / "urdf" / "z1.urdf", tmp_path / "z1.urdf")
    arm = load_scene(write_scene(tmp_path, "z1.urdf", "link06")).arms[0]
    assert arm.remarks == (
        f"no folder has the name of the package 'example-robot-data'; its meshes are taken from {tmp_path}",
    )


def test_missing_velocities_are_asked_for_once() -> None:
    """One defect names all joints without a largest velocity, and `velocity` of the arm gives it to all."""
    text = TWO_LINKS.replace(' velocity="1.5"', "", 1).replace('velocity="1.5"', 'velocity="0"')
    with pytest.raises(ArmError) as error:
        parse_urdf(text)
    assert error.value.defects == [
        "the joints lift, bend have no largest velocity; remedy: `velocity: 2.0` [rad/s, m/s] in the arm's entry of "
        'the scene, for all of them, or <limit velocity="2.0" .../> in the URDF'
    ]
    assert parse_urdf(text, velocity=0.7).joints["bend"].limits.velocity == 0.7


def test_a_start_that_the_limits_forbid_is_the_nearest(tmp_path: Path) -> None:
    """A joint whose limits do not contain 0 starts at the limit that is nearest to 0."""
    (tmp_path / "arm.urdf").write_text(TWO_LINKS.replace('lower="-2" upper="2"', 'lower="-2" upper="-0.07"', 1))
    assert load_scene(write_scene(tmp_path, "arm.urdf", "tip")).arms[0].start[0] == -0.07


def test_a_collision_mesh_that_is_missing_is_a_defect_only_of_links_in_contact(tmp_path: Path) -> None:
    """A missing collision mesh is refused with two remedies, one of which leaves the link out of contact."""
    text = TWO_LINKS.replace('<box size="0.05 0.05 0.3"/>', '<mesh filename="one.stl"/>')
    (tmp_path / "arm.urdf").write_text(text)
    with pytest.raises(SceneError, match=r"mesh one.stl: the mesh is missing .*leave its link out of `links`"):
        load_scene(write_scene(tmp_path, "arm.urdf", "tip"))
    arm = load_scene(write_scene(tmp_path, "arm.urdf", "tip", ", links: []")).arms[0]
    assert "mesh one.stl is left out of pictures" in arm.remarks[0]
