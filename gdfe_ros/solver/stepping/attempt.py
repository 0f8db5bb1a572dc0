# SPDX-License-Identifier: Apache-2.0
"""One attempt at a share of a command, and the verdict on it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum

from gdfe_ros.constraints import Pose
from gdfe_ros.solver.solution import Solution
from gdfe_ros.solver.state import State
from gdfe_ros.solver.terms.actuation import Actuation, inflated

SHORTEST_SUBSTEP, SHORTEST_JUMP = 1.0 / 256.0, 1.0 / 32.0
"""Shares of a command; of a jump the second is enough to tell that smaller steps do not prevent it."""
ROUNDING = 1e-9
"""Share of a command that counts as none."""
FOLDS = "elements would fold or turn inside out"


class Verdict(Enum):
    """What follows from an attempt."""

    ACCEPT = "accept"
    HALVE = "halve"
    WITHDRAW = "withdraw"


@dataclass(frozen=True, eq=False)
class Way:
    """The way from where a step begins to its command.

    Attributes:
        poses, commands: at the beginning.
        targets, wanted: at the end.
        done: share of it behind.
        length: share of it that is attempted next.
        jumped: the body has jumped on it.
        folded: an attempt ended in folded or inverted elements.
        leap: length of the first attempt from here that jumped to a sound equilibrium; 0 for none.
        leaping: shorter attempts led nowhere, and that jump is taken.
    """

    poses: Mapping[str, Pose]
    commands: Mapping[str, float]
    targets: Mapping[str, Pose]
    wanted: Mapping[str, float]
    done: float
    length: float
    jumped: bool = False
    folded: bool = False
    leap: float = 0.0
    leaping: bool = False

    @property
    def moves(self) -> bool:
        """Whether the end differs from the beginning."""
        return self.poses != self.targets or self.commands != self.wanted

    @property
    def shortest(self) -> bool:
        """Whether a shorter attempt is not made."""
        return self.length <= SHORTEST_SUBSTEP or not self.moves

    @property
    def next(self) -> float:
        """Share of the way at which the next attempt ends."""
        return 1.0 if self.done + self.length > 1.0 - ROUNDING else self.done + self.length

    def after(self, solution: Solution, *, jumps: bool) -> Way:
        """Return the way with what an attempt on it has shown."""
        sound = solution.min_det > 0.0
        if sound and not jumps:
            return self
        leap = self.leap or (self.length if jumps and sound and solution.converged else 0.0)
        return replace(self, jumped=self.jumped or jumps, folded=self.folded or not sound, leap=leap)

    def at(self, share: float) -> tuple[Mapping[str, Pose], Mapping[str, float]]:
        """Return poses and commands at a share of the way."""
        if share == 1.0:
            return self.targets, self.wanted
        poses = {name: self.poses[name].blend(target, share) for name, target in self.targets.items()}
        commands = {name: value + share * (self.wanted[name] - value) for name, value in self.commands.items()}
        return poses, commands


def judge(
    way: Way, state: State, solution: Solution, *, jumps: bool, unstable: bool, spent: bool, patient: bool
) -> Verdict:
    """Judge an attempt.

    Args:
        way: that is followed.
        state: where the attempt began.
        solution: what it found.
        jumps: the body jumped to another equilibrium.
        unstable: a chamber lost its stability.
        spent: no iteration or no time is left for another attempt.
        patient: a solve that is cut may pass through folded shapes: so few iterations were made for this command,
            those of cut steps before it included, that it may yet arrive.
    """
    sound = solution.min_det > 0.0
    failed = not (solution.converged or solution.exhausted) or solution.min_det <= 0.0
    avoidable = jumps and way.length > SHORTEST_JUMP and not way.leaping
    shortened = (failed and not way.shortest) or avoidable
    if shortened and not spent:
        return Verdict.HALVE
    once_sound = state.sound or state.anchor is not None
    folds = once_sound and not sound and not (solution.cut and patient) and (way.moves or state.anchor is not None)
    return Verdict.WITHDRAW if solution.diverged or unstable or folds else Verdict.ACCEPT


def reason_to_withdraw(way: Way, state: State, solution: Solution, actuation: Actuation) -> str:
    """Say why an attempt is taken back."""
    message, commands = solution.state.summary.message, way.at(way.next)[1]
    unstable = unstable_chamber(state, solution, commands, actuation)
    if unstable:
        return inflated(unstable, state.commands, commands)
    if solution.diverged and not way.folded:
        return message
    return f"{FOLDS} beyond {way.done:.3g} of the way to the command; {message}".rstrip("; ")


def unstable_chamber(state: State, solution: Solution, commands: Mapping[str, float], actuation: Actuation) -> str:
    """Name the chamber that lost its stability in an attempt that came to an end without an equilibrium."""
    if solution.converged or solution.cut:
        return ""
    return actuation.unstable(solution.positions, commands, state.commands if solution.diverged else None)
