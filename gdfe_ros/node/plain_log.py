# SPDX-License-Identifier: Apache-2.0
"""Texts of strangers in the log and in parameters: escaped, shortened, and not too often.

Names, paths and labels of requests reach the log. A terminal obeys control characters, a text with a line feed could
look like an entry of its own, a text may have megabytes, and a flood of requests would fill the disk.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Hashable, Sequence
from typing import Any

from gdfe_ros.bounded_text import is_plain
from gdfe_ros.errors import GdfeError

_INTERVAL = 5.0
"""Shortest time between two texts about the same subject [s]."""
_MOST = 1000
"""Largest number of subjects that are kept; the names in messages may be subjects."""


class Throttle:
    """Lets some texts per subject pass in five seconds, and counts the suppressed texts.

    Args:
        burst: number of texts that pass in five seconds.
        what: name of the suppressed texts in the note about them.
    """

    def __init__(self, burst: int = 1, *, what: str = "more like it") -> None:
        self._burst, self._what, self._lock = burst, what, threading.Lock()
        self._quiet: dict[Hashable, tuple[float, int, int]] = {}

    def due(self, key: Hashable) -> str | None:
        """Return None if a text is suppressed; else a note to append, with the number of texts suppressed before it."""
        now = time.monotonic()
        with self._lock:
            until, passed, unsaid = self._quiet.get(key, (0.0, 0, 0))
            if now < until:
                due = passed < self._burst
                self._quiet[key] = (until, passed + due, unsaid + (not due))
                return "" if due else None
            self._quiet.pop(key, None)  # the oldest subjects come first
            self._quiet[key] = (now + _INTERVAL, 1, 0)
            while len(self._quiet) > _MOST:
                del self._quiet[next(iter(self._quiet))]
        return f" ({unsaid} {self._what} since the last warning)" if unsaid else ""


_LONGEST_ENTRY = 20_000
"""Largest number of characters of an entry of the log."""
_LONGEST_TEXT, _LONGEST_LIST = 4096, 1_000_000
"""Largest number of characters of a parameter that is a text, which is that of a path, and of a list of texts."""


def shorten(text: str, most: int) -> str:
    """Return a text without its middle if it has more than ``most`` characters, and with control characters escaped."""
    return _escape(without_middle(text, most))


def plain_entry(text: object) -> str:
    """Return the text of an entry of the log: lines after the first are indented, so that none looks like an entry."""
    return "\n    ".join(map(_escape, without_middle(str(text), _LONGEST_ENTRY).split("\n")))


def without_middle(text: str, most: int) -> str:
    """Return a text without its middle if it has more than ``most`` characters."""
    if len(text) <= most:
        return text
    half = most // 2
    return f"{text[:half]} [... {len(text) - 2 * half} characters ...] {text[-half:]}"


def _escape(text: str) -> str:
    return "".join(each if each.isprintable() else repr(each)[1:-1] for each in text)


class PlainLog:
    """A logger of rclpy whose entries are plain (`plain_entry`), and of limited number.

    Args:
        logger: logger of rclpy; its other methods can be used, too.
        throttle: limit on the number of entries.
    """

    def __init__(self, logger: Any, throttle: Throttle) -> None:
        self._logger, self._throttle = logger, throttle

    def __getattr__(self, name: str) -> Any:
        return getattr(self._logger, name)

    # rclpy distinguishes callers by their lines, and each may have only one severity.
    def info(self, text: object, **options: Any) -> bool:
        """Log an entry for information."""
        entry = self._due("info", text)
        return entry is not None and self._logger.info(entry, **options)

    def warning(self, text: object, **options: Any) -> bool:
        """Log a warning."""
        entry = self._due("warning", text)
        return entry is not None and self._logger.warning(entry, **options)

    def error(self, text: object, **options: Any) -> bool:
        """Log an error."""
        entry = self._due("error", text)
        return entry is not None and self._logger.error(entry, **options)

    def _due(self, severity: str, text: object) -> str | None:
        more = self._throttle.due(severity)
        return None if more is None else plain_entry(text) + more


def require_plain(name: str, value: str | Sequence[str]) -> None:
    """Check the value of a parameter with texts.

    Raises:
        GdfeError: it has control characters (in a list, line feeds and tabulators are allowed), or is too long.
    """
    texts, most = ([value], _LONGEST_TEXT) if isinstance(value, str) else (value, _LONGEST_LIST)
    allowed: Callable[[str], bool] = str.isprintable if isinstance(value, str) else is_plain
    length = sum(map(len, texts))
    if length > most:
        raise GdfeError(f"parameter {name} has {length} characters; allowed: up to {most}")
    if wrong := next((text for text in texts if not allowed(text)), None):
        raise GdfeError(f"parameter {name} has {shorten(wrong, 80)!r}; allowed: no control characters")
