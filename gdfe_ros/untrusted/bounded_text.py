# SPDX-License-Identifier: Apache-2.0
"""Texts of unknown senders: read in bounded time and memory, and written to the log escaped, shortened, not too often.

Every YAML, JSON and XML text that a scene, a bag, a service or a file contains is read as plain data by these
functions. A text that exceeds a limit is refused before anything is built from it. Names, paths and labels of requests
reach the log. A terminal obeys control characters, a text with a line feed could look like an entry of its own, a text
may have megabytes, and a flood of requests would fill the disk.
"""

from __future__ import annotations

import json
import re
import threading
import time
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from typing import Any
from xml.etree import ElementTree

import yaml

from gdfe_ros.errors import GdfeError

LARGEST_TEXT = 32_000_000
"""Largest number of characters of a text. A scene contains its meshes, packed, as text."""
MOST_NODES = 100_000
"""Largest number of YAML values, each counted as often as aliases repeat it."""
DEEPEST = 40
"""Deepest nesting of YAML."""
LONGEST_NUMBER = 100
"""Largest number of characters of a number."""
LARGEST_XML = 2_000_000
"""Largest number of characters of an XML text."""

_HARMLESS = dict.fromkeys((9, 10, 0xA0, 0x2009, 0x202F, 0x3000))
"""Tabulator, line feed and special spaces: harmless characters that `str.isprintable` does not accept."""
_NUMBER_LIKE = re.compile(r"[-+.:_\deE]*\Z")
_TEXT_TAGS = ("tag:yaml.org,2002:str", "!")


class Loader(getattr(yaml, "CSafeLoader", yaml.SafeLoader)):
    """PyYAML's safe loader (YAML 1.1), which also reads 1e6 as a number, as in YAML 1.2.

    Use it only for texts that have passed `check_yaml`.
    """


# No two parts of the pattern match the same digits: otherwise, a match takes quadratic time.
Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float", re.compile(r"^[-+]?(\d+(\.\d*)?|\.\d+)[eE][-+]?\d+$"), list("-+0123456789.")
)


def load_yaml(text: str) -> Any:
    """Return the data of a YAML text.

    Raises:
        yaml.YAMLError: the text is not YAML, or exceeds a limit of this module.
    """
    check_yaml(text)
    try:
        return yaml.load(text, Loader=Loader)
    except (ValueError, RecursionError) as error:  # e.g. a date that does not exist
        raise yaml.YAMLError(f"a value cannot be read: {error}") from error


def check_yaml(text: str, *, most_nodes: int = MOST_NODES) -> None:
    """Check that a YAML text is within the limits, without building its data.

    Raises:
        yaml.YAMLError: the text is not YAML, or exceeds a limit of this module.
    """
    if len(text) > LARGEST_TEXT:
        raise yaml.YAMLError(f"it has {len(text)} characters; allowed: up to {LARGEST_TEXT}")
    try:
        loader = Loader(text)
    except UnicodeError as error:
        raise yaml.YAMLError(f"it has characters that are no Unicode: {error.reason}") from error
    try:
        _Count(most_nodes).check(loader)
    finally:
        loader.dispose()


@dataclass
class _Open:
    """A list or mapping that is being read: anchor, number of values before it, and depth of its contents."""

    anchor: str | None
    before: int
    height: int = 0


class _Count:
    """Counts the values of a YAML text from its events, each as often as aliases repeat it.

    Args:
        most: largest number of values.
    """

    def __init__(self, most: int) -> None:
        self._most, self._count = most, 0
        self._open: list[_Open] = []
        self._sizes: dict[str, tuple[int, int]] = {}

    def check(self, loader: Loader) -> None:
        """Read all events of a text.

        Raises:
            yaml.YAMLError: the text is not YAML, or exceeds a limit.
        """
        while loader.check_event():
            event = loader.get_event()
            match event:
                case yaml.ScalarEvent():
                    _require_short(event)
                    self._add(1, 0, event)
                    self._keep(event.anchor, 1, 0)
                case yaml.AliasEvent():
                    self._add(*self._size(event), event)
                case yaml.CollectionStartEvent():
                    self._open.append(_Open(event.anchor, self._count))
                    self._add(1, 0, event)
                case yaml.CollectionEndEvent():
                    self._close()

    def _size(self, event: yaml.AliasEvent) -> tuple[int, int]:
        """Return the number of values that an alias repeats, and their depth."""
        if any(each.anchor == event.anchor for each in self._open):
            raise _refusal(event, f"an alias contains itself: {event.anchor[:40]!r}")
        if event.anchor not in self._sizes:
            raise _refusal(event, f"the alias {event.anchor[:40]!r} has no anchor")
        return self._sizes[event.anchor]

    def _add(self, count: int, height: int, event: yaml.Event) -> None:
        self._count += count
        if self._count > self._most:
            raise _refusal(event, f"it has more than {self._most} values, those that aliases repeat included")
        if len(self._open) + height > DEEPEST:
            raise _refusal(event, f"it is nested deeper than {DEEPEST} levels")
        if self._open:
            self._open[-1].height = max(self._open[-1].height, height + 1)

    def _close(self) -> None:
        closed = self._open.pop()
        self._keep(closed.anchor, self._count - closed.before, closed.height)
        if self._open:
            self._open[-1].height = max(self._open[-1].height, closed.height + 1)

    def _keep(self, anchor: str | None, count: int, height: int) -> None:
        if anchor is not None:
            self._sizes[anchor] = (count, height)


