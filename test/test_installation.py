# SPDX-License-Identifier: Apache-2.0
"""A missing extra is named in one line."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

from gdfe_ros.installation import _EXTRAS, extra_of
from test.written import run_python

ROOT = Path(__file__).parents[1]
# Python without some modules: no finder finds them, as if they were not installed.
_WITHOUT = """
import sys
class Without:
    def __init__(self, finder):
        self.finder = finder
    def __getattr__(self, name):
        return getattr(self.finder, name)
    def find_spec(self, name, path=None, target=None):
        return None if name.partition(".")[0] in {modules!r} else self.finder.find_spec(name, path, target)
sys.meta_path[:] = map(Without, sys.meta_path)
sys.argv[1:] = {arguments!r}
"""
ENTRY = "from gdfe_ros import entry\nsys.exit(entry.gdfe())"
_ROS = ("rclpy", "geometry_msgs", "sensor_msgs", "std_msgs", "rcl_interfaces", "lifecycle_msgs")


def _run(modules: tuple[str, ...], arguments: list[str], code: str) -> subprocess.CompletedProcess[str]:
    return run_python(_WITHOUT.format(modules=modules, arguments=arguments) + code)


@pytest.mark.parametrize(
    ("script", "arguments", "modules", "extra"),
    [
        ("sim_node", [], _ROS, "ros"),
        ("tip_tracking", [], _ROS, "ros"),
        ("gdfe", ["pub", "/topic"], _ROS, "ros"),
        ("gdfe", ["echo", "/topic"], _ROS, "ros"),
        ("gdfe", ["call", "/service"], _ROS, "ros"),
        ("gdfe", ["params", "/node"], _ROS, "ros"),
        ("gdfe", ["demo", "bend5"], _ROS, "ros"),
        ("gdfe", ["replay", "bags/bend5"], ("mcap", "rosbags"), "mcap"),
        ("gdfe", ["live", "bend5"], ("viser",), "live"),
    ],
)
def test_a_command_names_the_one_extra(script: str, arguments: list[str], modules: tuple[str, ...], extra: str) -> None:
    """A command without its extra ends with one line that names it, and status 2."""
    done = _run(modules, arguments, f"from gdfe_ros import entry\nsys.exit(entry.{script}())")
    assert done.returncode == 2, done.stderr
    assert re.fullmatch(r"[^\n]+\n", done.stderr), done.stderr
    assert re.findall(r"gdfe_ros\[([^\]]*)\]", done.stderr) == [extra]
    assert done.stderr.startswith(" ".join([script, *arguments[:1]]) + ":")


@pytest.mark.parametrize(
    ("command", "extras"), [(["demo", "bend5"], "ros,mcap,plot"), (["report", "bags/bend5"], "mcap,plot")]
)
def test_a_command_names_all_that_it_misses(command: list[str], extras: str) -> None:
    """Without any extra, a command that needs several names them in one line."""
    done = _run((*_ROS, "mcap", "lz4", "zstandard", "rosbags", "matplotlib", "plotly", "PIL"), command, ENTRY)
    assert done.returncode == 2, done.stderr
    assert re.fullmatch(
        rf"gdfe {command[0]}: needs [^\n]*; remedy: pip install 'gdfe_ros\[{extras}\]'[^\n]*\n", done.stderr
    )


@pytest.mark.parametrize(
    ("name", "modules", "extra"), [("Simulator", _ROS, "ros"), ("make_env", ("gymnasium",), "gym")]
)
def test_a_public_name_names_the_one_extra(name: str, modules: tuple[str, ...], extra: str) -> None:
    """The error of a name of `gdfe_ros.testing` names the extra that it needs."""
    done = _run(modules, [], f"from gdfe_ros.testing import {name}")
    assert re.findall(r"gdfe_ros\[([^\]]*)\]", done.stderr.splitlines()[-1]) == [extra]


def test_every_extra_exists() -> None:
    """The extras that errors name are those of setup.py."""
    text = (ROOT / "setup.py").read_text(encoding="utf-8")
    assert all(f'"{extra}": [' in text for extra in [*_EXTRAS, extra_of("sensor_msgs")])
