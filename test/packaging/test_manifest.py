# SPDX-License-Identifier: Apache-2.0
"""Dependencies in package.xml for rosdep, and the error on a machine with a too old package."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

ROS = {"launch", "launch_ros", "rclpy", "ament_index_python"}


def _imports(folder: Path) -> set[str]:
    """Return the top-level packages that the Python files of a folder import."""
    found = set()
    for path in folder.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                found |= {alias.name.partition(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and not node.level:
                found.add(node.module.partition(".")[0])
    return found


def test_every_ros_package_that_is_imported_is_declared(root: Path) -> None:
    """Every ROS package imported by code and launch files is declared in package.xml."""
    declared = {entry.text for entry in ElementTree.parse(root / "package.xml").getroot().findall("exec_depend")}
    used = _imports(root / "gdfe_ros") | _imports(root / "launch")
    wanted = {name for name in used if name in ROS or name.endswith(("_msgs", "_interfaces", "_srvs"))}
    assert wanted >= ROS
    assert wanted <= declared


@pytest.mark.parametrize("words", [["-m", "gdfe_ros.node"], ["-m", "gdfe_ros.cli", "solve", "bend5"]], ids=str)
def test_the_first_line_names_a_pydantic_that_is_too_old(root: Path, tmp_path: Path, words: list[str]) -> None:
    """With Ubuntu 24.04's pydantic, a command ends with status 2 and one line that says what to install."""
    (tmp_path / "pydantic").mkdir()
    (tmp_path / "pydantic" / "__init__.py").write_text('VERSION = "1.10.14"\n')
    path = os.pathsep.join([str(tmp_path), str(root)])
    done = subprocess.run(
        [sys.executable, *words], env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 2, done.stderr
    (line,) = done.stderr.strip().splitlines()
    assert "pydantic 1.10.14" in line
    assert "pip install --user --break-system-packages 'pydantic>=2.6'" in line