def _require_short(event: yaml.ScalarEvent) -> None:
    """Raise an error for a number with too many digits, or for a long text whose tag makes it another type."""
    if len(event.value) <= LONGEST_NUMBER:
        return
    plain = event.implicit[0] and _NUMBER_LIKE.match(event.value)
    if plain or (event.tag is not None and event.tag not in _TEXT_TAGS):
        text = f"a number, or a value with a tag, has {len(event.value)} characters; allowed: up to {LONGEST_NUMBER}"
        raise _refusal(event, text)


def _refusal(event: yaml.Event, problem: str) -> yaml.MarkedYAMLError:
    return yaml.MarkedYAMLError(problem=problem, problem_mark=event.start_mark)


def load_json(text: str | bytes, *, largest: int = LARGEST_TEXT) -> Any:
    """Return the data of a JSON text.

    Raises:
        ValueError: the text is not JSON, has more than ``largest`` characters, or is nested too deeply.
    """
    if len(text) > largest:
        raise ValueError(f"it has {len(text)} characters; allowed: up to {largest}")
    try:
        return json.loads(text)
    except RecursionError as error:
        raise ValueError("it is nested too deeply") from error


def load_json_object(text: str | bytes, *, largest: int = LARGEST_TEXT) -> dict[str, Any]:
    """Return the data of a JSON text whose outermost value is an object, and whose texts a terminal can show.

    Raises:
        ValueError: as for `load_json`, or the outermost value is no object, or a text has control characters.
    """
    data = load_json(text, largest=largest)
    if not isinstance(data, dict):
        raise ValueError(f"its outermost value is a {type(data).__name__}; allowed: an object")
    if not text.isascii() or (b"\\" if isinstance(text, bytes) else "\\") in text:
        _require_plain(data)
    return data


def plain_lines(text: str) -> str:
    """Return a text with its control characters as escape sequences, except line feeds and tabulators."""
    return text if is_plain(text) else "".join(each if is_plain(each) else repr(each)[1:-1] for each in text)


def is_plain(text: str) -> bool:
    """Return whether a text has no control characters except line feeds and tabulators; a terminal obeys them."""
    return text.translate(_HARMLESS).isprintable()


def _require_plain(data: Any) -> None:
    """Raise a ValueError if a key or a text of JSON data has control characters."""
    waiting = [data]
    while waiting:
        match waiting.pop():
            case dict() as found:
                waiting += [*found, *found.values()]
            case list() as found:
                waiting += found
            case str() as found if not is_plain(found):
                raise ValueError(f"the text {found[:80]!r} has control characters")


def parse_xml(text: str) -> ElementTree.Element:
    """Return the outermost element of an XML text.

    A document type is refused, because its entities could expand without end.

    Raises:
        ValueError: the text is not XML, has a document type, or is too large.
    """
    if len(text) > LARGEST_XML:
        raise ValueError(f"it has {len(text)} characters; allowed: up to {LARGEST_XML}")
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise ValueError("it has a document type (<!DOCTYPE>, <!ENTITY>); allowed: elements only")
    try:
        return ElementTree.fromstring(text)
    except (ElementTree.ParseError, UnicodeError) as error:
        raise ValueError(str(error)) from error


_FORMULAS = ("=", "+", "-", "@", "\t", "\r")
"""First characters of table cells that spreadsheets execute as formulas."""


def quote_formula(value: Any) -> Any:
    """Return a cell of a table: a text that a spreadsheet would execute as a formula gets a leading quote."""
    if not isinstance(value, str) or not value.startswith(_FORMULAS):
        return value
    try:
        float(value)
    except ValueError:
        return f"'{value}"
    return value


_INTERVAL = 5.0
"""Time [s] in which `Throttle.burst` texts about one subject may pass."""
_MOST = 1000
"""Largest number of remembered subjects. Without a limit, subjects with names from messages could fill the memory."""


class Throttle:
    """Lets a few texts about each subject pass in five seconds, and counts the suppressed texts.

    Args:
        burst: number of texts that pass in five seconds.
        what: name of the suppressed texts in the note about them.
    """

    def __init__(self, burst: int = 1, *, what: str = "more like it") -> None:
        self._burst, self._what, self._lock = burst, what, threading.Lock()
        self._quiet: dict[Hashable, tuple[float, int, int]] = {}

    def due(self, key: Hashable) -> str | None:
        """Return None to suppress a text about ``key``; else a note to append, with the number of suppressed texts."""
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
"""Largest number of characters of a text parameter, such as a path, and of all texts in a list."""


def shorten(text: str, most: int) -> str:
    """Return a text without its middle if it has more than ``most`` characters, and with control characters escaped."""
    return _escape(without_middle(text, most))


def plain_entry(text: object) -> str:
    """Return a text as one entry of the log: further lines are indented, so that none of them looks like an entry."""
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
