# SPDX-License-Identifier: Apache-2.0
"""Animations from pictures: a GIF, or an mp4 video."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path

from PIL import Image

from gdfe_ros.errors import GdfeError

SECONDS = 4
"""Duration of an animation [s]."""
_QUALITY = "18"
"""Constant rate factor of H.264, without visible loss."""


def write_gif(pictures: Sequence[Image.Image], path: Path) -> Path:
    """Write a GIF that repeats forever.

    Raises:
        OSError: the file cannot be written.
    """
    first, *others = (picture.convert("P", palette=Image.Palette.ADAPTIVE) for picture in pictures)
    duration = round(1000 * SECONDS / len(pictures))
    first.save(path, save_all=True, append_images=others, duration=duration, loop=0)
    return path


def require_video() -> None:
    """Check that videos can be written.

    Raises:
        GdfeError: PyAV is not installed.
    """
    try:
        import av  # noqa: F401
    except ModuleNotFoundError as error:
        raise GdfeError("an mp4 needs PyAV, which is not installed; remedy: pip install 'gdfe_ros[video]'") from error


def write_mp4(pictures: Sequence[Image.Image], path: Path) -> Path:
    """Write an H.264 video for browsers and slides; they require even sizes, so an odd last row or column is dropped.

    Raises:
        GdfeError: PyAV is not installed.
        OSError: the file cannot be written.
    """
    require_video()
    import av

    width, height = (side // 2 * 2 for side in pictures[0].size)
    with av.open(str(path), "w", format="mp4") as container:
        stream = container.add_stream("libx264", rate=Fraction(len(pictures), SECONDS), options={"crf": _QUALITY})
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
        for picture in pictures:
            container.mux(stream.encode(av.VideoFrame.from_image(picture.crop((0, 0, width, height)))))
        container.mux(stream.encode())
    return path
