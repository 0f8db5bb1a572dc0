# SPDX-License-Identifier: Apache-2.0
"""How minimisations, solves and steps end, from the kernels to the messages that a user reads."""

from __future__ import annotations

from enum import IntEnum


class Outcome(IntEnum):
    """How a minimisation, a solve or a step ended. The kernels know the members up to `GIVEN_UP`."""

    NONE = 0
    """It has not ended: it may continue."""
    NEAR = 1
    """The distance to the equilibrium is within the target."""
    WORN = 2
    """The matrix has served for so many iterations that a new one pays, or it gives no direction of descent."""
    STALLED = 3
    """No step along the direction lowers the energy."""
    EXHAUSTED = 4
    """The precision of the energy and its gradient is used up."""
    RUNAWAY = 5
    """The energy has no lower bound: an unstable law or load."""
    GIVEN_UP = 6
    """The body leaves its branch of equilibria, or faces that touch do not settle: a shorter increment may succeed."""
    CUT = 7
    """The limit of iterations or the deadline ended it."""
    UNSETTLED = 8
    """Multipliers or hourglass scales have not settled."""
    PUSHED = 9
    """Contact forces have not settled."""
    TOUCHING = 10
    """Faces that touch each other do not settle."""
    AT_EDGE = 11
    """The tangent gives no distance to the equilibrium."""
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
    RESTARTED = 20
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
    Outcome.TOUCHING: "the faces that touch each other do not settle: the last step was {far:.3g} of the size",
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
    Outcome.RESTARTED: "restarted from rest: the first load path ended in {flaw}",
}
REMEDY_OF_FOLDS = "remedy: return to commands at which the elements were sound, or reset; finer cells fold later"


def tell(outcome: Outcome, **values: object) -> str:
    """Return the message of an outcome, with ``values`` in it; empty if it is no defect."""
    return _TEXTS[outcome].format(**values) if outcome in _TEXTS else ""


def join(*texts: str) -> str:
    """Return the parts of a message that are not empty, as one message."""
    return "; ".join(text for text in texts if text)
