# SPDX-License-Identifier: Apache-2.0
"""Load path of a step, from the present commands to the target, its increments, and the progress on it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

from gdfe_ros.constraints import Pose
from gdfe_ros.solver.deadline import Deadline
from gdfe_ros.solver.elements.barrier import THRESHOLD
from gdfe_ros.solver.solution import Solution
from gdfe_ros.solver.state import State
from gdfe_ros.solver.value import NEGLIGIBLE, changed

SHORTEST_SUBSTEP = 1.0 / 256.0
"""An increment of at most this fraction of a load path is not halved again."""
LARGEST_TURN = math.radians(100.0)
"""Largest rotation of a handle in one increment [rad]."""
Place = tuple[Mapping[str, Pose], Mapping[str, float]]
"""Dict from handle or obstacle to its pose, and dict from actuator or load to its command."""


def planned_increments(targets: Mapping[str, Pose], poses: Mapping[str, Pose], size: float) -> int:
    """Return the number of increments. In each, a handle turns by at most `LARGEST_TURN` and moves by at most ``size``.

    Args:
        targets: pose of every handle.
        poses: present poses of the handles.
        size: size of the body [m].
    """
    most = 1.0
    for name, target in targets.items():
        if target == poses[name]:
            continue
        turn = math.dist(target.rotation, poses[name].rotation)
        shift = math.dist(target.translation, poses[name].translation)
        most = max(most, turn / LARGEST_TURN, shift / size)
    return math.ceil(most)


def on_path(began: Place, goal: Place, share: float) -> Place:
    """Return the poses and commands at a ``share`` of the linear path; from 1 on they are those of ``goal``."""
    if share >= 1.0:
        return goal
    poses = {name: began[0][name].blend(target, share) for name, target in goal[0].items()}
    return poses, {name: value + share * (goal[1][name] - value) for name, value in began[1].items()}


class AttemptOutcome(Enum):
    """The consequence of an attempted increment."""

    ACCEPT = "accept, and go on from there"
    STOP = "accept, and go no farther"
    HALVE = "try half of it"
    LEAP = "take the jump that was avoided so far"
    WITHDRAW = "go back to the last sound state"


@dataclass(frozen=True, eq=False, kw_only=True)
class Goal:
    """Target of a step.

    Attributes:
        poses: pose of every handle, relative to its rest pose.
        commands: command of every actuator and load.
        tolerance: allowed distance to the equilibrium, divided by the body's size.
        deadline: once it has passed, the step ends with the state that it has reached; None for no deadline.
    """

    poses: Mapping[str, Pose]
    commands: Mapping[str, float]
    tolerance: float
    deadline: Deadline | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class Way:
    """A load path and the progress on it.

    Attributes:
        poses, commands: poses and commands at the beginning.
        goal: target at the end.
        budget: largest number of iterations on the load path.
        length: fraction of the load path that the next attempt covers.
        done: fraction of the load path that is completed.
        iterations, attempts: numbers of iterations and of attempts so far.
        jumped: whether the body has jumped to another equilibrium in an attempt.
        folded: whether an attempt ended in folded or inverted elements, or failed with corners pressed flat.
        leap: length of the first attempt from the present state that jumped to a sound equilibrium; 0 for none.
        leaping: whether this jump is accepted, because shorter attempts failed.
        unstable: name of a chamber that lost its stability in an attempt; empty for none.
    """

    poses: Mapping[str, Pose]
    commands: Mapping[str, float]
    goal: Goal
    budget: int
    length: float
    done: float = 0.0
    iterations: int = 0
    attempts: int = 0
    jumped: bool = False
    folded: bool = False
    leap: float = 0.0
    leaping: bool = False
    unstable: str = ""

    @classmethod
    def between(cls, state: State, goal: Goal, increments: int, limit: int) -> Way:
        """Return the load path from a state to a goal; its budget is ``increments`` times ``limit`` iterations."""
        budget, length = increments * limit, 1.0 / increments
        return cls(poses=state.poses, commands=state.commands, goal=goal, budget=budget, length=length)

    @property
    def moves(self) -> bool:
        """Whether the poses or commands at the end differ from those at the beginning."""
        return self.poses != self.goal.poses or self.commands != self.goal.commands

    @property
    def shortest(self) -> bool:
        """Whether the increment is too short to be halved."""
        return self.length <= SHORTEST_SUBSTEP or not self.moves

    @property
    def next(self) -> float:
        """Position on the load path at which the next attempt ends, as a fraction of the load path."""
        return 1.0 if self.done + self.length > 1.0 - NEGLIGIBLE else self.done + self.length

    @property
    def left(self) -> int:
        """Number of remaining iterations, at least one."""
        return max(1, self.budget - self.iterations)

    @property
    def aim(self) -> tuple[Mapping[str, Pose], Mapping[str, float]]:
        """Poses and commands at the end of the next attempt."""
        return on_path((self.poses, self.commands), (self.goal.poses, self.goal.commands), self.next)

    def tried(self, solution: Solution, *, jumps: bool) -> Way:
        """Return the load path after an attempt: iterations are added, and a jump or folded elements are recorded."""
        sound = solution.min_det > 0.0
        return changed(
            self,
            iterations=self.iterations + solution.iterations,
            attempts=self.attempts + 1,
            jumped=self.jumped or jumps,
            folded=self.folded or not sound or (solution.min_det < THRESHOLD and not solution.converged),
            leap=self.leap or (self.length if jumps and sound and solution.converged else 0.0),
        )

    def after(self, verdict: AttemptOutcome) -> Way:
        """Return the load path with the progress and the next length that follow from a verdict."""
        if verdict is AttemptOutcome.HALVE:
            return changed(self, length=0.5 * self.length)
        if verdict is AttemptOutcome.LEAP:
            return changed(self, length=self.leap, leaping=True)
        return self if verdict is AttemptOutcome.WITHDRAW else changed(self, done=self.next, leap=0.0, leaping=False)
