# SPDX-License-Identifier: Apache-2.0
"""A line of text at the terminal while a command is waiting."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Timer
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console

SILENT = 1.0
"""Time [s] before the text appears; most scenes are loaded earlier."""


@contextmanager
def waiting(text: str, *, console: Console | None = None, silent: float = SILENT) -> Iterator[None]:
    """Show a text and the elapsed time during a ``with`` block; remove both at its end.

    Nothing is shown if standard error is not a terminal.

    Args:
        text: description of the work, e.g. "loading gripper".
        console: console for the text; by default that of standard error.
        silent: time before the text appears [s].
    """
    if not (sys.stderr.isatty() if console is None else console.is_terminal):
        yield
        return
    from rich.console import Console
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn()
    progress = Progress(*columns, console=console or Console(stderr=True), transient=True)
    progress.add_task(text, total=None)
    timer = Timer(silent, progress.start)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        timer.join()
        progress.stop()
