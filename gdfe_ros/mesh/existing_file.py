# SPDX-License-Identifier: Apache-2.0
"""Check that a path is a file."""

from __future__ import annotations

from pathlib import Path

from gdfe_ros.errors import MeshError
from gdfe_ros.regular_file import defect_of, require_regular

LARGEST = 500_000_000
"""Largest size of a mesh file [bytes]."""


def require_file(path: Path, heading: str) -> None:
    """Raise an error under ``heading`` if a path is no regular file, or a too large one.

    Raises:
        MeshError: the path is a folder, a pipe or a device, or there is nothing, or the file is too large.
    """
    if defect := defect_of(path):
        raise MeshError(heading, [f"no file can have this path: {defect}"])
    if path.is_dir():
        raise MeshError(heading, ["this is a folder; remedy: the path of a file in it"])
    if not path.exists():
        raise MeshError(heading, ["there is no such file; paths in a scene are relative to the folder of the scene"])
    try:
        require_regular(path, most=LARGEST)
    except OSError as error:
        raise MeshError(heading, [f"{error}; remedy: the path of a mesh file"]) from error
