# SPDX-License-Identifier: Apache-2.0
"""Arms in scenes: entries, defects, poses of handles and links, efforts, snapshots."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gdfe_ros import Command, Pose, Simulation, load_scene
from gdfe_ros.checkpoint import load_state, save_state
from gdfe_ros.errors import CommandError, SceneError
from gdfe_ros.installation import robots_extra
from gdfe_ros.scene import scene_from_text
from gdfe_ros.scene.schemas.paths import missing_packages
from test.arms.conftest import SCENE, TWO_LINKS
from test.written import advance

MASS = 1200 * 0.04 * 0.02 * 0.02


def test_joints_move_the_handle_and_the_links(held_block: Path) -> None:
    """The handle moves with the flange by 90 degrees about y, from x = -0.6 + 0.6 to the upright arm's top."""
    simulation = Simulation(load_scene(held_block))
    advance(simulation, Command(joints={"lift": 0.0, "bend": 0.0}))
    pose = simulation.handle_pose("wrist")
    np.testing.assert_allclose(pose.rotation, [0.0, -np.pi / 2, 0.0], atol=1e-12)
    np.testing.assert_allclose(pose.translation, [-0.6, 0.0, 0.6], atol=1e-12)
    link = simulation.handle_pose("one_piece")
    np.testing.assert_allclose(link.translation, [-0.2, 0.0, 0.2], atol=1e-12)


def test_joints_hold_the_weight_of_links_and_hand(held_block: Path) -> None:
    """Joint efforts are those of the weights of two links and of the slightly sagging soft block."""
    simulation = Simulation(load_scene(held_block))
    simulation.step()
    states = simulation.joint_states()
    centre = 0.6 + float(simulation.mesh.vertices[:, 0].mean())
    expected = 9.81 * np.array([2.0 * 0.2 + 1.0 * 0.5 + MASS * centre, 1.0 * 0.1 + MASS * (centre - 0.4)])
    found = -np.array([states["lift"].effort, states["bend"].effort])
    np.testing.assert_allclose(found, expected, rtol=1e-5)


def test_a_scene_rebuilds_from_its_text_without_files(held_block: Path, two_links: Path) -> None:
    """A scene rebuilt from its text contains the URDF and needs no file."""
    scene = load_scene(held_block)
    two_links.unlink()
    again = scene_from_text(scene.source)
    assert again.arms[0].text == scene.arms[0].text
    one, two = Simulation(scene), Simulation(again)
    for simulation in (one, two):
        simulation.step(Command(joints={"bend": 0.3}))
    np.testing.assert_array_equal(one.positions, two.positions)
    assert one.joint_states() == two.joint_states()


_PROGRAM = "program: {duration: 2, joints: {lift: [{time: 1, value: 1.9, velocity: 1.4}, {time: 2, value: 1.9}]}}"
_TOO_FAR = "the joint reaches 2.10741 rad at 1.33333 s, between two points; allowed by the joint's limits: -2 to 2"


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("flange: tip", "flange: tool0", "arm.flange = 'tool0' (line 8): the URDF has no such link; did you"),
        ("flange: tip", "flange: base", "no joint moves between 'base' and this link"),
        ("handle: wrist", "handle: wirst", "there is no such handle; did you mean 'wrist'?"),
        ("two.urdf", "three.urdf", "it cannot be read as text"),
        ("start: {lift", "start: {left", "arm.start.left (line 8): there is no such joint; did you mean 'lift'?"),
        ("start: {lift: 1.57", "start: {lift: 3.57", "3.5707963267948966; allowed by its limits: -2 to 2 rad"),
        ("start: {", "links: [one, top], start: {", "there is no link 'top'"),
        ("start: {", "links: [two], start: {", "link 'two' has no <collision>"),
        ("start: {", "limits: {lift: {velocity: -1}}, start: {", "arm.limits.lift.velocity"),
        ("start: {", "limits: {lever: {velocity: 1}}, start: {", "no joint 'lever' that moves; joints: lift, bend"),
        ("at: [-0.6, 0, 0]", "at: [-0.2, 0, 0]", "m inside of the soft body; remedy"),
        ("where: {face: x-}", "where: {face: x-}, fixed: true", "this handle is fixed or has free axes"),
        ("arm: {", f"{_PROGRAM}\narm: {{", _TOO_FAR),
        ("arm: {", "arms: {a: {urdf: two.urdf, flange: tip, handle: wrist}}\narm: {", "`arm` is there, too"),
    ],
)  # fmt: skip
def test_defects_of_an_arm_are_named(two_links: Path, old: str, new: str, told: str) -> None:
    """A scene whose arm is unusable is refused with a remedy."""
    text = SCENE.format(urdf="two.urdf")
    assert old in text
    path = two_links.parent / "scene.yaml"
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(SceneError) as error:
        load_scene(path)
    assert told in str(error.value)


