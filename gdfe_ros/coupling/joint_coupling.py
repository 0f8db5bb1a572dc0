# SPDX-License-Identifier: Apache-2.0
"""Implicit coupling of yielding joints and the soft body: both are in balance at the end of each step."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.actuators import Load, total_gravity
from gdfe_ros.arms.arm import Arm
from gdfe_ros.arms.carriers import Carriers, Motions
from gdfe_ros.constraints.pose import Pose
from gdfe_ros.coupling.balance import BalanceSearch, JointBalance, Links, distance, on_links
from gdfe_ros.coupling.link_motion import LinkMotion
from gdfe_ros.solver.contact.field import find_touches
from gdfe_ros.solver.contact.touch import Touch
from gdfe_ros.solver.motion.stepper import MotionStepper
from gdfe_ros.solver.motion.time_path import reduction
from gdfe_ros.solver.outcome import Deadline, join, past
from gdfe_ros.solver.settings import Dynamics
from gdfe_ros.solver.solution import PathResult
from gdfe_ros.solver.state import State, replace_fields
from gdfe_ros.solver.stepping.path import on_path
from gdfe_ros.solver.stepping.stepper import Stepper
from gdfe_ros.solver.vectors import NEGLIGIBLE

Vector = NDArray[np.float64]
BALANCED = 0.1
"""The search ends as soon as the length of the correction, divided by the allowed length, is at most this."""
STALLED_SOLVES = 4
"""If this number of successive solves have not halved the shortest correction so far, the search ends once that
correction is within the allowed length.
"""
SOLVES = 24
"""Largest number of solves of the body for one balance; usually there are 2 to 4."""
HALVINGS, MOVING_HALVINGS = 6, 2
"""Largest number of halvings of a failing step: without dynamics, and of an internal step of a motion."""
LONGEST_CORRECTION = 1.0
"""Largest motion of a flange by one correction, divided by the body's size."""


@dataclass(frozen=True, eq=False, kw_only=True)
class CoupledStep:
    """Outcome of a step of the body and the yielding joints.

    Attributes:
        result: outcome of the body.
        links: motion of the yielding joints after the step.
        poses: dict from each handle or obstacle that a link moves to its pose.
        balanced: True if the joints are in balance, and also if the body has not converged.
    """

    result: PathResult
    links: Links
    poses: dict[str, Pose]
    balanced: bool = True


@dataclass(frozen=True, eq=False, kw_only=True)
class _Task:
    """Arguments of `JointCoupling.step`: the state before the step, and the commands after it."""

    state: State
    links: Links
    motors: tuple[Motions, Motions]
    targets: Mapping[str, Pose]
    commands: Mapping[str, float]

    def part(self, number: int, count: int, state: State, links: Links) -> _Task:
        """Return part ``number`` of ``count`` equal parts; it starts from ``state`` and ``links``."""
        share, began = (number + 1) / count, self.state
        poses, values = on_path((began.poses, began.commands), (self.targets, self.commands), share)
        motors = Carriers.part_way(*self.motors, number / count), Carriers.part_way(*self.motors, share)
        return _Task(state=state, links=links, motors=motors, targets=poses, commands=values)


