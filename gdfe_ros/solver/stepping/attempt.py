# SPDX-License-Identifier: Apache-2.0
"""One attempted increment of a load path, and the verdict on it."""

from __future__ import annotations

from dataclasses import dataclass

from gdfe_ros.solver.solution import Solution
from gdfe_ros.solver.state import State
from gdfe_ros.solver.stepping.way import AttemptOutcome, Way
from gdfe_ros.solver.terms.actuation import inflated

SHORTEST_STUCK = 1.0 / 4.0
"""An increment whose solve got stuck is not halved again if it is at most this fraction of a load path."""
STUCK = 1e-4
"""A solve without further descent is stuck if the estimated distance to the equilibrium, divided by the body's size,
exceeds this. An example is a kink of the energy. At a smaller distance, the rounding of the energy has ended the solve.
"""
SHORTEST_JUMP = 1.0 / 32.0
"""A jump is accepted in an increment of at most this fraction of a load path; shorter increments would jump, too."""
FOLDS, ENTERS = "elements would fold or turn inside out", "surfaces would enter each other"


@dataclass(frozen=True, eq=False, kw_only=True)
class Attempt:
    """Result of an attempted increment, and the evidence for the verdict.

    Attributes:
        way: the load path after `Way.tried`; ``way.done`` does not include this increment yet.
        began: the state at the beginning of the increment.
        solution: result of the solve.
        jumps: whether the body jumped to another equilibrium.
        unstable: name of the chamber that lost its stability; empty for none.
        spent: whether no iterations or no time are left for another attempt.
        patient: whether a folded shape is accepted if a limit or the deadline ended the solve. It is accepted as long
            as the number of iterations for this command, including earlier unfinished steps, is below the solver's
            ``patience``.
    """

    way: Way
    began: State
    solution: Solution
    jumps: bool
    unstable: str
    spent: bool
    patient: bool

    @property
    def sound(self) -> bool:
        """Whether no element is folded or inverted, and no surface penetrates another."""
        return self.solution.min_det > 0.0 and not self.solution.entered

    @property
    def snapped(self) -> bool:
        """Whether the body jumped to another equilibrium, or jumped without reaching an equilibrium."""
        return self.jumps or (self.way.jumped and not self.solution.converged)

    @property
    def failed(self) -> bool:
        """Whether the solve ended neither at a sound equilibrium nor as near to it as its precision allows."""
        solution = self.solution
        stuck = solution.error_estimate > STUCK and self.way.length > SHORTEST_STUCK
        given_up = solution.exhausted and not stuck
        return not (solution.converged or given_up) or not self.sound

    @property
    def folds(self) -> bool:
        """Whether a body that was sound is not sound any more, and its solve was not just cut short."""
        began = self.began
        once_sound = began.sound or began.anchor is not None
        passing = self.solution.cut and self.patient
        return once_sound and not self.sound and not passing and (self.way.moves or began.anchor is not None)

    @property
    def divides(self) -> bool:
        """Whether a shorter increment is tried, because this one failed, or to avoid a jump."""
        way = self.way
        avoidable = self.jumps and way.length > SHORTEST_JUMP and not way.leaping
        return ((self.failed and not way.shortest) or avoidable) and not self.spent

    @property
    def unusable(self) -> bool:
        """Whether there is no state from which the load path could go on."""
        unstable = bool(self.unstable) or (self.spent and bool(self.way.unstable) and self.failed)
        return self.solution.diverged or unstable or self.folds

    @property
    def verdict(self) -> AttemptOutcome:
        """The verdict: accept, stop, halve, leap or withdraw."""
        way = self.way
        if self.divides:
            return AttemptOutcome.HALVE
        if self.unusable:
            return AttemptOutcome.LEAP if way.leap and not (way.leaping or self.spent) else AttemptOutcome.WITHDRAW
        return AttemptOutcome.STOP if self.snapped or self.spent or way.next == 1.0 else AttemptOutcome.ACCEPT

    @property
    def reason_to_withdraw(self) -> str:
        """The reason why the step returns to the last sound state."""
        way, message = self.way, self.solution.message
        if way.unstable:
            return inflated(way.unstable, self.began.commands, way.aim[1])
        if self.solution.diverged and not way.folded:
            return message
        what = ENTERS if self.solution.entered and self.solution.min_det > 0.0 else FOLDS
        return f"{what} beyond {way.done:.3g} of the way to the command; {message}".rstrip("; ")
