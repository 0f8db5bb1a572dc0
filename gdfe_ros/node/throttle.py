# SPDX-License-Identifier: Apache-2.0
"""Limit on the rate of repeated texts."""

from __future__ import annotations

import threading
import time
from collections.abc import Hashable

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
