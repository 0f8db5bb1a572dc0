# SPDX-License-Identifier: Apache-2.0
"""Texts of strangers in the log and in parameters: of limited length, without control characters, no forged lines.

Names, paths and labels of requests reach the log. A terminal obeys control characters, a text with a line feed could
look like an entry of its own, a text may have megabytes, and a flood of requests would fill the disk.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from gdfe_ros.bounded_text import is_plain
from gdfe_ros.errors import GdfeError
from gdfe_ros.node.throttle import Throttle

_LONGEST_ENTRY = 20_000
"""Largest number of characters of an entry of the log."""
_BURST = 100
"""Largest number of entries of the same severity in five seconds."""
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


def log_throttle() -> Throttle:
    """Return the limit on the number of entries of a node's log, by severity."""
    return Throttle(_BURST, what="entries left out")


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
