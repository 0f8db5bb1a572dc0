# SPDX-License-Identifier: Apache-2.0
"""The check for installed message packages."""

from __future__ import annotations

from pathlib import Path

import pytest

from gdfe_ros.node.middleware.ros_types import is_installed


def test_a_folder_of_the_same_name_is_no_installed_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A folder with a package's name on Python's path is not an installed package; the built package is."""
    (tmp_path / "made_msgs" / "action").mkdir(parents=True)
    monkeypatch.syspath_prepend(tmp_path)
    assert not is_installed("made_msgs/action/Made")
    assert not is_installed("missing_msgs/action/Made")
    (tmp_path / "made_msgs" / "action" / "__init__.py").touch()
    monkeypatch.syspath_prepend(tmp_path)  # Python forgets what it knows of the folder
    assert is_installed("made_msgs/action/Made")
