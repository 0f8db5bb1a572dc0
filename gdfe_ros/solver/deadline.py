# SPDX-License-Identifier: Apache-2.0
"""When a solve has to end: by the clock, on somebody's word, or, in a replay, where one of these once ended it."""

from __future__ import annotations

import time
from collections.abc import Callable


class Deadline:
    """Answers whether the time is up, and counts how often it was not.

    Nothing else of a solve depends on the clock or the word: with the count given back, it ends at the same place to
    the last bit.

    Args:
        moment: ``time.perf_counter`` from which on the time is up; None: never by the clock.
        after: instead, this many answers "not yet" come first.
        interrupted: tells whether to end at once; asked each time. None: nobody is asked.

    Attributes:
        after: number of answers "not yet" before the first "up"; None while there was none.
        reason: what ended the solve; empty while nothing did.
    """

    def __init__(
        self,
        moment: float | None = None,
        *,
        after: int | None = None,
        interrupted: Callable[[], bool] | None = None,
    ) -> None:
        self._moment, self._planned, self._interrupted, self._asked = moment, after, interrupted, 0
        self.after: int | None = None
        self.reason = ""

    def passed(self) -> bool:
        """Tell whether the time is up; once it is, it stays so."""
        if self.after is not None:
            return True
        self.reason = self._ended()
        if self.reason:
            self.after = self._asked
        self._asked += 1
        return bool(self.reason)

    def _ended(self) -> str:
        """Say what ends the solve now; empty where nothing does."""
        if self._planned is not None:
            return "the deadline passed" if self._asked >= self._planned else ""
        if self._interrupted is not None and self._interrupted():
            return "interrupted"
        up = self._moment is not None and time.perf_counter() >= self._moment
        return "the deadline passed" if up else ""

    @property
    def interruption(self) -> Deadline | None:
        """What ends work that the clock may not: who interrupts; None for nobody."""
        return None if self._interrupted is None else Deadline(interrupted=self._interrupted)

    @classmethod
    def of(
        cls, started: float, seconds: float | None, after: int | None, interrupted: Callable[[], bool] | None = None
    ) -> Deadline | None:
        """Give what ends a solve that began at ``started``: seconds [s], a word, or a recorded place; None: nothing."""
        if after is not None:
            return cls(after=after)
        if seconds is None and interrupted is None:
            return None
        return cls(None if seconds is None else started + seconds, interrupted=interrupted)


def past(deadline: Deadline | None) -> bool:
    """Tell whether there is a deadline and its time is up."""
    return deadline is not None and deadline.passed()
