# SPDX-License-Identifier: Apache-2.0
"""Files that cannot be written are refused in one line."""

from __future__ import annotations

from pathlib import Path

import pytest

from gdfe_ros.commands.options import require_folder, require_picture
from gdfe_ros.errors import GdfeError


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("x.foo", "unknown format '.foo'; allowed: .* .png, "),
        ("missing/x.png", "there is no folder .*missing; remedy: make it"),
        ("", "this is a folder; remedy: the path of a file in it"),
    ],
)
def test_an_unfit_path_is_refused(name: str, told: str, tmp_path: Path) -> None:
    """An unknown format, a missing folder and a folder are refused with what is allowed."""
    with pytest.raises(GdfeError, match=told) as caught:
        require_picture(tmp_path / name)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["x.png", "x.SVG", "x"])
def test_a_fit_path_is_accepted(name: str, tmp_path: Path) -> None:
    """Known formats in either case, a path without a suffix, and no picture are accepted."""
    assert require_picture(tmp_path / name) is None
    assert require_picture(None) is None


def test_a_result_without_a_folder_is_refused(tmp_path: Path) -> None:
    """The folder of --out is checked before the solve."""
    with pytest.raises(GdfeError, match=r"--out .*x\.npz: there is no folder .*missing; remedy: make it"):
        require_folder("--out", tmp_path / "missing" / "x.npz")
    assert require_folder("--out", tmp_path / "x.npz") is None
