# SPDX-License-Identifier: Apache-2.0
"""The end of a solve: by the clock, by an interruption, or at a recorded count in a replay."""

from __future__ import annotations

import time
from collections.abc import Callable


class Deadline:
    """A deadline that counts the queries before it passes.

    The answers to these queries are all that a solve knows of the clock and of interruptions. With the recorded count,
    a replay therefore ends the solve at the same place, bit by bit.

    Args:
        moment: value of ``time.perf_counter`` at which the deadline passes; None if the clock does not end the solve.
        after: number of answers "not yet", which replaces the clock in a replay.
        interrupted: called at each query; returns whether to end at once. None for no interruption.

    Attributes:
        after: number of answers "not yet" before the deadline passed; None if it has not passed.
        reason: why the solve ends; empty if it does not.
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
        """Return whether the deadline has passed; after the first True, the answer stays True.

        Without ``by_clock`` only an interruption counts, or in a replay the recorded count.
        """
        if self.after is not None:
            return True
        self.reason = self._ended(by_clock)
        if self.reason:
            self.after = self._asked
        self._asked += 1
        return bool(self.reason)

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
        """The same deadline without its clock; its queries are counted together with those of this one."""
        return _Interruption(self)

    @classmethod
    def of(
        cls, started: float, seconds: float | None, after: int | None, interrupted: Callable[[], bool] | None = None
    ) -> Deadline | None:
        """Return the deadline of a solve that began at ``started``, or None if nothing can end it.

        Args:
            started: ``time.perf_counter`` at the beginning [s].
            seconds: allowed duration [s]; None for any.
            after: recorded count of a replay; None outside of a replay.
            interrupted: returns whether to end at once; None for no interruption.
        """
        if after is not None:
            return cls(after=after)
        if seconds is None and interrupted is None:
            return None
        return cls(None if seconds is None else started + seconds, interrupted=interrupted)


class _Interruption(Deadline):
    """A deadline without its clock."""

    def __init__(self, whole: Deadline) -> None:
        self._whole = whole

    def passed(self, *, by_clock: bool = False) -> bool:
        """Return whether the deadline was passed by an interruption, or in a replay by the recorded count."""
        return self._whole.passed(by_clock=False)

    @property
    def after(self) -> int | None:
        """Number of answers "not yet" of the whole deadline."""
        return self._whole.after

    @property
    def reason(self) -> str:
        """Why the solve ends."""
        return self._whole.reason


def past(deadline: Deadline | None) -> bool:
    """Return whether there is a deadline and it has passed."""
    return deadline is not None and deadline.passed()
