# SPDX-License-Identifier: Apache-2.0
"""Paths of steps, in load or in time, from the present commands to the target, and verdicts on attempted increments."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import TypeVar

import numpy as np

from gdfe_ros.actuators import Actuator
from gdfe_ros.constraints import Pose
from gdfe_ros.solver.forces.actuation import tell_limit_point
from gdfe_ros.solver.handle_motions import HandleMotions, find_deviation
from gdfe_ros.solver.matrix.rotation import apply_left_jacobian
from gdfe_ros.solver.outcome import Outcome, join, tell
from gdfe_ros.solver.solution import Increment, PathResult, Solution
from gdfe_ros.solver.state import State, replace_fields
from gdfe_ros.solver.vectors import Array, largest_distance

LARGEST_TURN = math.radians(100.0)
"""Largest rotation of a handle in one increment [rad]."""
AnyPath = TypeVar("AnyPath", bound="Path")
Place = tuple[Mapping[str, Pose], Mapping[str, float]]
"""Dict from handle or obstacle to its pose, and dict from actuator or load to its command."""


def count_increments(
    targets: Mapping[str, Pose], poses: Mapping[str, Pose], size: float, *, together: Collection[str] = ()
) -> int:
    """Return the number of increments in which a handle turns by at most `LARGEST_TURN` and moves by at most ``size``.

    Args:
        targets: pose of every handle.
        poses: present poses of the handles.
        size: size of the body [m].
        together: names of handles that move nearly as one rigid body, and whose motion hardly deforms the body.
    """
    most = 1.0
    for name, target in targets.items():
        if target == poses[name] or name in together:
            continue
        turn = math.dist(target.rotation, poses[name].rotation)
        shift = math.dist(target.translation, poses[name].translation)
        most = max(most, turn / LARGEST_TURN, shift / size)
    return math.ceil(most)


def on_path(began: Place, goal: Place, share: float, centres: Mapping[str, Array] | None = None) -> Place:
    """Return the poses and commands after the fraction ``share`` of a linear path from ``began`` to ``goal``.

    ``centres`` is a dict from handle to centre (3,) [m], of handles that move nearly as one rigid body along the path.
    """
    if share >= 1.0:
        return goal
    poses = {name: began[0][name].blend(target, share) for name, target in goal[0].items()}
    if centres:
        beside = find_deviation(began[0], poses, centres) - share * find_deviation(began[0], goal[0], centres)
        for name, shift in zip(centres, beside, strict=True):
            poses[name] = Pose(tuple(poses[name].translation - shift), poses[name].rotation)
    return poses, {name: value + share * (goal[1][name] - value) for name, value in began[1].items()}


class Verdict(Enum):
    """The consequence of an attempted increment."""

    ACCEPT = "accept, and go on from there"
    STOP = "accept, and go no farther"
    HALVE = "try half of it"
    WITHDRAW = "go back to the last sound state"


@dataclass(frozen=True, eq=False, kw_only=True)
class Path:
    """A path of commands, in load or in time, and the progress on it.

    The path consists of units. An attempt covers ``size`` units: at first `WHOLE`, and half as many after each failure.

    Attributes:
        began: state at the beginning of the path.
        state: the present state.
        goal: request for the end of the path.
        total: number of units of the whole path.
        size: number of units of the next attempt.
        done: number of completed units.
        iterations, attempts: numbers of iterations and of attempts so far.
        centres: dict from handle to centre (3,) [m] if the handles move nearly as one rigid body; otherwise empty.
    """

    WHOLE = 1
    """Number of units that an attempt covers before any halving."""

    began: State
    state: State
    goal: Increment
    total: int
    size: int
    done: int = 0
    iterations: int = 0
    attempts: int = 0
    centres: Mapping[str, Array] = field(default_factory=dict)

    @classmethod
    def over(cls: type[AnyPath], state: State, goal: Increment, count: int, **more: object) -> AnyPath:
        """Return the path from a state to a goal in ``count`` equal attempts."""
        return cls(began=state, state=state, goal=goal, total=cls.WHOLE * count, size=cls.WHOLE, **more)

    @property
    def completed(self) -> bool:
        """Whether the whole path is completed."""
        return self.done >= self.total

    @property
    def covered(self) -> float:
        """Fraction of the path that is completed."""
        return self.done / self.total

    @property
    def next(self) -> float:
        """Fraction of the path that is completed after the next attempt, if that succeeds."""
        return (self.done + self.size) / self.total

    @property
    def next_place(self) -> Place:
        """Poses and commands at the end of the next attempt."""
        began, goal = ((each.poses, each.commands) for each in (self.began, self.goal))
        return on_path(began, goal, self.next, self.centres)

    def record_attempt(self: AnyPath, solution: Solution, **seen: object) -> AnyPath:
        """Return the path with the iterations of an attempt counted, and with further fields changed to ``seen``."""
        iterations = self.iterations + solution.iterations
        return replace_fields(self, iterations=iterations, attempts=self.attempts + 1, **seen)

    def halve(self: AnyPath) -> AnyPath:
        """Return the path with the next attempt halved."""
        return replace_fields(self, size=self.size // 2)

    def advance(self: AnyPath, state: State) -> AnyPath:
        """Return the path after an attempt that led to ``state``."""
        return replace_fields(self, state=state, done=self.done + self.size)

    def result(self, skipped: dict[str, int], **more: object) -> PathResult:
        """Return the outcome of the path so far."""
        counts = {"iterations": self.iterations, "increments": self.attempts}
        return PathResult(state=self.state, completed=self.completed, skipped=skipped, **counts, **more)


@dataclass(frozen=True, eq=False, kw_only=True)
class LoadPath(Path):
    """A path of equilibria.

    Attributes:
        budget: largest number of iterations on the load path.
        jumped: whether the body has jumped to another equilibrium in an attempt.
        folded: whether an attempt ended in folded or inverted elements, or failed with corners pressed flat.
        unstable: actuator that lost its stability in an attempt; None if no actuator did.
    """

    SHORTEST = 1.0 / 256.0
    """An increment of at most this fraction of a load path is not halved again."""
    WHOLE = 256

    budget: int
    jumped: bool = False
    folded: bool = False
    unstable: Actuator | None = None

    @property
    def moves(self) -> bool:
        """Whether the poses or commands at the end differ from those at the beginning."""
        return self.began.poses != self.goal.poses or self.began.commands != self.goal.commands

    @property
    def length(self) -> float:
        """Fraction of the load path that the next attempt covers."""
        return self.size / self.total

    @property
    def shortest(self) -> bool:
        """Whether the increment is too short to be halved."""
        return self.length <= self.SHORTEST or not self.moves

    @property
    def left(self) -> int:
        """Number of remaining iterations, at least one."""
        return max(1, self.budget - self.iterations)


@dataclass(frozen=True, eq=False, kw_only=True)
class Attempt:
    """Result of an attempted increment, and the evidence for the verdict.

    Attributes:
        path: the load path at the state before the attempt, with the iterations of the attempt counted.
        solution: result of the solve.
        jumps: whether the body jumped to another equilibrium.
        unstable: actuator that lost its stability; None if no actuator did.
        spent: whether no iterations or no time are left for another attempt.
        patient: whether a folded shape is accepted if a limit or the deadline ended the solve. This is the case while
            the number of iterations for this command, including earlier unfinished steps, is below the solver's
            patience.
    """

    SHORTEST_STUCK = 1.0 / 4.0
    """An increment whose solve got stuck is not halved again if it is at most this fraction of a load path."""
    STUCK = 1e-4
    """A solve without further descent is stuck, for example at a kink of the energy, if the estimated distance to the
    equilibrium, divided by the body's size, exceeds this. At a smaller distance, the rounding of the energy has ended
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
    solution: Solution
    jumps: bool
    unstable: Actuator | None
    spent: bool
    patient: bool

    @property
    def sound(self) -> bool:
        """Whether no element is folded or inverted, and no surface penetrates another."""
        return self.solution.min_det > 0.0 and not self.solution.entered

    @property
    def snapped(self) -> bool:
        """Whether the body jumped to another equilibrium, or jumped earlier on the path and has not converged now."""
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
        """Whether a sound body became unsound; False if the solve was cut and the attempt is `patient`."""
        before = self.path.state
        once_sound = before.sound or before.anchor is not None
        passing = self.solution.cut and self.patient
        return once_sound and not self.sound and not passing and (self.path.moves or before.anchor is not None)

    @property
    def verdict(self) -> Verdict:
        """The consequence of the attempt."""
        path, failed = self.path, self.failed
        avoidable = self.jumps and path.length > self.SHORTEST_JUMP
        if ((failed and not path.shortest) or avoidable) and not self.spent:
            return Verdict.HALVE
        if self.unstable or (self.spent and path.unstable and failed) or self.solution.diverged or self.folds:
            return Verdict.WITHDRAW
        ends = self.snapped or self.spent or failed or path.next == 1.0
        return Verdict.STOP if ends else Verdict.ACCEPT

    @property
    def reason_to_withdraw(self) -> str:
        """The reason why the step returns to the last sound state."""
        path, message = self.path, self.solution.message
        if path.unstable:
            return tell_limit_point(path.unstable, path.state.commands, path.next_place[1])
        if self.solution.diverged and not path.folded:
            return message
        enters = self.solution.entered and self.solution.min_det > 0.0
        what = tell(Outcome.ENTERED if enters else Outcome.FOLDED)
        return join(f"{what} beyond {path.covered:.3g} of the way to the command", message)


