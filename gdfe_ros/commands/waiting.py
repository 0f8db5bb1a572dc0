# SPDX-License-Identifier: Apache-2.0
"""Texts that show the present task of a command during a long wait."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from threading import Event, Thread
from typing import TYPE_CHECKING, Any, TypeAlias

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    SpinnerColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from gdfe_ros.compiling.compilations import compilations
from gdfe_ros.untrusted.terminal import PlainConsole

if TYPE_CHECKING:
    from gdfe_ros.recording.step import StepRecord
    from gdfe_ros.results.step_result import StepResult

SILENT = 1.0
"""Time [s] before the text appears at a terminal; most scenes are ready earlier."""
INTERVAL = 10.0
"""Time [s] between two lines where standard error is no terminal."""
TERMINAL_INTERVAL = 0.2
"""Time [s] between two updates of the text at a terminal."""


@contextmanager
def waiting(
    text: str | Callable[[], str],
    *,
    console: Console | None = None,
    silent: float = SILENT,
    interval: float = INTERVAL,
    share: Callable[[], float] | None = None,
) -> Iterator[None]:
    """Show a text and the elapsed time while the body of the `with` statement runs.

    A terminal shows one line, which is removed at the end. A file or pipe receives a line at each ``interval``. Both
    are written by a separate thread, so that they are also shown during a step that takes minutes.

    Args:
        text: the present task, e.g. "loading gripper", or a function that returns the line. While kernels are compiled,
            a line about the compilation replaces the task.
        console: console to write to; by default that of standard error.
        silent: time before the text appears at a terminal [s].
        interval: time between two lines where the console is no terminal [s].
        share: function that returns the completed part of the work, from 0 to 1, for a bar at a terminal; None: no bar.
    """
    console = console or PlainConsole(stderr=True, soft_wrap=True)
    describe = text if callable(text) else lambda: compilations.text() or text
    ended, started = Event(), time.monotonic()

    def show() -> None:
        head = (BarColumn(), TimeElapsedColumn()) if share else (SpinnerColumn(),)
        columns = (*head, _column(), *(() if share else (TimeElapsedColumn(),)))
        progress = Progress(*columns, console=console, transient=True)
        task = progress.add_task(describe(), total=1.0 if share else None)
        if not ended.wait(silent):
            with progress:
                while not ended.wait(TERMINAL_INTERVAL):
                    progress.update(task, description=describe(), completed=share() if share else None)

    def write() -> None:
        while not ended.wait(interval):
            line = f"{describe()} ({time.monotonic() - started:.0f} s)"
            console.print(line, highlight=False, soft_wrap=True)

    thread = Thread(target=show if console.is_terminal else write, name="waiting", daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


@contextmanager
def progress_bar(text: str, total: float, *, counted: bool = False) -> Iterator[Callable[..., None]]:
    """Show a bar on standard error while the body of the `with` statement runs.

    Args:
        text: text before the bar.
        total: amount of work.
        counted: whether the completed parts are counted, and the remaining time is estimated.

    Yields:
        Function that updates the bar: its arguments are ``completed``, ``advance`` and ``description``.
    """
    last = (MofNCompleteColumn(), TimeRemainingColumn()) if counted else (TimeElapsedColumn(),)
    with Progress(_column(), BarColumn(), *last, console=PlainConsole(stderr=True), transient=True) as progress:
        yield partial(progress.update, progress.add_task(text, total=total))


def _column() -> TextColumn:
    return TextColumn("{task.description}", markup=False)


MOST_LINES = 3
"""Largest number of steps that are listed individually."""


StepOutcome: TypeAlias = "StepResult | StepRecord"


def convergence(steps: Sequence[StepOutcome]) -> str:
    """Return ``yes``, or the number of steps that did not converge: ``no: 3 of 100 steps``."""
    failed = sum(not step.converged for step in steps)
    return f"no: {failed} of {len(steps)} steps" if failed else "yes"


def print_failures(steps: Sequence[StepOutcome], *, first: int = 1) -> None:
    """Print each step that did not converge to stderr: number, time, reason; ``first`` is the first step's number."""
    console = PlainConsole(stderr=True, soft_wrap=True)
    failed = [(number, step) for number, step in enumerate(steps, start=first) if not step.converged]
    for number, step in failed[:MOST_LINES]:
        text = f"step {number}, t = {step.time:.4g} s, did not converge: {step.message}"
        console.print(text, style="red", highlight=False)
    if len(failed) > MOST_LINES:
        console.print(f"and {len(failed) - MOST_LINES} more", style="red")


class PlayProgress:
    """Shows simulation time, steps, and the last step that did not converge, while a program is played (`waiting`).

    Args:
        name: the scene's name.
        duration: length of the program [s].
        console: console to write to; by default that of standard error.
        interval: time [s] between two lines where the console is no terminal.
    """

    def __init__(
        self, name: str, *, duration: float, console: PlainConsole | None = None, interval: float = INTERVAL
    ) -> None:
        self._name, self._duration, self._interval = name, duration, interval
        self._step_started = time.monotonic()
        self._time, self._steps, self._failed, self._reason = 0.0, 0, 0, ""
        self._shown = waiting(self.text, console=console, silent=0.0, interval=interval, share=self._share)

    def __enter__(self) -> PlayProgress:
        self._shown.__enter__()
        return self

    def __exit__(self, *error: Any) -> None:
        self._shown.__exit__(*error)

    def add(self, step: StepOutcome) -> None:
        """Report a completed step."""
        self._time, self._steps, self._step_started = step.time, self._steps + 1, time.monotonic()
        if not step.converged:
            self._failed, self._reason = self._failed + 1, step.message

    def text(self) -> str:
        """Return the progress in one line."""
        now = time.monotonic()
        text = f"{self._name}: t = {self._time:.4g} of {self._duration:g} s, {self._steps} steps"
        if now - self._step_started > self._interval:
            text += f", step {self._steps + 1} has taken {now - self._step_started:.0f} s so far"
        if self._failed:
            text += f"; {self._failed} did not converge, the last because: {self._reason}"
        return text

    def _share(self) -> float:
        return self._time / self._duration if self._duration else 0.0
