# SPDX-License-Identifier: Apache-2.0
"""Arms beside MuJoCo: its reader of the same URDF, and the lengths of its models of the same robots."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np
import pytest

from gdfe_ros.arms.dynamics import LinkDynamics, LinkFrame
from gdfe_ros.arms.urdf import parse_urdf
from test.arms.robots import IIWA
from test.arms.written import ARMS, write_arm

GRAVITY = np.array([0.0, 0.0, -9.81])
TURNED, BACK, OVER = "1 1 0 0", "1 -1 0 0", "0 1 0 0"
Y90 = "1 0 1 0"


class Model(NamedTuple):
    """A robot of MuJoCo Menagerie.

    Attributes:
        joints: place, rotation and axis of each joint in the body before it.
        tip: place and rotation of a site in the last body.
        link: the link of the written file that has this place and this z axis.
        digits: accuracy of the lengths in the model [m].
    """

    joints: tuple[tuple[str, str, str], ...]
    tip: tuple[str, str]
    link: str
    digits: float


def _ur(shoulder: float, upper: float, fore: float, wrist: tuple[float, ...]) -> Model:
    first, second, third = "0 0 1", "0 1 0", "0 1 0"
    joints = (
        (f"0 0 {shoulder}", "1 0 0 0", first),
        (f"0 {wrist[0]} 0", Y90, second),
        (f"0 {-wrist[1]} {upper}", "1 0 0 0", third),
        (f"0 0 {fore}", Y90, "0 1 0"),
        (f"0 {wrist[2]} 0", "1 0 0 0", "0 0 1"),
        (f"0 0 {wrist[3]}", "1 0 0 0", "0 1 0"),
    )
    return Model(joints, (f"0 {wrist[4]} 0", "-1 1 0 0"), "link_7", 1e-3)


def _z(*places: tuple[str, str]) -> tuple[tuple[str, str, str], ...]:
    return tuple((place, turn, "0 0 1") for place, turn in places)


MENAGERIE = {
    "ur5e": _ur(0.163, 0.425, 0.392, (0.138, 0.131, 0.127, 0.1, 0.1)),
    "ur10e": _ur(0.181, 0.613, 0.571, (0.176, 0.137, 0.135, 0.12, 0.117)),
    "fr3": Model(
        _z(
            ("0 0 0.333", "1 0 0 0"), ("0 0 0", BACK), ("0 -0.316 0", TURNED), ("0.0825 0 0", TURNED),
            ("-0.0825 0.384 0", BACK), ("0 0 0", TURNED), ("0.088 0 0", TURNED),
        ),
        ("0 0 0.107", "1 0 0 0"),
        "link_8",
        0.0,
    ),
    "gen3": Model(
        _z(
            ("0 0 0.15643", OVER), ("0 0.005375 -0.12838", TURNED), ("0 -0.21038 -0.006375", BACK),
            ("0 0.006375 -0.21038", TURNED), ("0 -0.20843 -0.006375", BACK), ("0 0.00017505 -0.10593", TURNED),
            ("0 -0.10593 -0.00017505", BACK),
        ),
        ("0 0 -0.061525", OVER),
        "link_8",
        0.0,
    ),
}  # fmt: skip
"""Lengths of the models of October 2026; each stands so that it reaches along x. The model of the UR10e has the
flange of the UR5e, whose length is therefore the maker's here.
"""


@pytest.mark.parametrize("robot", ["iiwa", *ARMS, "2f85"])
def test_frames_and_torques_are_mujocos(robot: str, tmp_path: Path) -> None:
    """MuJoCo reads the same file: frames of all links, and torques that hold the arm, agree to 1e-9."""
    text = (IIWA if robot == "iiwa" else write_arm(robot, tmp_path)).read_text()
    text = _for_mujoco(text, massive=robot == "iiwa")
    own = LinkDynamics(parse_urdf(text, velocity=1.0), LinkFrame(np.zeros(3), np.eye(3)))
    model = mujoco.MjModel.from_xml_string(text)
    data, rng = mujoco.MjData(model), np.random.default_rng(6)
    commanded = {joint.name: k for k, joint in enumerate(own.joints)}
    for _ in range(3):
        q = np.array([rng.uniform(max(j.limits.lower, -3.0), min(j.limits.upper, 3.0)) for j in own.joints])
        spread = np.zeros((model.nv, len(q)))
        for number in range(model.njnt):
            joint = model.joint(number)
            mimic = own.description.joints[joint.name].mimic
            master, factor, offset = (
                (joint.name, 1.0, 0.0) if mimic is None else (mimic.joint, mimic.multiplier, mimic.offset)
            )
            data.qpos[joint.qposadr[0]] = factor * q[commanded[master]] + offset
            spread[joint.dofadr[0], commanded[master]] = factor
        data.qvel[:] = 0.0
        mujoco.mj_forward(model, data)
        frames = own.frames(q)
        for number in range(1, model.nbody):
            frame, body = frames[model.body(number).name], data.body(number)
            np.testing.assert_allclose(frame.origin, body.xpos, atol=1e-9)
            np.testing.assert_allclose(frame.axes, body.xmat.reshape(3, 3), atol=1e-9)
        still = np.zeros_like(q)
        torques = own.efforts(q, still, still, gravity=GRAVITY, pushes={})
        np.testing.assert_allclose(torques, spread.T @ data.qfrc_bias, atol=1e-9)


def _for_mujoco(text: str, *, massive: bool) -> str:
    """Return a URDF without shapes, whose links MuJoCo does not join at fixed joints.

    If ``massive``, links without a mass get one, which MuJoCo demands of moving links.
    """
    bare = re.sub(r"<(visual|collision|gazebo|ros2_control|transmission)\b.*?</\1>", "", text, flags=re.S)
    if massive:
        inertial = '<inertial><origin xyz="0.01 0.02 -0.03"/><mass value="2"/>'
        inertial += '<inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial>'
        bare = re.sub(r"(<link name=\"[^\"]*\")\s*(/>|>\s*</link>)", rf"\1>{inertial}</link>", bare)
    option = '<mujoco><compiler fusestatic="false"/></mujoco>'
    return re.sub(r"(<robot\b[^>]*>)", rf"\1{option}", bare, count=1)


@pytest.mark.parametrize("robot", list(MENAGERIE))
def test_lengths_are_those_of_menagerie(robot: str, tmp_path: Path) -> None:
    """The end of the written file is where MuJoCo's own model of the robot has it, within the model's digits."""
    own = LinkDynamics(
        parse_urdf(write_arm(robot, tmp_path).read_text(), velocity=1.0), LinkFrame(np.zeros(3), np.eye(3))
    )
    given = MENAGERIE[robot]
    model = mujoco.MjModel.from_xml_string(_mjcf(given))
    data, rng = mujoco.MjData(model), np.random.default_rng(8)
    for _ in range(5):
        q = rng.uniform(-2.5, 2.5, model.nq)
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        frame = own.frames(q)[given.link]
        np.testing.assert_allclose(frame.axes[:, 2], data.site("tip").xmat.reshape(3, 3)[:, 2], atol=1e-9)
        np.testing.assert_allclose(frame.origin, data.site("tip").xpos, atol=3.0 * given.digits + 1e-9)


def _mjcf(given: Model) -> str:
    """Return a model in MuJoCo's format, of bodies without shapes."""
    inertia = '<inertial pos="0 0 0" mass="1" diaginertia="0.01 0.01 0.01"/>'
    text = f'<site name="tip" pos="{given.tip[0]}" quat="{given.tip[1]}"/>'
    for place, turn, axis in reversed(given.joints):
        text = f'<body pos="{place}" quat="{turn}">{inertia}<joint axis="{axis}"/>{text}</body>'
    return f"<mujoco><worldbody><body>{text}</body></worldbody></mujoco>"
