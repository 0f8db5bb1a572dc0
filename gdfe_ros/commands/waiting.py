# SPDX-License-Identifier: Apache-2.0
"""A line of text that shows the present task of a command during a long wait."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Event, Thread, Timer
from typing import TYPE_CHECKING, Any

from gdfe_ros.compilations import compilations

if TYPE_CHECKING:
    from rich.console import Console

SILENT = 1.0
"""Time [s] before the text appears at a terminal; most scenes are ready earlier."""
INTERVAL = 10.0
"""Time [s] between two lines where standard error is no terminal."""


@contextmanager
def waiting(
    text: str, *, console: Console | None = None, silent: float = SILENT, interval: float = INTERVAL
) -> Iterator[None]:
    """Show a text and the elapsed time while the body of the `with` statement runs.

    A terminal shows one line, which is removed at the end. A file or pipe receives a line every ten seconds. While
    kernels are compiled, the line says so instead.

    Args:
        text: what is being done, e.g. "loading gripper".
        console: console to write to; by default that of standard error.
        silent: time before the text appears at a terminal [s].
        interval: time between two lines where the console is no terminal [s].
    """
    terminal = sys.stderr.isatty() if console is None else console.is_terminal
    with _at_a_terminal(text, console, silent) if terminal else _in_a_file(text, console, interval):
        yield


@contextmanager
def _at_a_terminal(text: str, console: Console | None, silent: float) -> Iterator[None]:
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
    from rich.text import Text

    from gdfe_ros.terminal import PlainConsole

    class Task(TextColumn):
        """The text, or a line about kernels while they are compiled."""

        def render(self, task: Any) -> Any:
            return Text(compilations.text() or task.description)

    columns = SpinnerColumn(), Task(""), TimeElapsedColumn()
    progress = Progress(*columns, console=console or PlainConsole(stderr=True), transient=True)
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


@contextmanager
def _in_a_file(text: str, console: Console | None, interval: float) -> Iterator[None]:
    ended, started, file = Event(), time.monotonic(), sys.stderr if console is None else console.file

    def write() -> None:
        while not ended.wait(interval):
            print(f"{compilations.text() or text} ({time.monotonic() - started:.0f} s)", file=file, flush=True)

    thread = Thread(target=write, name="waiting", daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()
