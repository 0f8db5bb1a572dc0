# SPDX-License-Identifier: Apache-2.0
"""The progress line while a program is played."""

from __future__ import annotations

from io import StringIO
from threading import Event
from types import SimpleNamespace

import pytest

from gdfe_ros.commands.waiting import PlayProgress
from gdfe_ros.terminal import PlainConsole

STUCK = SimpleNamespace(converged=False, time=0.2, message="[cable 'left'] is at its limit")


class Stream(StringIO):
    """A stream that sets ``seen`` when it receives the awaited text."""

    def __init__(self, awaited: str) -> None:
        super().__init__()
        self.awaited, self.seen = awaited, Event()

    def write(self, text: str) -> int:
        """Write a text."""
        if self.awaited in text:
            self.seen.set()
        return super().write(text)


@pytest.mark.parametrize("terminal", [True, False])
def test_a_step_that_lasts_is_reported_while_it_lasts(terminal: bool) -> None:
    """During a long step, a terminal and a file show the time, the number of steps and the last failure."""
    stream = Stream("step 2 has taken")
    console = PlainConsole(file=stream, force_terminal=terminal, width=200)
    with PlayProgress("hand", duration=2.0, console=console, interval=0.01) as progress:
        progress.add(STUCK)
        assert stream.seen.wait(60.0)
    text = stream.getvalue()
    assert "hand: t = 0.2 of 2 s, 1 steps" in text
    assert "1 did not converge, the last because: [cable 'left'] is at its limit" in text


def test_a_short_run_writes_nothing_into_a_file() -> None:
    """A program that ends within the interval writes nothing to a file."""
    stream = StringIO()
    progress = PlayProgress("hand", duration=2.0, console=PlainConsole(file=stream), interval=600.0)
    with progress:
        progress.add(STUCK)
    assert stream.getvalue() == ""
