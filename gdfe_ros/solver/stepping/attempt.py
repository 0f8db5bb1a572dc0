# SPDX-License-Identifier: Apache-2.0
"""One attempt at a share of a way, and the verdict on it."""

from __future__ import annotations

from dataclasses import dataclass

from gdfe_ros.solver.solution import Solution
from gdfe_ros.solver.state import State
from gdfe_ros.solver.stepping.way import Verdict, Way
from gdfe_ros.solver.terms.actuation import inflated

SHORTEST_LOST = 1.0 / 4.0
"""Share of a command below which an increment is not halved again where its equilibrium cannot be told."""
SHORTEST_JUMP = 1.0 / 32.0
"""Share of a way that is not cut further for a jump: enough to tell that smaller steps do not prevent it."""
FOLDS, ENTERS = "elements would fold or turn inside out", "surfaces would enter each other"


@dataclass(frozen=True, eq=False, kw_only=True)
class Attempt:
    """What an attempt found, and what speaks for and against it.

    Attributes:
        way: with what the attempt has cost and shown; its end is not reached yet.
        began: the state from which it was made.
        solution: what was found.
        jumps: the body jumped to another equilibrium.
        unstable: names the chamber that lost its stability; empty for none.
        spent: no iteration or no time is left for another attempt.
        patient: a solve that is cut may pass through folded shapes: so few iterations were made for this command,
            those of cut steps before it included, that it may yet arrive.
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
        """Whether no element is folded or inverted, and no surface deep inside of another."""
        return self.solution.min_det > 0.0 and not self.solution.buried

    @property
    def snapped(self) -> bool:
        """Whether the body came to another equilibrium, or to none after a jump."""
        return self.jumps or (self.way.jumped and not self.solution.converged)

    @property
    def verdict(self) -> Verdict:
        """What follows from it."""
        way, began, solution = self.way, self.began, self.solution
        given_up = solution.exhausted or (solution.lost and way.length <= SHORTEST_LOST)
        failed = not (solution.converged or given_up) or not self.sound
        avoidable = self.jumps and way.length > SHORTEST_JUMP and not way.leaping
        if ((failed and not way.shortest) or avoidable) and not self.spent:
            return Verdict.HALVE
        once_sound = began.sound or began.anchor is not None
        passing = solution.cut and self.patient
        folds = once_sound and not self.sound and not passing and (way.moves or began.anchor is not None)
        if solution.diverged or self.unstable or folds:
            return Verdict.LEAP if way.leap and not (way.leaping or self.spent) else Verdict.WITHDRAW
        return Verdict.STOP if self.snapped or self.spent or way.next == 1.0 else Verdict.ACCEPT

    @property
    def reason_to_withdraw(self) -> str:
        """Why it is taken back."""
        way, message = self.way, self.solution.message
        if self.unstable:
            return inflated(self.unstable, self.began.commands, way.aim[1])
        if self.solution.diverged and not way.folded:
            return message
        what = ENTERS if self.solution.buried and self.solution.min_det > 0.0 else FOLDS
        return f"{what} beyond {way.done:.3g} of the way to the command; {message}".rstrip("; ")
