# SPDX-License-Identifier: Apache-2.0
"""The projects of ``examples/``: the commands of each README run, in a copy of the folder."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"
PROJECTS = sorted(path.parent.name for path in EXAMPLES.glob("*/README.md"))


def test_the_list_names_every_project() -> None:
    """The list links to each of the six projects, and each has a README of about ten lines."""
    listed = re.findall(r"\]\((\w+)/README\.md\)", (EXAMPLES / "README.md").read_text(encoding="utf-8"))
    assert sorted(listed) == PROJECTS
    assert len(PROJECTS) == 6
    assert all(len((EXAMPLES / name / "README.md").read_text().splitlines()) <= 16 for name in PROJECTS)


@pytest.mark.parametrize("name", PROJECTS)
def test_a_project_runs(name: str, tmp_path: Path) -> None:
    """The commands of the README end with success; the project checks its own results."""
    folder = tmp_path / name
    shutil.copytree(EXAMPLES / name, folder, ignore=shutil.ignore_patterns("__pycache__"))
    text = (folder / "README.md").read_text(encoding="utf-8")
    (commands,) = re.findall(r"```sh\n(.*?)```", text, re.DOTALL)
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    done = subprocess.run(
        ["bash", "-e", "-c", commands], cwd=folder, env={**os.environ, "PATH": path}, capture_output=True, text=True
    )
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"
