# SPDX-License-Identifier: Apache-2.0
"""The line in the terminal while a command prepares its work."""

from io import StringIO
from threading import Event

import pytest
from rich.console import Console

from gdfe_ros.commands.waiting import waiting
from gdfe_ros.compilations import compilations


class Screen(StringIO):
    """A terminal that sets ``seen`` when it shows the text."""

    def __init__(self) -> None:
        super().__init__()
        self.seen = Event()

    def write(self, text: str) -> int:
        """Write a text."""
        if "loading hand" in text or "compiling" in text:
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
    screen = Screen()
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
