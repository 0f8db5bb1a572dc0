# SPDX-License-Identifier: Apache-2.0
"""The script of docs/node.md that replaces a launch file where ROS comes as wheels."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

PAGE = (Path(__file__).parents[2] / "docs" / "node.md").read_text(encoding="utf-8")
SCRIPT = re.search(r"```bash\n(sim_node [^`]+trap[^`]+)```", PAGE)[1]


def _run(script: str) -> subprocess.CompletedProcess[str]:
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    return subprocess.run(
        ["bash", "-c", script],
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
        env={**os.environ, "PATH": path},
    )


def test_the_script_starts_commands_and_ends_a_node() -> None:
    """The script commands a tension, prints the tip, and its end leaves no node behind."""
    done = _run(SCRIPT + "echo pid $node\n")
    assert done.returncode == 0, done.stderr
    assert "position: {x: 0.0" in done.stdout
    with pytest.raises(ProcessLookupError):
        os.kill(int(re.search(r"pid (\d+)", done.stdout)[1]), 0)


def test_the_script_ends_if_the_scene_is_missing() -> None:
    """With a scene that does not exist, the script ends with status 1 instead of waiting for ever."""
    done = _run(SCRIPT.replace("tendon_finger", "nosuch"))
    assert done.returncode == 1
    assert "does not exist" in done.stderr
