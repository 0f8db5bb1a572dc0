# SPDX-License-Identifier: Apache-2.0
"""What ``pip install .`` installs, and what it asks for."""

from __future__ import annotations

import re
import sys
import sysconfig
import zipfile
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import pytest

import gdfe_ros


@pytest.fixture(scope="module")
def wheel(source_copy: Path, tmp_path_factory: pytest.TempPathFactory, run: Callable[..., str]) -> Path:
    """Give the package as a wheel."""
    place = tmp_path_factory.mktemp("wheel")
    run(sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", place, source_copy)
    return next(place.glob("gdfe_ros-*.whl"))


@pytest.fixture(scope="module")
def requirements(wheel: Path) -> list[str]:
    """Give the lines of the wheel's metadata that name a requirement."""
    with zipfile.ZipFile(wheel) as archive:
        name = next(name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
        text = archive.read(name).decode()
    return re.findall(r"^Requires-Dist: (.*)$", text, re.MULTILINE)


def test_every_module_and_share_file_is_in_the_wheel(wheel: Path, root: Path) -> None:
    """Compare wheel and tree: a directory without __init__.py, or a flat glob, would leave files out."""
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
    modules = {str(path.relative_to(root)) for path in (root / "gdfe_ros").rglob("*.py")}
    assert modules <= names
    share = f"{wheel.name.removesuffix('-py3-none-any.whl')}.data/data/share"
    files = [path for part in ("config", "launch") for path in (root / part).rglob("*") if path.is_file()]
    shared = {f"{share}/gdfe_ros/{path.relative_to(root)}" for path in files if path.suffix != ".pyc"}
    assert shared <= names
    assert f"{share}/gdfe_ros/config/scenes/bend5.yaml" in shared
    assert f"{share}/gdfe_ros/package.xml" in names
    assert f"{share}/ament_index/resource_index/packages/gdfe_ros" in names


def test_an_installed_package_finds_its_scenes(wheel: Path, tmp_path: Path, run: Callable[..., str]) -> None:
    """Install the wheel into a prefix and load a scene by its name from there."""
    # Without --ignore-installed pip would take the package out of the environment that runs this test.
    options = "--quiet", "--no-deps", "--ignore-installed", "--prefix", tmp_path
    run(sys.executable, "-m", "pip", "install", *options, wheel)
    packages = sysconfig.get_path("purelib", vars={"base": str(tmp_path), "platbase": str(tmp_path)})
    code = "import gdfe_ros; print(gdfe_ros.__file__); print(gdfe_ros.load_scene('bend5').path)"
    module, scene = run(sys.executable, "-c", code, PYTHONPATH=packages).splitlines()
    assert Path(module) == Path(packages) / "gdfe_ros" / "__init__.py"
    assert Path(scene) == tmp_path / "share" / "gdfe_ros" / "config" / "scenes" / "bend5.yaml"


def test_ros_is_asked_for_by_its_extra_only(requirements: list[str]) -> None:
    """Find the ROS wheels pinned exactly, and never without the extra."""
    ros = [line for line in requirements if line.startswith("ros-")]
    assert len(ros) == 3
    for line in ros:
        assert "==" in line
        assert 'extra == "ros"' in line


def test_the_changelog_gives_a_reason_for_each_dependency(requirements: list[str], root: Path) -> None:
    """Look every required package up in CHANGELOG.md."""
    changelog = (root / "CHANGELOG.md").read_text().lower()
    names = [re.match(r"[\w.-]+", line)[0].lower().removeprefix("ros-jazzy") for line in requirements]
    assert [name for name in names if name not in changelog] == []


def test_versions_agree(root: Path) -> None:
    """Hold package.xml and the module to one version."""
    assert ElementTree.parse(root / "package.xml").findtext("version") == gdfe_ros.__version__
