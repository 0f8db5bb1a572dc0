# SPDX-License-Identifier: Apache-2.0
"""When a text that would be repeated is due again."""

from __future__ import annotations

import threading
import time
from collections.abc import Hashable

_INTERVAL = 5.0
"""Shortest time between two texts about one thing [s]."""


class Throttle:
    """Lets one text about a thing through in five seconds, and counts those in between."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._quiet: dict[Hashable, tuple[float, int]] = {}

    def due(self, key: Hashable) -> str | None:
        """Tell whether a text is due: None where it is not, else how many went unsaid, as text to add."""
        now = time.monotonic()
        with self._lock:
            until, unsaid = self._quiet.get(key, (0.0, 0))
            if now < until:
                self._quiet[key] = (until, unsaid + 1)
                return None
            self._quiet[key] = (now + _INTERVAL, 0)
        return f" ({unsaid} more like it since the last warning)" if unsaid else ""
