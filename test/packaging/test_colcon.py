# SPDX-License-Identifier: Apache-2.0
"""The tree builds with colcon, and ROS tools find the result.

colcon comes from the registry into its own environment (it needs setuptools below 80), which pytest's cache directory
keeps between runs. The Python that runs the tests then uses the built package, as after sourcing a workspace.
"""

from __future__ import annotations

import os
import re
import shutil
import sys
import sysconfig
from collections.abc import Callable
from pathlib import Path

import pytest


@pytest.fixture(scope="module")
def colcon(pytestconfig: pytest.Config, run: Callable[..., str]) -> Path:
    """Return a colcon executable."""
    place = pytestconfig.cache.mkdir(f"colcon-{sys.version_info.major}.{sys.version_info.minor}")
    done = place / "installed"
    if not done.exists():
        run(sys.executable, "-m", "venv", "--clear", "--without-pip", place)
        pip = sys.executable, "-m", "pip", "--python", place / "bin" / "python"
        run(*pip, "install", "--quiet", "--no-compile", "setuptools<80", "colcon-common-extensions")
        # As in a ROS 2, colcon's Python has pytest and what the package needs; a .pth file is searched last.
        packages = sysconfig.get_path("purelib", vars={"base": str(place), "platbase": str(place)})
        Path(packages, "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n")
        done.touch()
    return place / "bin" / "colcon"


@pytest.fixture(scope="module", params=[(), ("--symlink-install",)], ids=["copied", "symlinked"])
def workspace(
    request: pytest.FixtureRequest,
    colcon: Path,
    source_copy: Path,
    tmp_path_factory: pytest.TempPathFactory,
    run: Callable[..., str],
) -> Path:
    """Return a built workspace."""
    place = tmp_path_factory.mktemp("workspace")
    bases = ["--base-paths", source_copy, "--build-base", place / "build", "--install-base", place / "install"]
    output = run(colcon, "--log-base", place / "log", "build", *bases, *request.param)
    assert "1 package finished" in output
    return place


@pytest.fixture
def in_workspace(workspace: Path, run: Callable[..., str]) -> Callable[[str], str]:
    """Give a function that runs Python code after sourcing the workspace's setup.bash."""

    def call(code: str) -> str:
        script = f'source "{workspace}/install/setup.bash" && exec "$0" -c "$1"'
        return run("bash", "-c", script, sys.executable, code).strip()

    return call


def test_ament_index_finds_the_package(workspace: Path, in_workspace: Callable[[str], str]) -> None:
    """With the workspace sourced, the ament index has the package's share directory."""
    found = in_workspace(
        "from ament_index_python.packages import get_package_share_directory as find; print(find('gdfe_ros'))"
    )
    assert Path(found) == workspace / "install" / "gdfe_ros" / "share" / "gdfe_ros"


def test_executables_lie_where_ros2_run_looks(workspace: Path) -> None:
    """Both commands are executables in lib/gdfe_ros."""
    place = workspace / "install" / "gdfe_ros" / "lib" / "gdfe_ros"
    programs = {file.name for file in place.iterdir() if os.access(file, os.X_OK)}
    assert programs == {"gdfe", "sim_node", "tip_tracking", "carrying_arm"}


def test_share_holds_scenes_parameters_and_launch_files(workspace: Path, root: Path) -> None:
    """The package's share directory has every file of config/ and launch/."""
    share = workspace / "install" / "gdfe_ros" / "share" / "gdfe_ros"
    for part in ("config", "launch"):
        files = [p.relative_to(root) for p in (root / part).rglob("*") if p.suffix in {".yaml", ".csv", ".py"}]
        assert files
        assert [name for name in files if not (share / name).is_file()] == []


def test_the_built_package_finds_its_scenes(workspace: Path, in_workspace: Callable[[str], str]) -> None:
    """The built package loads a scene by name from its own files."""
    code = "import gdfe_ros; print(gdfe_ros.__file__); print(gdfe_ros.load_scene('bend5').path)"
    module, scene = (Path(line).resolve() for line in in_workspace(code).splitlines())
    assert scene.name == "bend5.yaml"
    assert module.parent.parent in scene.parents or workspace in scene.parents


def test_the_command_starts(workspace: Path, in_workspace: Callable[[str], str]) -> None:
    """The installed command's script starts and prints help."""
    script = workspace / "install" / "gdfe_ros" / "lib" / "gdfe_ros" / "gdfe"
    start = f"sys.argv = ['gdfe', '--help']; runpy.run_path({str(script)!r}, run_name='__main__')"
    assert "solve" in in_workspace(f"import runpy, sys; {start}")


def test_colcon_tests_the_package(
    colcon: Path, workspace: Path, source_copy: Path, root: Path, run: Callable[..., str]
) -> None:
    """``colcon test`` runs the package's tests with pytest, and ``colcon test-result`` counts them."""
    (source_copy / "test").mkdir(exist_ok=True)
    shutil.copy(root / "test" / "untrusted" / "test_spelling.py", source_copy / "test")
    build = workspace / "build"
    bases = "--base-paths", source_copy, "--build-base", build, "--install-base", workspace / "install"
    run(colcon, "--log-base", workspace / "log", "test", *bases, "--return-code-on-test-failure")
    summary = run(colcon, "test-result", "--test-result-base", build)
    assert re.fullmatch(r"Summary: [1-9]\d* tests?, 0 errors, 0 failures, 0 skipped\n", summary)
