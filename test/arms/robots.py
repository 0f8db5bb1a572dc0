# SPDX-License-Identifier: Apache-2.0
"""Robots as they are distributed, from the packages example-robot-data and rtb-data, and scenes with one of them."""

from __future__ import annotations

import sysconfig
from pathlib import Path

ROBOTS = Path(sysconfig.get_paths()["purelib"]) / "cmeel.prefix/share/example-robot-data/robots"
IIWA = Path(sysconfig.get_paths()["purelib"]) / (
    "rtbdata/xacro/kuka_description/kuka_lbr_iiwa/urdf/lbr_iiwa_14_r820.urdf"
)

SCENE = """
name: carried
mesh: {{bar: {{size: [0.04, 0.02, 0.02], cells: [2, 1, 1]}}}}
materials: {{soft: {{law: neo_hookean, young: 3.0e5, poisson: 0.45, density: 1200}}}}
regions: [{{material: soft}}]
handles: {{grip: {{where: {{face: x-}}}}}}
arm: {{urdf: {urdf}, flange: {flange}, handle: grip, at: [-20, 0, 0]{more}}}
"""


def write_scene(folder: Path, urdf: Path | str, flange: str, more: str = "") -> Path:
    """Write a scene in which a robot, 20 m away, carries a small block; return its path."""
    path = folder / "carried.yaml"
    path.write_text(SCENE.format(urdf=urdf, flange=flange, more=more), encoding="utf-8")
    return path
