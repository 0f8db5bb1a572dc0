# SPDX-License-Identifier: Apache-2.0
"""The line in the terminal while a command prepares its work or plays a program, and the steps that failed."""

from __future__ import annotations

from io import StringIO
from threading import Event
from types import SimpleNamespace

import pytest
from rich.console import Console

from gdfe_ros.commands.waiting import MOST_LINES, PlayProgress, convergence, print_failures, waiting
from gdfe_ros.compiling.compilations import compilations
from gdfe_ros.untrusted.terminal import PlainConsole


class Screen(StringIO):
    """A stream that sets ``seen`` when it receives the awaited text."""

    def __init__(self, awaited: str = "loading hand") -> None:
        super().__init__()
        self.awaited, self.seen = awaited, Event()

    def write(self, text: str) -> int:
        """Write a text."""
        if self.awaited in text:
            self.seen.set()
        return super().write(text)


def test_a_long_wait_is_shown() -> None:
    """The text is shown during long work."""
    screen = Screen()
    with waiting("loading hand", console=Console(file=screen, force_terminal=True), silent=0.0):
        assert screen.seen.wait(60.0)


def test_a_file_receives_a_line_while_the_work_lasts() -> None:
    """An output that is no terminal receives the text and the elapsed time during long work."""
    screen = Screen()
    with waiting("loading hand", console=Console(file=screen), interval=0.01):
        assert screen.seen.wait(60.0)
    assert "loading hand (0 s)" in screen.getvalue()


def test_the_line_says_that_kernels_are_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    """During a compilation, the line names it and counts the kernels, instead of the text."""
    screen = Screen("compiling")
    monkeypatch.setattr(compilations, "running", 2)
    monkeypatch.setattr(compilations, "compiled", 7)
    with waiting("loading hand", console=Console(file=screen), interval=0.01):
        assert screen.seen.wait(60.0)
    assert "compiling kernels, once for this machine: 7 of at least 9" in screen.getvalue()
    assert "loading" not in screen.getvalue()


def test_a_short_wait_shows_nothing() -> None:
    """Short work shows nothing at a terminal or in a file; errors pass."""
    screen = Screen()
    with pytest.raises(ValueError, match="broken"), waiting("loading hand", console=Console(file=screen)):
        raise ValueError("broken")
    with waiting("loading hand", console=Console(file=screen, force_terminal=True), silent=600.0):
        pass
    assert "loading" not in screen.getvalue()


STUCK = SimpleNamespace(converged=False, time=0.2, message="[cable 'left'] is at its limit")


@pytest.mark.parametrize("terminal", [True, False])
def test_a_step_that_lasts_is_reported_while_it_lasts(terminal: bool) -> None:
    """During a long step, a terminal and a file show the time, the number of steps and the last failure."""
    stream = Screen("step 2 has taken")
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


def test_steps_that_did_not_converge_are_named(capsys: pytest.CaptureFixture[str]) -> None:
    """Of five failures in ten steps, their number is printed, and step, time and reason of the first ones."""
    steps = [SimpleNamespace(converged=k % 2 == 0, time=0.1 * k, message=f"[reason {k}]") for k in range(10)]
    assert convergence(steps) == "no: 5 of 10 steps"
    print_failures(steps, first=0)
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "step 1, t = 0.1 s, did not converge: [reason 1]"
    assert lines[-1] == f"and {5 - MOST_LINES} more"


def test_nothing_is_said_of_steps_that_converged(capsys: pytest.CaptureFixture[str]) -> None:
    """Nothing is printed if all steps converged."""
    steps = [SimpleNamespace(converged=True, time=0.0, message="")]
    assert convergence(steps) == "yes"
    print_failures(steps)
    assert capsys.readouterr().err == ""
