# SPDX-License-Identifier: Apache-2.0
"""Dependencies in package.xml for rosdep, and the error on a machine with a too old package."""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
from importlib import metadata
from pathlib import Path
from xml.etree import ElementTree

import pytest

ROS = {"launch", "launch_ros", "rclpy", "ament_index_python"}
RELEASED = {"pinocchio", "ros2launch"}
"""Further packages of ROS 2 Jazzy that package.xml names."""
KEYS = {
    "numpy": "python3-numpy",
    "scipy": "python3-scipy",
    "numba": "python3-numba",
    "pyyaml": "python3-yaml",
    "rich": "python3-rich",
    "matplotlib": "python3-matplotlib",
    "rosbags": "python3-rosbags-pip",
    "pytest": "python3-pytest",
}
"""Keys of rosdep (ros/rosdistro, rosdep/python.yaml) that Ubuntu 24.04 resolves in a new enough version."""


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


def test_every_key_is_one_that_rosdep_resolves(root: Path) -> None:
    """Each dependency in package.xml is a package of ROS, or a key in rosdep's list with a requirement of pip."""
    manifest = ElementTree.parse(root / "package.xml").getroot()
    named = [entry.text for entry in manifest if entry.tag.endswith("depend")]
    packages = {name for name in named if name in ROS | RELEASED or name.endswith(("_msgs", "_interfaces", "_srvs"))}
    assert len(named) == len(set(named))
    assert set(named) - packages == set(KEYS.values())


def test_requirements_without_a_key_are_named_for_pip(root: Path) -> None:
    """Each package that the node needs has a key in package.xml, or is named there with pip."""
    text = (root / "package.xml").read_text(encoding="utf-8")
    needed = {name for name in metadata.requires("gdfe_ros") if "extra" not in name or 'extra == "mcap"' in name}
    names = {re.match(r"[\w-]+", name)[0].lower() for name in needed}
    assert {"numpy", "mcap", "lz4"} <= names
    comments = " ".join(re.findall(r"<!--(.*?)-->", text, re.DOTALL))
    assert [name for name in names if KEYS.get(name, "-") not in text and name not in comments] == []


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
