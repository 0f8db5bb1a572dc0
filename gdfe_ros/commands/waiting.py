# SPDX-License-Identifier: Apache-2.0
"""A line of text that shows the present task of a command during a long wait."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from threading import Event, Thread, Timer
from types import TracebackType
from typing import TYPE_CHECKING, Any, Protocol

from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from gdfe_ros.compilations import compilations
from gdfe_ros.terminal import PlainConsole

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


MOST_LINES = 3
"""Largest number of steps that are listed individually."""


class StepOutcome(Protocol):
    """Outcome of a step, as in results and step records."""

    @property
    def converged(self) -> bool:
        """Whether the step reached its tolerance."""

    @property
    def time(self) -> float:
        """Simulation time [s]."""

    @property
    def message(self) -> str:
        """Reason why the step did not converge."""


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


TERMINAL_INTERVAL = 0.2
"""Time [s] between two updates of the text at a terminal."""


class PlayProgress:
    """Shows simulation time, steps, and the last step that did not converge, while a program is played.

    A terminal shows a bar, which is removed at the end. A file or pipe receives a line every ten seconds. Both are
    written by a separate thread, so that the progress is also shown during a step that takes minutes.

    Args:
        name: the scene's name.
        duration: length of the program [s].
        console: console to write to; by default that of standard error.
        interval: time [s] between two lines where the console is no terminal.
    """

    def __init__(
        self, name: str, *, duration: float, console: PlainConsole | None = None, interval: float = INTERVAL
    ) -> None:
        self._name, self._duration = name, duration
        self._console = console or PlainConsole(stderr=True, soft_wrap=True)
        self._interval = interval
        self._started = self._step_started = time.monotonic()
        self._time, self._steps, self._failed, self._reason = 0.0, 0, 0, ""
        self._ended = Event()
        self._thread = Thread(target=self._show, name="progress", daemon=True)

    def __enter__(self) -> PlayProgress:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._ended.set()
        self._thread.join()

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

    def _show(self) -> None:
        if self._console.is_terminal:
            columns = BarColumn(), TimeElapsedColumn(), TextColumn("{task.description}", markup=False)
            with Progress(*columns, console=self._console, transient=True) as bar:
                task = bar.add_task(self.text(), total=self._duration)
                while not self._ended.wait(TERMINAL_INTERVAL):
                    bar.update(task, completed=self._time, description=self.text())
            return
        while not self._ended.wait(self._interval):
            elapsed = time.monotonic() - self._started
            self._console.print(f"{self.text()} ({elapsed:.0f} s)", highlight=False)
