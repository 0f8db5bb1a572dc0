# SPDX-License-Identifier: Apache-2.0
"""A release: the sdist, the wheel that is built from it, its requirements, and its installation."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import sysconfig
import zipfile
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import pytest

import gdfe_ros

QUICK = {"NUMBA_DISABLE_JIT": "1"}
"""Environment of a command that compiles nothing, which would take a minute."""


@pytest.fixture(scope="module")
def wheel(source_copy: Path, tmp_path_factory: pytest.TempPathFactory, run: Callable[..., str]) -> Path:
    """Return the package as a wheel, which is built from the sdist beside it."""
    place = tmp_path_factory.mktemp("release")
    run(sys.executable, "-m", "build", "--outdir", place, source_copy)
    (sdist,), (wheel,) = place.glob("*.tar.gz"), place.glob("*.whl")
    assert sdist.name == f"gdfe_ros-{gdfe_ros.__version__}.tar.gz"
    assert wheel.name == f"gdfe_ros-{gdfe_ros.__version__}-py3-none-any.whl"
    return wheel


@pytest.fixture(scope="module")
def requirements(wheel: Path) -> list[str]:
    """Return the requirement lines of the wheel's metadata."""
    with zipfile.ZipFile(wheel) as archive:
        name = next(name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
        text = archive.read(name).decode()
    return re.findall(r"^Requires-Dist: (.*)$", text, re.MULTILINE)


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory, run: Callable[..., str]) -> Path:
    """Return the bin folder of an environment with only the wheel; its dependencies are those of the tests."""
    place = tmp_path_factory.mktemp("venv")
    run(sys.executable, "-m", "venv", "--without-pip", place)
    packages = sysconfig.get_path("purelib", vars={"base": str(place), "platbase": str(place)})
    # A path in a .pth file is searched, but its own .pth files, and with them an editable install, are not read.
    Path(packages, "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n")
    pip = sys.executable, "-m", "pip", "--python", place / "bin" / "python"
    run(*pip, "install", "--quiet", "--no-deps", "--no-index", "--ignore-installed", wheel)
    return place / "bin"


def test_the_wheel_holds_the_package_and_its_share_files_only(wheel: Path, root: Path) -> None:
    """The wheel has exactly the package and share files, also of directories without __init__.py and nested ones."""
    with zipfile.ZipFile(wheel) as archive:
        names = {name for name in archive.namelist() if ".dist-info/" not in name}
    modules = {str(path.relative_to(root)) for path in (root / "gdfe_ros").rglob("*.py")}
    pages = {
        str(path.relative_to(root)) for path in (root / "gdfe_ros/analysis/report/page").iterdir() if path.is_file()
    }
    share = f"{wheel.name.removesuffix('-py3-none-any.whl')}.data/data/share"
    files = [path for part in ("config", "launch") for path in (root / part).rglob("*") if path.is_file()]
    shared = {f"{share}/gdfe_ros/{path.relative_to(root)}" for path in files if path.suffix != ".pyc"}
    index = {f"{share}/gdfe_ros/package.xml", f"{share}/ament_index/resource_index/packages/gdfe_ros"}
    assert names == modules | pages | shared | index
    assert f"{share}/gdfe_ros/config/scenes/bend5.yaml" in shared
    assert not [name for name in names if "bench" in name or "torture" in name]


def test_an_installed_package_finds_its_files(installed: Path, run: Callable[..., str]) -> None:
    """Every installed module can be imported, and a scene and the launch files are found."""
    code = """
import importlib, pkgutil
import gdfe_ros
from gdfe_ros.installation import share_dir
for module in pkgutil.walk_packages(gdfe_ros.__path__, "gdfe_ros."):
    if not module.name.endswith(("__main__", "preloaded")):  # the latter compiles
        importlib.import_module(module.name)
print(gdfe_ros.__file__)
print(gdfe_ros.load_scene("bend5").path)
print(*sorted(path.name for path in (share_dir() / "launch").iterdir()))
"""
    module, scene, launch = run(installed / "python", "-c", code).splitlines()
    place = installed.parent
    assert Path(module).is_relative_to(place)
    assert Path(scene) == place / "share" / "gdfe_ros" / "config" / "scenes" / "bend5.yaml"
    assert {"sim.launch.py", "robots.launch.py", "control_loop.launch.py"} <= set(launch.split())


