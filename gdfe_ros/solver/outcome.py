# SPDX-License-Identifier: Apache-2.0
"""Outcomes of minimisations, solves and steps with their messages for users, and deadlines of solves."""

from __future__ import annotations

import time
from collections.abc import Callable
from enum import IntEnum


class Outcome(IntEnum):
    """How a minimisation, a solve or a step ended. The kernels know the members up to `GIVEN_UP`."""

    NONE = 0
    """It has not ended and may continue."""
    NEAR = 1
    """The distance to the equilibrium is within the target."""
    WORN = 2
    """The initial matrix must be renewed: it has served for many iterations, or gives no direction of descent."""
    STALLED = 3
    """No step along the direction lowers the energy."""
    EXHAUSTED = 4
    """The precision of the energy and its gradient is used up."""
    RUNAWAY = 5
    """The energy has no lower bound: an unstable law or load."""
    GIVEN_UP = 6
    """The body leaves its branch of equilibria, or the touching points do not settle. A shorter increment may succeed.
    """
    CUT = 7
    """The limit of iterations or the deadline ended it."""
    UNSETTLED = 8
    """Multipliers or hourglass scales have not settled."""
    PUSHED = 9
    """Contact forces have not settled."""
    TOUCHING = 10
    """The set of touching points does not settle."""
    AT_EDGE = 11
    """The distance to the equilibrium is unknown: no matrix gives a direction of descent."""
    TOO_STRONG = 12
    """The rounding of a load's energy exceeds the energy of the body."""
    NEUTRAL = 13
    """A motion of the body hardly changes its energy."""
    UNSTABLE = 14
    """The equilibrium is no minimum of the energy."""
    SNAPPED = 15
    """The body jumped to another equilibrium."""
    FOLDED = 16
    """Elements are folded or inverted."""
    PRESSED = 17
    """Elements are pressed flat before the command is reached."""
    ENTERED = 18
    """Surfaces penetrate each other."""
    STOPPED = 19
    """The step ended at an equilibrium before its command."""
    LET_GO = 20
    """Contact was dropped, because the load path with it failed."""
    RESTARTED = 21
    """The load path began anew, at the undeformed body."""


_TEXTS = {
    Outcome.EXHAUSTED: "no further descent is possible at the precision of the energy: about {estimate:.3g} of the "
    "body's size from equilibrium, tolerance {tolerance:.3g}",
    Outcome.RUNAWAY: "the body runs away: its energy has no lower bound; a material or a load is unstable there",
    Outcome.CUT: "{reason}: the distance to equilibrium is not known yet; the last step was {far:.3g} of the size; the "
    "next step goes on from here",
    Outcome.UNSETTLED: "pressures, grips, commanded lengths or volumes, or hourglass scales have not settled in up to "
    "{updates} updates, although the positions hardly move any more",
    Outcome.PUSHED: "contact forces have not settled at {where}",
    Outcome.TOUCHING: "what touches does not settle: the last step was {far:.3g} of the size",
    Outcome.AT_EDGE: "the distance to equilibrium is not known: the body is at the edge of its stability; smaller "
    "steps, or other commands, lead past it",
    Outcome.TOO_STRONG: "a load or an actuator is so strong that the rounding of its energy hides the energy of the "
    "body",
    Outcome.NEUTRAL: "a motion of the body hardly changes its energy, and the body still follows it; remedy: hold this "
    "motion",
    Outcome.UNSTABLE: "the equilibrium is unstable: a small push makes the body leave it; remedy: push it aside first, "
    "or step back",
    Outcome.SNAPPED: "the body jumped to another equilibrium of less energy, as in buckling; smaller steps do not "
    "change that",
    Outcome.FOLDED: "elements would fold or turn inside out",
    Outcome.PRESSED: "on the way to the command elements are pressed flat, and would fold or turn inside out",
    Outcome.ENTERED: "surfaces would enter each other",
    Outcome.STOPPED: "{reason} at {done:.3g} of the way to the command; the next step goes on from there",
    Outcome.LET_GO: "contact with {names} was dropped without following the load path, on which {flaw}",
    Outcome.RESTARTED: "restarted from rest: the first load path ended in {flaw}",
}
REMEDY_OF_FOLDS = "remedy: return to commands at which the elements were sound, or reset; finer cells fold later"


def tell(outcome: Outcome, **values: object) -> str:
    """Return the message of an outcome, with ``values`` in it; empty if it is no defect."""
    return _TEXTS[outcome].format(**values) if outcome in _TEXTS else ""


def join(*texts: str) -> str:
    """Return the parts of a message that are not empty, as one message."""
    return "; ".join(text for text in texts if text)


class Deadline:
    """Deadline of a solve; it counts how often it is queried before it passes.

    A solve depends on the clock and on interruptions only by these queries. A replay with the recorded number of
    queries therefore ends the solve in the same iteration and gives the same result, bit by bit.

    Args:
        moment: value of ``time.perf_counter`` at which the deadline passes; None if the clock does not end the solve.
        after: recorded number of queries before the deadline passes; it replaces the clock in a replay.
        interrupted: function that is called at each query and returns whether to end the solve; None if nothing can
            interrupt the solve.

    Attributes:
        after: number of queries before the deadline passed; None if it has not passed.
        reason: reason for ending the solve; empty if the deadline has not passed.
    """

    def __init__(
        self, moment: float | None = None, *, after: int | None = None, interrupted: Callable[[], bool] | None = None
    ) -> None:
        self._moment, self._planned, self._interrupted, self._asked = moment, after, interrupted, 0
        self.after: int | None = None
        self.reason = ""

    def has_passed(self, *, by_clock: bool = True) -> bool:
        """Return whether the deadline has passed; after the first True, the result stays True.

        If ``by_clock`` is False, the clock is ignored: only an interruption, or in a replay the recorded number of
        queries, makes the deadline pass.
        """
        if self.after is None:
            self.reason = self._find_reason(by_clock)
            self.after = self._asked if self.reason else None
            self._asked += 1
        return self.after is not None

    def _find_reason(self, by_clock: bool) -> str:
        """Return the reason to end the solve now, or an empty string."""
        if self._planned is not None:
            return "the deadline passed" if self._asked >= self._planned else ""
        if self._interrupted is not None and self._interrupted():
            return "interrupted"
        up = by_clock and self._moment is not None and time.perf_counter() >= self._moment
        return "the deadline passed" if up else ""

    @property
    def interruption(self) -> Deadline:
        """A deadline that ignores the clock. Its queries count as queries of the present deadline, too."""
        return Deadline(interrupted=lambda: self.has_passed(by_clock=False))

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
    return deadline is not None and deadline.has_passed()
