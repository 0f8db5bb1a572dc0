# SPDX-License-Identifier: Apache-2.0
"""Progress of a program while a command plays it."""

from __future__ import annotations

import time
from threading import Event, Thread
from types import TracebackType

from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from gdfe_ros.commands.convergence import StepOutcome
from gdfe_ros.commands.waiting import INTERVAL
from gdfe_ros.terminal import PlainConsole

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