@pytest.fixture
def small(tmp_path: Path) -> Path:
    """Return the path of a scene of three cells."""
    scene = tmp_path / "small.yaml"
    scene.write_text(
        "name: small\n"
        "mesh: {bar: {size: [0.2, 0.05, 0.05], cells: [3, 1, 1]}}\n"
        "materials: {m: {law: linear, young: 1.0e5, poisson: 0.3}}\n"
        "regions: [{material: m}]\n"
        "handles: {base: {where: {face: x-}, fixed: true}, tip: {where: {face: x+}}}\n"
        "program: {duration: 0.03, handles: {tip: [{time: 0.0}, {time: 0.03, translation: [0, 0, 0.01]}]}}\n"
    )
    return scene


def test_installed_commands_run(installed: Path, small: Path, tmp_path: Path, run: Callable[..., str]) -> None:
    """The installed commands solve a scene, and play it through the node into a bag, which replays."""
    assert "converged" in run(installed / "gdfe", "solve", small, **QUICK)
    run(installed / "gdfe", "demo", small, "--out", tmp_path / "run", **QUICK)
    (bag,) = (path.parent for path in (tmp_path / "run").rglob("metadata.yaml"))
    run(installed / "gdfe", "replay", bag, **QUICK)
    assert (installed / "sim_node").is_file()
    assert (installed / "tip_tracking").is_file()
    assert (installed / "carrying_arm").is_file()


def test_the_extra_ros_alone_gives_a_running_node(
    wheel: Path, small: Path, tmp_path: Path, run: Callable[..., str]
) -> None:
    """The wheel with the extra `ros`, from the registry into an empty environment, has a node that takes commands."""
    run(sys.executable, "-m", "venv", "--without-pip", tmp_path / "venv")
    programs = tmp_path / "venv" / "bin"
    pip = sys.executable, "-m", "pip", "--python", programs / "python"
    run(*pip, "install", "--quiet", "--no-compile", f"{wheel}[ros]")
    command = [programs / "sim_node", "--ros-args", "-p", f"scene:={small}", "-p", "required:=true"]
    given = {"env": {**os.environ, **QUICK}, "cwd": "/", "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen(command, **given) as node:
        try:
            assert any("active, clock wall" in line for line in node.stderr)  # a busy machine imports for a minute
            assert run(programs / "gdfe", "echo", "/gdfe_sim/step_record")
            target = "{pose: {position: {z: 0.01}, orientation: {w: 1.0}}}"
            run(programs / "gdfe", "pub", "/gdfe_sim/handles/tip/target", target)
            assert "active; transitions" in run(programs / "gdfe", "lifecycle", "/gdfe_sim")
        finally:
            node.send_signal(signal.SIGINT)
        assert node.wait(60) == 0


@pytest.mark.slow
def test_a_wheel_installs_with_its_dependencies(wheel: Path, tmp_path: Path, run: Callable[..., str]) -> None:
    """The wheel with extras, installed from the registry into an empty environment, has working commands."""
    run(sys.executable, "-m", "venv", tmp_path / "venv")
    programs = tmp_path / "venv" / "bin"
    run(programs / "python", "-m", "pip", "install", "--quiet", f"{wheel}[ros,mcap,fast,plot]")
    assert "converged" in run(programs / "gdfe", "solve", "bend5")
    run(programs / "gdfe", "demo", "bend5", "--out", tmp_path / "run")
    assert list((tmp_path / "run").rglob("*.mcap"))


def test_ros_is_asked_for_by_its_extra_only(requirements: list[str]) -> None:
    """The ROS wheels are required with exact versions, and only by their extra."""
    ros = [line for line in requirements if line.startswith("ros-")]
    assert len(ros) == 3
    for line in ros:
        assert "==" in line
        assert 'extra == "ros"' in line


def test_the_changelog_gives_a_reason_for_each_dependency(requirements: list[str], root: Path) -> None:
    """CHANGELOG.md names every required package."""
    changelog = (root / "CHANGELOG.md").read_text().lower()
    names = [re.match(r"[\w.-]+", line)[0].lower().removeprefix("ros-jazzy") for line in requirements]
    assert [name for name in names if name not in changelog] == []


def test_versions_agree(root: Path) -> None:
    """package.xml and the module have the same version."""
    assert ElementTree.parse(root / "package.xml").findtext("version") == gdfe_ros.__version__