def work_between(old: State, new: State, handles: HandleMotions) -> tuple[float, float]:
    """Return the work [J] of handles and commands between two states, and its uncertainty [J].

    The work follows from the trapezoidal rule. The uncertainty is half of the difference between the work with the
    forces at the beginning and with the forces at the end.
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


def has_jumped(old: State, new: Solution, handles: HandleMotions, size: float) -> bool:
    """Return whether a body of ``size`` [m] jumped between two equilibria, as in buckling.

    Along a stable branch, the potential changes by the work of handles and commands. This work is the integral of the
    potential's slopes with respect to poses and commands. If the slopes are monotone, the integral lies between two
    bounds, computed with the first slopes and with the last slopes. Loads always have monotone slopes, because the
    potential of a stable branch is concave in a load. A jump releases more energy than these bounds allow, and ends far
    from the positions that were predicted from the last motion.
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


def _displacement(begin: Pose, end: Pose) -> Array:
    """Return translation [m] and rotation about world axes [rad] (6,); its product with a wrench is the work."""
    middle, change = 0.5 * np.add(end.rotation, begin.rotation), np.subtract(end.rotation, begin.rotation)
    turned = apply_left_jacobian(middle[None], change[None])[0]
    return np.concatenate([np.subtract(end.translation, begin.translation), turned])
