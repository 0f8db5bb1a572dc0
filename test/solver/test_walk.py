# SPDX-License-Identifier: Apache-2.0
"""From a pose command to the kernels: files and returns on the walk of one step."""

from __future__ import annotations

import ast
import sys
from pathlib import Path
from types import FrameType

import gdfe_ros
from gdfe_ros import Command, Pose, Simulation, load_scene

PACKAGE = Path(gdfe_ros.__file__).parent
PAGE = PACKAGE.parent / "docs" / "architecture.md"
FILES, RETURNS = 50, 20
"""Largest number of files that one person can hold in mind, and of places at which the stations of a step return."""


def test_a_pose_command_passes_few_files() -> None:
    """A cold step of a bar calls Python functions of at most 50 files of the package."""
    simulation, passed = Simulation(load_scene("bend5")), set()
    simulation.step(Command(handles={"tip": Pose(translation=(0.0, 0.0, 1e-3))}))

    def note(frame: FrameType, event: str, _: object) -> None:
        if event == "call" and frame.f_code.co_filename.startswith(str(PACKAGE)):
            passed.add(frame.f_code.co_filename)

    before = sys.getprofile()
    sys.setprofile(note)
    try:
        assert simulation.step(Command(handles={"tip": Pose(translation=(0.0, 0.0, 0.1))})).converged
    finally:
        sys.setprofile(before)
    assert len(passed) <= FILES, sorted(passed)


def test_the_stations_of_a_step_return_at_few_places() -> None:
    """The functions in the table of the architecture page have at most 20 return statements together."""
    table = PAGE.read_text(encoding="utf-8").partition("## From a command to the kernel")[2].partition("## ")[0]
    rows = [line.split("`") for line in table.splitlines() if line.startswith("| `")]
    found = [_returns(PACKAGE / path, name) for _, name, _, path, *_ in rows]
    assert len(found) == 9
    assert sum(found) <= RETURNS


def _returns(path: Path, name: str) -> int:
    """Return the number of return statements in the function ``name``, or ``Class.name``, of a file."""
    node = ast.parse(path.read_text(encoding="utf-8"))
    for part in name.split("."):
        node = next(child for child in node.body if getattr(child, "name", None) == part)
    return sum(isinstance(child, ast.Return) for child in ast.walk(node))
