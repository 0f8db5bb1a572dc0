# SPDX-License-Identifier: Apache-2.0
"""STEP files for the tests of meshers, drawn by gmsh in a process of its own."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

DRAWN = """
import gmsh, sys
gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
{}
gmsh.model.occ.synchronize()
gmsh.write(sys.argv[1])
"""
HOLED = """
gmsh.model.occ.addBox(0, 0, 0, 60, 30, 20)
gmsh.model.occ.cut([(3, 1)], [(3, gmsh.model.occ.addCylinder(30, 15, -1, 0, 0, 22, 8))])
"""
WALLED = """
wall = gmsh.model.occ.addBox(10, 0, 0, 20, 10, 1)
gmsh.model.occ.fuse([(3, gmsh.model.occ.addBox(0, 0, 0, 10, 10, 10))], [(3, wall)])
"""
LAYERED = """
gmsh.model.occ.addBox(0, 0, 0, 20, 20, 8)
gmsh.model.occ.addBox(0, 0, 8, 20, 20, 2)
"""
OVERLAPPING = """
gmsh.model.occ.addBox(0, 0, 0, 30, 20, 20)
gmsh.model.occ.addBox(25, 0, 0, 30, 20, 20)
gmsh.model.occ.addBox(40, 5, 5, 10, 10, 10)
"""
HOLLOW = """
gmsh.model.occ.addBox(0, 0, 0, 20, 20, 20)
gmsh.model.occ.cut([(3, 1)], [(3, gmsh.model.occ.addBox(5, 5, 5, 10, 10, 10))])
"""


def _written(path: Path, commands: str) -> Path:
    subprocess.run([sys.executable, "-c", DRAWN.format(commands), str(path)], check=True, capture_output=True)
    return path


@pytest.fixture
def step(tmp_path: Path) -> Path:
    """Write the STEP file of a block of 60 x 30 x 20 mm with a hole of radius 8 mm."""
    return _written(tmp_path / "block.step", HOLED)


@pytest.fixture
def walled(tmp_path: Path) -> Path:
    """Write the STEP file of a block of 10 x 10 x 10 mm with a wall of 20 x 10 x 1 mm at its side x = 10 mm."""
    return _written(tmp_path / "walled.step", WALLED)


@pytest.fixture
def layered(tmp_path: Path) -> Path:
    """Write the STEP file of two solids: a plate of 20 x 20 x 8 mm, and one of 2 mm on it."""
    return _written(tmp_path / "layered.step", LAYERED)


@pytest.fixture
def overlapping(tmp_path: Path) -> Path:
    """Write the STEP file of two boxes of 30 x 20 x 20 mm that overlap by 5 mm, and a cube inside the second box."""
    return _written(tmp_path / "overlapping.step", OVERLAPPING)


@pytest.fixture
def hollow(tmp_path: Path) -> Path:
    """Write the STEP file of a cube of 20 mm with a cubic cavity of 10 mm."""
    return _written(tmp_path / "hollow.step", HOLLOW)
