# SPDX-License-Identifier: Apache-2.0
"""A copy of the source tree to build from, so that builds change nothing in the tree."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PARTS = [
    "setup.py",
    "setup.cfg",
    "pyproject.toml",
    "package.xml",
    "LICENSE",
    "README.md",
    "gdfe_ros",
    "config",
    "launch",
    "resource",
]


@pytest.fixture(scope="session")
def root() -> Path:
    """Return the source tree."""
    return ROOT


@pytest.fixture(scope="module")
def source_copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a fresh copy of all build inputs, without caches and build products."""
    copy = tmp_path_factory.mktemp("source") / "gdfe_ros"
    copy.mkdir()
    for name in PARTS:
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(source, copy / name, ignore=shutil.ignore_patterns("__pycache__", "*.egg-info"))
        else:
            shutil.copy(source, copy / name)
    return copy


@pytest.fixture(scope="session")
def run() -> Callable[..., str]:
    """Give a function that runs a command outside of the source tree and returns its output."""

    def call(*command: object, **environment: str) -> str:
        inherited = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
        done = subprocess.run(
            [str(word) for word in command],
            cwd="/",
            env=inherited | environment,
            capture_output=True,
            text=True,
            timeout=900,  # a registry and a machine may be slow
            check=False,
        )
        assert done.returncode == 0, f"{command}\n{done.stdout}\n{done.stderr}"
        return done.stdout

    return call
