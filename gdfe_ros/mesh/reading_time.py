# SPDX-License-Identifier: Apache-2.0
"""Limit of the time that another library may take to read a file; some loop for ever at the end of a damaged one."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

LEAST, EACH_MEGABYTE = 5.0, 5.0
"""Time that a file may take [s], and further time for each of its megabytes [s]."""


@contextmanager
def limited_time(path: Path) -> Iterator[None]:
    """Raise an error inside of the ``with`` block, at its next call of a function, after the time for a file is over.

    Raises:
        TimeoutError: the time is over.
    """
    most = LEAST + EACH_MEGABYTE * 1e-6 * path.stat().st_size
    end, before = time.monotonic() + most, sys.getprofile()

    def check(frame: FrameType, event: str, argument: object) -> None:
        if time.monotonic() > end:
            raise TimeoutError(f"it takes more than {most:.3g} s")

    sys.setprofile(check)
    try:
        yield
    finally:
        sys.setprofile(before)
