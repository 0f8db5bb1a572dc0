# SPDX-License-Identifier: Apache-2.0
"""Check that a file can be written, before the work whose result it gets."""

from __future__ import annotations

from pathlib import Path

from gdfe_ros.errors import GdfeError


def require_picture(path: Path | None) -> None:
    """Raise an error if the folder of a picture is missing, or its format is unknown; None is no picture.

    Raises:
        GdfeError: the error names the file, and the allowed formats or the remedy.
    """
    if path is None:
        return
    from matplotlib.backend_bases import FigureCanvasBase  # matplotlib takes a second to import

    known = FigureCanvasBase.filetypes
    if path.suffix and path.suffix[1:].lower() not in known:
        allowed = ", ".join(f".{name}" for name in sorted(known))
        raise GdfeError(f"--picture {path}: unknown format {path.suffix!r}; allowed: {allowed}")
    require_folder("--picture", path)


def require_folder(option: str, path: Path | None) -> None:
    """Raise an error if a file has no folder, or is one itself; None is no file.

    Raises:
        GdfeError: the error names the option, the file, and the remedy.
    """
    if path is None:
        return
    if path.is_dir():
        raise GdfeError(f"{option} {path}: this is a folder; remedy: the path of a file in it")
    if not path.parent.is_dir():
        raise GdfeError(f"{option} {path}: there is no folder {path.parent}; remedy: make it, or another path")