class JointCoupling:
    """The arms with yielding joints, and the body that they carry.

    The wrenches in `JointBalance` are known only at positions q for which the body was solved, with its handle at the
    flange's pose. `BalanceSearch` corrects q until the joints are in balance. Each correction needs one more solve of
    the body, from the beginning of the step. Equilibria are solved to `FINER` times the tolerance: an error of the
    wrench that is harmless for the body would move softer joints by more than the tolerance.

    Args:
        arms: arms of the scene; arms without springs are left out.
        stepper: stepper of the body.
        dynamics: time scheme of the scene; None for equilibria.
        loads: loads of the scene; gravity acts on the links.
        tolerance: tolerance of the solver, divided by the size of the body.
        origin: (3,) [m] origin of the positions in a state.
    """

    def __init__(
        self,
        arms: Sequence[Arm],
        stepper: Stepper | MotionStepper,
        *,
        dynamics: Dynamics | None,
        loads: Sequence[Load],
        tolerance: float,
        origin: Vector,
    ) -> None:
        self._arms = tuple(arm for arm in arms if arm.springs is not None)
        self._stepper, self._dynamics, self._loads, self._origin = stepper, dynamics, loads, origin
        self._size = stepper.body.size
        self._near = tolerance * self._size
        self._finer = {"tolerance": Stepper.FINER * tolerance} if dynamics is None else {}

    def __bool__(self) -> bool:
        return bool(self._arms)

    def at_rest(self) -> Links:
        """Return the initial motion of the yielding joints: initial positions and no velocity."""
        return {arm.name: LinkMotion.at(arm.start[arm.springs.yielding]) for arm in self._arms}

    @staticmethod
    def restore(links: Mapping[str, Sequence[Vector]]) -> Links:
        """Return the motion of the yielding joints that a snapshot contains."""
        return {name: LinkMotion(*parts) for name, parts in links.items()}

    def on_links(self, motions: Motions, links: Links) -> Motions:
        """Return the motions of all joints on the side of the links; ``motions`` are those of the motors."""
        return motions | {arm.name: on_links(arm, motions[arm.name], links[arm.name]) for arm in self._arms}

    def rests(self, motions: Motions, links: Links) -> bool:
        """Return whether the motors are at their goals, and the links move less than the tolerance in `CALM` [s]."""
        for arm in self._arms:
            if not motions[arm.name].arrived:
                return False
            now = links[arm.name]
            for move in (MotionStepper.CALM * now.velocities, MotionStepper.CALM**2 * now.balanced):
                far = distance(arm, motions, now.positions, now.positions + move, self._size)
                if not far <= self._near:
                    return False
        return True

    def step(
        self,
        state: State,
        *,
        links: Links,
        motors: tuple[Motions, Motions],
        targets: Mapping[str, Pose],
        commands: Mapping[str, float],
        duration: float,
        deadline: Deadline | None,
    ) -> CoupledStep:
        """Return the outcome of a step; with dynamics, the joints are in balance after each internal step.

        Args:
            state: state of the body before the step.
            links: motion of the yielding joints before the step.
            motors: motions of the motors before and after the step.
            targets: poses of handles and obstacles after the step; poses of handles and obstacles on arms are replaced.
            commands: commands after the step.
            duration: duration of the step [s].
            deadline: deadline of the step; None for none.
        """
        count, halvings = 1, HALVINGS
        if self._dynamics is not None:
            count, halvings = max(1, math.ceil(duration / self._dynamics.step - NEGLIGIBLE)), MOVING_HALVINGS
        state = self._stepper.start_motion(state, commands)
        task = _Task(state=state, links=links, motors=motors, targets=targets, commands=commands)
        return self._step_in_parts(task, count, duration, deadline, halvings)

    def _step_in_parts(
        self, task: _Task, count: int, duration: float, deadline: Deadline | None, halvings: int
    ) -> CoupledStep:
        """Return the outcome of a task in ``count`` equal parts, up to the first part that fails."""
        h, state, links, result = float(f"{duration / count:.9g}"), task.state, task.links, None
        for number in range(count):
            found = self._make(task.part(number, count, state, links), h, deadline, halvings)
            result, links = _join(result, found.result), found.links
            state = result.state
            if result.completed and number + 1 < count and past(deadline):
                text = f"{number + 1} of {count} parts of the step are done: {deadline.reason}"
                result = replace_fields(_flaw(result, text), completed=False)
            if not result.completed or (self._dynamics is None and not result.sound):
                break
        return CoupledStep(result=result, links=links, poses=found.poses)

    def _make(self, task: _Task, h: float, deadline: Deadline | None, halvings: int) -> CoupledStep:
        """Return the outcome of a task, or that of its two halves if the task fails and the halves succeed.

        Halves are tried for two reasons. At the first guess of the joints' positions, a long step may press the body
        too far. In a motion, the wrench may jump if the stepper of the body chooses another scheme for the step.
        """
        found = self._balance(task, h, deadline)
        hopeless = self._dynamics is not None and found.balanced
        if found.result.sound or hopeless or not halvings or past(deadline):
            return found
        halves = self._step_in_parts(task, 2, h, deadline, halvings - 1)
        chosen = halves if halves.result.sound else found
        spent = found.result.iterations + halves.result.iterations
        return replace_fields(chosen, result=replace_fields(chosen.result, iterations=spent))

    def _balance(self, task: _Task, h: float, deadline: Deadline | None) -> CoupledStep:
        """Return body and joints in balance at the end of a task, or the outcome with the smallest correction."""
        balance = JointBalance(
            arms=self._arms,
            size=self._size,
            before=task.motors[0],
            after=task.motors[1],
            links=task.links,
            rules={name: link.rule(self._dynamics, h) for name, link in task.links.items()} if self._dynamics else {},
            gravity=total_gravity(self._loads, task.commands),
            h=h,
            last=task.state.poses,
            wrenches=self._wrenches,
        )
        q, near = balance.predict_positions(), self._bound_correction(balance, task.state)
        search = BalanceSearch(balance.first_derivative(q))
        spent, stale, least, best = 0, 0, math.inf, None
        for _ in range(SOLVES):
            targets = {**task.targets, **balance.poses(q)}
            given = {"duration": h, "deadline": deadline, **self._finer}
            result = self._stepper.step(task.state, targets, task.commands, **given)
            spent += result.iterations
            gap = balance.gap(q, result.state)
            length = balance.length(q, search.bound(gap))
            ended = not result.completed or (deadline is not None and deadline.after is not None)
            stale = stale + 1 if length > 0.5 * least else 0
            if best is None or length < least or ended:
                least, best = length, (q, result)
            if ended or length <= BALANCED * near or (stale >= STALLED_SOLVES and least <= near):
                break
            q = search.next(q, gap, longest=LONGEST_CORRECTION * self._size / length)
        q, result = best
        balanced = least <= near or not result.converged
        if result.completed and not least <= near:
            result = _flaw(result, f"yielding joints are not in balance: the flange is {least:.3g} m away from it")
        result = replace_fields(result, iterations=spent)
        moved = balance.move_links(q, result.simulated)
        return CoupledStep(result=result, links=moved, poses=balance.poses(q), balanced=balanced)

    def _wrenches(self, state: State) -> tuple[Mapping[str, Vector], Mapping[str, Touch]]:
        """Return dicts from handle or obstacle to its reaction, and from contact to its points, in a state."""
        return state.summary.reactions, find_touches(self._stepper.actuation.contacts, state, self._origin)

    def _bound_correction(self, balance: JointBalance, start: State) -> float:
        """Return the largest correction [m] that may be left out.

        In a motion, `reduction` makes this length as much smaller as the tolerance of a free body. It depends on the
        larger of two accelerations at the beginning of the step: those of the flange and of the body.
        """
        if not balance.rules:
            return self._near
        body = balance.h**2 * self._stepper.largest_acceleration(start)
        return self._near * reduction(max(balance.swing(), body), self._size)


def _flaw(result: PathResult, flaw: str) -> PathResult:
    """Return an outcome that has not converged, with a further flaw in its message."""
    return result.with_message(join(result.message, flaw), converged=False)


def _join(first: PathResult | None, second: PathResult) -> PathResult:
    """Return the outcome of two successive parts of a step; ``first`` is None before the first part."""
    if first is None:
        return second
    if not first.converged and first.message != second.message:
        second = _flaw(second, f"in an earlier part of the step: {first.message}")
    return replace_fields(
        second.counting(first),
        snapped=first.snapped or second.snapped,
        restarts=max(first.restarts, second.restarts),
        simulated=None if second.simulated is None else first.simulated + second.simulated,
    )
