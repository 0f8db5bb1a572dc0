# SPDX-License-Identifier: Apache-2.0
"""Which package a node's process runs."""

from __future__ import annotations

from pathlib import Path

import pytest

from gdfe_ros.testing import NodeProcess


def _other_package(home: Path) -> Path:
    """Write a package of the same name whose node prints where it is, and return its directory."""
    path = home / "gdfe_ros" / "node" / "__main__.py"
    path.parent.mkdir(parents=True)
    for folder in path.parents[:2]:
        (folder / "__init__.py").touch()
    path.write_text("print(__file__)\n", encoding="utf-8")
    return home


def test_the_package_of_another_directory_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """From the root of this package, too, a node of another directory runs that directory's package.

    Before, Python's ``-m`` found this package in the working directory first.
    """
    monkeypatch.chdir(Path(__file__).parents[2])
    home = _other_package(tmp_path)
    with NodeProcess(home=home) as node:
        assert node.wait() == 0
        assert str(home) in node.log
