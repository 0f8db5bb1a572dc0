# SPDX-License-Identifier: Apache-2.0
"""A small URDF and a scene with a soft hand on it, for the tests of arms."""

from __future__ import annotations

from pathlib import Path

import pytest

from gdfe_ros.installation import share_dir

ARM = share_dir() / "config" / "arms" / "six_joints.urdf"

TWO_LINKS = """<robot name="two">
  <link name="base"/>
  <link name="one">
    <inertial><origin xyz="0 0 0.2"/><mass value="2.0"/>
      <inertia ixx="0.03" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.002"/></inertial>
    <collision><origin xyz="0 0 0.2"/><geometry><box size="0.05 0.05 0.3"/></geometry></collision>
  </link>
  <link name="two">
    <inertial><origin xyz="0 0 0.1"/><mass value="1.0"/>
      <inertia ixx="0.004" ixy="0" ixz="0" iyy="0.004" iyz="0" izz="0.001"/></inertial>
  </link>
  <link name="tip"/>
  <joint name="lift" type="revolute"><parent link="base"/><child link="one"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" velocity="1.5" effort="40"/></joint>
  <joint name="bend" type="revolute"><parent link="one"/><child link="two"/><origin xyz="0 0 0.4"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" velocity="1.5" effort="20"/></joint>
  <joint name="end" type="fixed"><parent link="two"/><child link="tip"/><origin xyz="0 0 0.2"/></joint>
</robot>"""

SCENE = """
name: held_block
mesh: {{bar: {{size: [0.04, 0.02, 0.02], cells: [4, 2, 2]}}}}
materials: {{soft: {{law: neo_hookean, young: 3.0e5, poisson: 0.45, density: 1200}}}}
regions: [{{material: soft}}]
handles: {{wrist: {{where: {{face: x-}}}}}}
loads: {{weight: {{gravity: [0, 0, -9.81]}}}}
arm: {{urdf: {urdf}, flange: tip, handle: wrist, at: [-0.6, 0, 0], start: {{lift: 1.5707963267948966}}}}
"""


@pytest.fixture
def two_links(tmp_path: Path) -> Path:
    """Write the URDF of two hinged links; return its path."""
    path = tmp_path / "two.urdf"
    path.write_text(TWO_LINKS, encoding="utf-8")
    return path


@pytest.fixture
def held_block(two_links: Path) -> Path:
    """Write the scene of a soft block at the end of two horizontal links; return its path."""
    path = two_links.parent / "held_block.yaml"
    path.write_text(SCENE.format(urdf="two.urdf"), encoding="utf-8")
    return path