def test_missing_meshes_are_all_named(two_links: Path) -> None:
    """Every missing mesh is named with its searched path and a remedy."""
    text = TWO_LINKS.replace('<box size="0.05 0.05 0.3"/>', '<mesh filename="package://my_arm/one.stl"/>')
    extra = '<visual><geometry><mesh filename="two.stl"/></geometry></visual></link><link name="tip"/>'
    two_links.write_text(text.replace('</link>\n  <link name="tip"/>', extra))
    path = two_links.parent / "scene.yaml"
    path.write_text(SCENE.format(urdf="two.urdf"))
    with pytest.raises(SceneError) as error:
        load_scene(path)
    assert "mesh package://my_arm/one.stl: the mesh is missing" in str(error.value)
    assert "`packages: {my_arm: <folder of that package>}`" in str(error.value)
    assert "two.stl" not in str(error.value)  # a visual mesh is left out


def test_an_arm_that_begins_in_an_obstacle_is_named(two_links: Path) -> None:
    """An arm that starts inside an obstacle is refused with link, obstacle and depth."""
    path = two_links.parent / "scene.yaml"
    path.write_text(SCENE.format(urdf="two.urdf") + "obstacles: {table: {plane: [0, 0, 1], at: [0, 0, -0.02]}}\n")
    with pytest.raises(
        SceneError, match=r"link 'one' begins 0\.005 m inside of obstacle 'table'; remedy: another `start`"
    ):
        load_scene(path)


def test_commands_of_joints_are_checked(held_block: Path) -> None:
    """Unknown joints, NaN and positions beyond the limits are refused, and the state stays."""
    simulation = Simulation(load_scene(held_block))
    for joints, told in (
        ({"lifd": 0.0}, "no joint 'lifd'; did you mean 'lift'"),
        ({"lift": float("nan")}, "position nan is not finite; allowed: finite numbers, -2 to 2 rad"),
        ({"lift": 2.5}, "position 2.5; allowed: -2 to 2 rad; remedy"),
    ):
        with pytest.raises(CommandError, match=told):
            simulation.step(Command(joints=joints))
    with pytest.raises(CommandError, match="handle 'wrist' is carried by arm 'arm'; remedy: command the arm's joints"):
        simulation.step(Command(handles={"wrist": Pose()}))
    assert simulation.joint_goals == {"lift": np.pi / 2, "bend": 0.0}


def test_two_arms_of_one_kind_need_prefixes(two_links: Path) -> None:
    """Two arms of one kind are refused with the colliding name, and accepted with prefixes."""
    text = SCENE.format(urdf="two.urdf").split("arm:")[0].replace("handles: {", "handles: {far: {where: {face: x+}}, ")
    one = (
        "{{urdf: two.urdf, flange: {0}tip, handle: {1}, at: {2}, rotation_deg: {3}, prefix: '{0}', "
        "start: {{{0}lift: 1.57}}}}"
    )
    path = two_links.parent / "scene.yaml"
    arms = [one.format("", "wrist", "[-0.6, 0, 0]", "[0, 0, 0]"), one.format("", "far", "[0.64, 0, 0]", "[0, 0, 180]")]
    path.write_text(f"{text}arms:\n  left: {arms[0]}\n  right: {arms[1]}\n")
    with pytest.raises(SceneError, match="arm 'left' has the name 'lift', too; remedy: `prefix: right_`"):
        load_scene(path)
    arms[1] = one.format("r_", "far", "[0.64, 0, 0]", "[0, 0, 180]")
    path.write_text(f"{text}arms:\n  left: {arms[0]}\n  right: {arms[1]}\n")
    simulation = Simulation(load_scene(path))
    assert simulation.step(Command(joints={"r_lift": 1.56, "lift": 1.56})).converged
    assert list(simulation.joint_states()) == ["lift", "bend", "r_lift", "r_bend"]


def test_steps_go_on_bit_by_bit_from_a_saved_state(held_block: Path) -> None:
    """A state saved during a motion of the joints continues in another simulation with the same bits."""
    scene = load_scene(held_block, overrides={"dynamics": {"step": 0.01}})
    one, two = Simulation(scene), Simulation(scene)
    one.step(Command(joints={"lift": 1.0}), dt=0.02)
    load_state(two, save_state(one))
    for simulation in (one, two):
        advance(simulation, dt=0.02, count=3)
    assert not one.settled
    np.testing.assert_array_equal(one.positions, two.positions)
    assert one.joint_states() == two.joint_states()


def test_a_missing_package_of_a_robot_is_asked_for(two_links: Path) -> None:
    """A URDF in a package that is not installed is refused; the remedy is the extra of a robot that a scene has."""
    path = two_links.parent / "scene.yaml"
    path.write_text(SCENE.format(urdf="pip://no-such-robots/arm.urdf"))
    with pytest.raises(SceneError, match="the package 'no-such-robots' is not installed; remedy: pip install no-such"):
        load_scene(path)
    assert missing_packages(path.read_text()) == ["no-such-robots"]
    assert [robots_extra(name) for name in ("airo-models", "example-robot-data")] == ["ur5e", "panda"]


def test_an_arm_back_at_its_start_has_no_negative_zeros(held_block: Path) -> None:
    """After a small negative rotation, the zeros of the initial pose are positive, as those that the node publishes."""
    arm = load_scene(held_block).arms[0]
    pose = arm.poses(arm.start, {"wrist": Pose(rotation=(1e-10, -1e-9, 0.0))})["wrist"]
    assert not np.signbit(pose.rotation).any()
