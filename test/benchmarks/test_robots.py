# SPDX-License-Identifier: Apache-2.0
"""The list of robots, their table and their picture."""

from __future__ import annotations

from pathlib import Path

from benchmarks.report import KEPT, read_report
from benchmarks.robot_picture import draw_robots
from benchmarks.robots import ROBOTS, Robot, measure, robot_table
from gdfe_ros import load_scene


def test_every_robot_has_a_program_that_reaches_its_moment() -> None:
    """The moment of each robot's picture lies within its scene's program."""
    for robot in ROBOTS:
        assert 0.0 < robot.moment <= load_scene(robot.scene).program.duration


def test_kept_rates_are_of_these_robots() -> None:
    """Each kept rate is that of a robot with its scene's present number of cells."""
    report = read_report(KEPT / "robots.json").data
    assert [item["scene"] for item in report] == [robot.scene for robot in ROBOTS]
    for item in report:
        assert item["cells"] == load_scene(item["scene"]).mesh.n_cells


def test_a_robot_is_measured_and_drawn(tmp_path: Path) -> None:
    """A measured robot gives a row of the table and a PNG picture."""
    found = measure(Robot("two_material_bar", "stretches", 0.2))
    assert found["converged"]
    assert "| `two_material_bar` | stretches | 384 |" in robot_table([found])
    draw_robots(tmp_path / "robots.png", [Robot("two_material_bar", "stretches", 0.2)])
    assert (tmp_path / "robots.png").read_bytes().startswith(b"\x89PNG")
