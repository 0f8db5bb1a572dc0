# SPDX-License-Identifier: Apache-2.0
"""Check that a path is a file."""

from __future__ import annotations

from pathlib import Path

from gdfe_ros.errors import MeshError


def require_file(path: Path, heading: str) -> None:
    """Raise an error under ``heading`` if a path is not a file.

    Raises:
        MeshError: the path is a folder, or there is nothing.
    """
    if path.is_dir():
        raise MeshError(heading, ["this is a folder; remedy: the path of a file in it"])
    if not path.is_file():
        raise MeshError(heading, ["there is no such file; paths in a scene are relative to the folder of the scene"])
