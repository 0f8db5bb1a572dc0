# SPDX-License-Identifier: Apache-2.0
"""Deadline of a solve: the clock, an interruption, or in a replay a recorded number of queries ends it."""

from __future__ import annotations

import time
from collections.abc import Callable


class Deadline:
    """Deadline of a solve; it counts the queries before it passes.

    A solve depends on the clock and on interruptions only by these queries. A replay with the recorded number of
    queries therefore ends the solve in the same iteration and gives the same result, bit by bit.

    Args:
        moment: value of ``time.perf_counter`` at which the deadline passes; None if the clock does not end the solve.
        after: recorded number of queries before the deadline passes; it replaces the clock in a replay.
        interrupted: function that is called at each query and returns whether to end the solve; None if nothing can
            interrupt it.

    Attributes:
        after: number of queries before the deadline passed; None if it has not passed.
        reason: reason for ending the solve; empty if the deadline has not passed.
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

    def passed(self, *, by_clock: bool = True) -> bool:
        """Return whether the deadline has passed; after the first True, the result stays True.

        If ``by_clock`` is False, the clock is ignored: only an interruption, or in a replay the recorded number of
        queries, makes the deadline pass.
        """
        if self.after is None:
            self.reason = self._ended(by_clock)
            self.after = self._asked if self.reason else None
            self._asked += 1
        return self.after is not None

    def _ended(self, by_clock: bool) -> str:
        """Return the reason to end the solve now, or an empty string."""
        if self._planned is not None:
            return "the deadline passed" if self._asked >= self._planned else ""
        if self._interrupted is not None and self._interrupted():
            return "interrupted"
        up = by_clock and self._moment is not None and time.perf_counter() >= self._moment
        return "the deadline passed" if up else ""

    @property
    def interruption(self) -> Deadline:
        """A deadline without the clock; its queries are counted as queries of this one."""
        return Deadline(interrupted=lambda: self.passed(by_clock=False))

    @classmethod
    def of(
        cls, started: float, seconds: float | None, after: int | None, interrupted: Callable[[], bool] | None = None
    ) -> Deadline | None:
        """Return the deadline of a solve that began at ``started``, or None if nothing can end it.

        Args:
            started: ``time.perf_counter`` at the beginning [s].
            seconds: allowed duration [s]; None for no limit.
            after: recorded number of queries in a replay; None outside of a replay.
            interrupted: function that returns whether to end the solve; None if nothing can interrupt it.
        """
        if after is not None:
            return cls(after=after)
        if seconds is None and interrupted is None:
            return None
        return cls(None if seconds is None else started + seconds, interrupted=interrupted)


def past(deadline: Deadline | None) -> bool:
    """Return whether ``deadline`` is not None and has passed."""
    return deadline is not None and deadline.passed()
