# SPDX-License-Identifier: Apache-2.0
"""Which package a node's process runs."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.node import kills
from gdfe_ros.testing import NodeProcess


def _other_package(home: Path) -> Path:
    """Write a package of the same name whose node and command print where they are, and return its directory."""
    for module in ("node/__main__.py", "cli.py"):
        path = home / "gdfe_ros" / module
        path.parent.mkdir(parents=True, exist_ok=True)
        (path.parent / "__init__.py").touch()
        path.write_text("print('bit-identical, 7 steps', __file__)\n", encoding="utf-8")
    return home


def test_the_package_of_another_directory_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """From the root of this package, too, a node of another directory runs that directory's package.

    Before, Python's ``-m`` found this package in the working directory first, and `make bench-node-since` compared this
    tree with itself.
    """
    monkeypatch.chdir(Path(__file__).parents[2])
    home = _other_package(tmp_path)
    with NodeProcess(home=home) as node:
        assert node.wait() == 0
        assert str(home) in node.log
    assert str(home) in kills._gdfe(home, "replay").stdout
