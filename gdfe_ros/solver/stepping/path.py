# SPDX-License-Identifier: Apache-2.0
"""Load path of a step from the present commands to the target, its attempted increments, and the verdicts on them."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.constraints import Pose
from gdfe_ros.solver.deadline import Deadline
from gdfe_ros.solver.elements.barrier import THRESHOLD
from gdfe_ros.solver.forces.actuation import inflated
from gdfe_ros.solver.handle_motions import HandleMotions
from gdfe_ros.solver.matrix.rotation import apply_left_jacobian
from gdfe_ros.solver.outcome import Outcome, join, tell
from gdfe_ros.solver.solution import Solution
from gdfe_ros.solver.state import State
from gdfe_ros.solver.value import NEGLIGIBLE, changed
from gdfe_ros.solver.vectors import largest_distance

LARGEST_TURN = math.radians(100.0)
"""Largest rotation of a handle in one increment [rad]."""
Place = tuple[Mapping[str, Pose], Mapping[str, float]]
"""Dict from handle or obstacle to its pose, and dict from actuator or load to its command."""


def planned_increments(
    targets: Mapping[str, Pose], poses: Mapping[str, Pose], size: float, *, together: Collection[str] = ()
) -> int:
    """Return the number of increments. In each, a handle turns by at most `LARGEST_TURN` and moves by at most ``size``.

    Args:
        targets: pose of every handle.
        poses: present poses of the handles.
        size: size of the body [m].
        together: names of handles that move nearly as one rigid body, and whose motion hardly deforms it.
    """
    most = 1.0
    for name, target in targets.items():
        if target == poses[name] or name in together:
            continue
        turn = math.dist(target.rotation, poses[name].rotation)
        shift = math.dist(target.translation, poses[name].translation)
        most = max(most, turn / LARGEST_TURN, shift / size)
    return math.ceil(most)


def on_path(began: Place, goal: Place, share: float, centres: Mapping[str, NDArray[np.float64]] | None = None) -> Place:
    """Return the poses and commands at a ``share`` of the linear path; from 1 on they are those of ``goal``.

    ``centres`` (3,) [m] are those of handles that move nearly as one rigid body: they do so all along the path.
    """
    if share >= 1.0:
        return goal
    poses = {name: began[0][name].blend(target, share) for name, target in goal[0].items()}
    if centres:
        beside = _beside(began[0], goal[0], poses, centres) - share * _beside(began[0], goal[0], goal[0], centres)
        for name, shift in zip(centres, beside, strict=True):
            poses[name] = Pose(tuple(poses[name].translation - shift), poses[name].rotation)
    return poses, {name: value + share * (goal[1][name] - value) for name, value in began[1].items()}


def _beside(
    began: Mapping[str, Pose],
    goal: Mapping[str, Pose],
    poses: Mapping[str, Pose],
    centres: Mapping[str, NDArray[np.float64]],
) -> NDArray[np.float64]:
    """Return how far handles at ``poses`` are (k, 3) [m] from a rigid rotation about the mean of their ``centres``."""
    start, here = (np.array([centres[name] + each[name].translation for name in centres]) for each in (began, poses))
    arms = start - start.mean(axis=0)
    turned = np.array([poses[name].turn_from(began[name]) @ arm for name, arm in zip(centres, arms, strict=True)])
    return here - here.mean(axis=0) - turned


class Verdict(Enum):
    """The consequence of an attempted increment."""

    ACCEPT = "accept, and go on from there"
    STOP = "accept, and go no farther"
    HALVE = "try half of it"
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
class LoadPath:
    """A load path and the progress on it.

    Attributes:
        poses, commands: poses and commands at the beginning.
        goal: target at the end.
        budget: largest number of iterations on the load path.
        length: fraction of the load path that the next attempt covers.
        centres: centres (3,) [m] of the handles if they move nearly as one rigid body, otherwise empty.
        done: fraction of the load path that is completed.
        iterations, attempts: numbers of iterations and of attempts so far.
        jumped: whether the body has jumped to another equilibrium in an attempt.
        folded: whether an attempt ended in folded or inverted elements, or failed with corners pressed flat.
        unstable: name of a chamber that lost its stability in an attempt; empty for none.
    """

    SHORTEST_SUBSTEP = 1.0 / 256.0
    """An increment of at most this fraction of a load path is not halved again."""

    poses: Mapping[str, Pose]
    commands: Mapping[str, float]
    goal: Goal
    budget: int
    length: float
    centres: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    done: float = 0.0
    iterations: int = 0
    attempts: int = 0
    jumped: bool = False
    folded: bool = False
    unstable: str = ""

    @classmethod
    def between(
        cls, state: State, goal: Goal, increments: int, limit: int, centres: Mapping[str, NDArray[np.float64]]
    ) -> LoadPath:
        """Return the load path from a state to a goal; its budget is ``increments`` times ``limit`` iterations."""
        began = {"poses": state.poses, "commands": state.commands, "centres": centres}
        return cls(goal=goal, budget=increments * limit, length=1.0 / increments, **began)

    @property
    def moves(self) -> bool:
        """Whether the poses or commands at the end differ from those at the beginning."""
        return self.poses != self.goal.poses or self.commands != self.goal.commands

    @property
    def shortest(self) -> bool:
        """Whether the increment is too short to be halved."""
        return self.length <= self.SHORTEST_SUBSTEP or not self.moves

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
        began, goal = (self.poses, self.commands), (self.goal.poses, self.goal.commands)
        return on_path(began, goal, self.next, self.centres)

    def tried(self, solution: Solution, *, jumps: bool) -> LoadPath:
        """Return the load path after an attempt: iterations are added, and a jump or folded elements are recorded."""
        sound = solution.min_det > 0.0
        return changed(
            self,
            iterations=self.iterations + solution.iterations,
            attempts=self.attempts + 1,
            jumped=self.jumped or jumps,
            folded=self.folded or not sound or (solution.min_det < THRESHOLD and not solution.converged),
        )

    def after(self, verdict: Verdict) -> LoadPath:
        """Return the load path with the progress and the next length that follow from a verdict."""
        if verdict is Verdict.HALVE:
            return changed(self, length=0.5 * self.length)
        return self if verdict is Verdict.WITHDRAW else changed(self, done=self.next)


@dataclass(frozen=True, eq=False, kw_only=True)
class Attempt:
    """Result of an attempted increment, and the evidence for the verdict.

    Attributes:
        path: the load path after `LoadPath.tried`; ``path.done`` does not include this increment yet.
        began: the state at the beginning of the increment.
        solution: result of the solve.
        jumps: whether the body jumped to another equilibrium.
        unstable: name of the chamber that lost its stability; empty for none.
        spent: whether no iterations or no time are left for another attempt.
        patient: whether a folded shape is accepted if a limit or the deadline ended the solve. It is accepted as long
            as the number of iterations for this command, including earlier unfinished steps, is below the solver's
            ``patience``.
    """

    SHORTEST_STUCK = 1.0 / 4.0
    """An increment whose solve got stuck is not halved again if it is at most this fraction of a load path."""
    STUCK = 1e-4
    """A solve without further descent is stuck if the estimated distance to the equilibrium, divided by the body's
    size, exceeds this. An example is a kink of the energy. At a smaller distance, the rounding of the energy has ended
    the solve.
    """
    SHORTEST_JUMP = 1.0 / 32.0
    """A jump is accepted in an increment of at most this fraction of a load path; shorter increments would jump, too.
    """
    PROVEN = 0.01
    """The energy balance shows a jump if the released energy minus the uncertainty of the work, divided by the largest
    of the energies and the work, exceeds this.
    """
    LEAST_MOTION = 5e-3
    """Least distance between the predicted and the actual end of a jump, divided by the body's size. A cable that
    becomes taut during an increment also violates the balance, but causes no large displacement.
    """

    path: LoadPath
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
        return self.jumps or (self.path.jumped and not self.solution.converged)

    @property
    def failed(self) -> bool:
        """Whether the solve ended neither at a sound equilibrium nor as near to it as its precision allows."""
        solution = self.solution
        stuck = solution.error_estimate > self.STUCK and self.path.length > self.SHORTEST_STUCK
        given_up = solution.exhausted and not stuck
        return not (solution.converged or given_up) or not self.sound

    @property
    def folds(self) -> bool:
        """Whether a body that was sound is not sound any more, and its solve was not just cut short."""
        began = self.began
        once_sound = began.sound or began.anchor is not None
        passing = self.solution.cut and self.patient
        return once_sound and not self.sound and not passing and (self.path.moves or began.anchor is not None)

    @property
    def divides(self) -> bool:
        """Whether a shorter increment is tried, because this one failed, or to avoid a jump."""
        path = self.path
        avoidable = self.jumps and path.length > self.SHORTEST_JUMP
        return ((self.failed and not path.shortest) or avoidable) and not self.spent

    @property
    def unusable(self) -> bool:
        """Whether there is no state from which the load path could go on."""
        unstable = bool(self.unstable) or (self.spent and bool(self.path.unstable) and self.failed)
        return self.solution.diverged or unstable or self.folds

    @property
    def verdict(self) -> Verdict:
        """The verdict: accept, stop, halve or withdraw."""
        path = self.path
        if self.divides:
            return Verdict.HALVE
        if self.unusable:
            return Verdict.WITHDRAW
        return Verdict.STOP if self.snapped or self.spent or path.next == 1.0 else Verdict.ACCEPT

    @property
    def reason_to_withdraw(self) -> str:
        """The reason why the step returns to the last sound state."""
        path, message = self.path, self.solution.message
        if path.unstable:
            return inflated(path.unstable, self.began.commands, path.aim[1])
        if self.solution.diverged and not path.folded:
            return message
        enters = self.solution.entered and self.solution.min_det > 0.0
        what = tell(Outcome.ENTERED if enters else Outcome.FOLDED)
        return join(f"{what} beyond {path.done:.3g} of the way to the command", message)


def work_between(old: State, new: State, handles: HandleMotions) -> tuple[float, float]:
    """Return the work [J] of handles and commands between two states, and its uncertainty [J].

    The work follows from the trapezoidal rule. The uncertainty is half of the difference between the work with the
    first slopes and the work with the last slopes.
    """
    work, doubt, first, last = 0.0, 0.0, old.summary.reactions, new.summary.reactions
    for name, pose in new.poses.items():
        if pose == old.poses[name] or not (first[name].any() or last[name].any()):
            continue  # most links of an arm touch nothing
        moved = _displacement(*(handles.pose(name, state.poses, state.turns) for state in (old, new)))
        work += 0.5 * float((first[name] + last[name]) @ moved)
        doubt += 0.5 * abs(float((last[name] - first[name]) @ moved))
    for name, slope in new.balance.slopes.items():
        change, before = new.commands[name] - old.commands[name], old.balance.slopes[name]
        work += 0.5 * (before + slope) * change
        doubt += 0.5 * abs((slope - before) * change)
    return work, doubt


def jumped(old: State, new: Solution, handles: HandleMotions, size: float) -> bool:
    """Return whether a body of ``size`` [m] jumped between two equilibria, as in buckling.

    Along a stable branch, the potential changes by the work of handles and commands, the integral of its slopes with
    respect to poses and commands. If the slopes are monotone, the integral lies between two bounds: those computed with
    the first slopes and with the last slopes. Loads always have monotone slopes, because the potential of a stable
    branch is concave in a load. A jump releases more energy than these bounds allow, and ends far from the positions
    that were predicted from the last motion.
    """
    found = new.state
    if old.balance is None or found.balance is None:
        return False
    work, doubt = work_between(old, found, handles)
    before, after = old.summary.energy, found.summary.energy
    rubbed = found.dissipated - old.dissipated
    lost = before + old.balance.potential + work - after - found.balance.potential - rubbed
    scale = max(before, after, abs(work), abs(found.balance.potential - old.balance.potential))
    if not lost > doubt + Attempt.PROVEN * scale:
        return False
    return bool(largest_distance(new.positions, new.began) > Attempt.LEAST_MOTION * size)


def _displacement(begin: Pose, end: Pose) -> NDArray[np.float64]:
    """Return translation [m] and rotation about world axes [rad] (6,); their product with a wrench is its work."""
    middle, change = 0.5 * np.add(end.rotation, begin.rotation), np.subtract(end.rotation, begin.rotation)
    return np.concatenate([np.subtract(end.translation, begin.translation), apply_left_jacobian(middle, change)])
