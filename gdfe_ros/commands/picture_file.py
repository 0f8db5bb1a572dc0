# SPDX-License-Identifier: Apache-2.0
"""Check that a picture can be written, before the work that it shows."""

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
    if path.is_dir():
        raise GdfeError(f"--picture {path}: this is a folder; remedy: the path of a file in it, e.g. {path}/body.png")
    if not path.parent.is_dir():
        raise GdfeError(f"--picture {path}: there is no folder {path.parent}; remedy: make it, or another path")
