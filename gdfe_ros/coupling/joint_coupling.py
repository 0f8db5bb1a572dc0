# SPDX-License-Identifier: Apache-2.0
"""Implicit coupling of yielding joints and the soft body: both are in balance at the end of each step."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.actuators import Load, total_gravity
from gdfe_ros.arms.arm import Arm
from gdfe_ros.arms.carriers import Carriers, Motions
from gdfe_ros.constraints.pose import Pose
from gdfe_ros.coupling.balance import JointBalance, Links, distance, on_links
from gdfe_ros.coupling.link_motion import LinkMotion
from gdfe_ros.coupling.search import BalanceSearch
from gdfe_ros.solver.contact.touch import Touch
from gdfe_ros.solver.deadline import Deadline, past
from gdfe_ros.solver.motion.dynamics import Dynamics
from gdfe_ros.solver.motion.flight import ROUNDING
from gdfe_ros.solver.motion.integrator import ACCURACY, FINEST
from gdfe_ros.solver.motion.stepper import CALM, MotionStepper
from gdfe_ros.solver.state import State
from gdfe_ros.solver.stepping.march import March
from gdfe_ros.solver.stepping.stepper import FINER, Stepper
from gdfe_ros.solver.value import changed

Vector = NDArray[np.float64]
BALANCED = 0.1
"""Joints are in balance if the next correction moves no flange farther than this, over the tolerance of the body."""
SOLVES = 40
"""Largest number of solves of the body for one balance; usually there are 2 to 4."""
PARTS = (1, 4, 16, 64)
"""Numbers of parts into which a step without dynamics is divided, one after the other until a division succeeds."""
LONGEST_CORRECTION = 1.0
"""Largest motion of a flange by one correction, over the body's size."""


@dataclass(frozen=True, eq=False, kw_only=True)
class CoupledStep:
    """Outcome of a step of the body and the yielding joints.

    Attributes:
        march: outcome of the body.
        links: motion of the yielding joints after the step.
        poses: dict from handle or obstacle of a link to its pose.
    """

    march: March
    links: Links
    poses: dict[str, Pose]


@dataclass(frozen=True, eq=False, kw_only=True)
class _Task:
    """Arguments of `JointCoupling.step`: the state before the step, and the commands after it."""

    state: State
    links: Links
    motors: tuple[Motions, Motions]
    targets: Mapping[str, Pose]
    commands: Mapping[str, float]

    def at(self, share: float) -> tuple[Mapping[str, Pose], Mapping[str, float]]:
        """Return the poses and the commands at a ``share`` of the step, interpolated linearly."""
        if share == 1.0:
            return self.targets, self.commands
        began = self.state
        poses = {name: began.poses[name].blend(pose, share) for name, pose in self.targets.items()}
        return poses, {name: at + share * (self.commands[name] - at) for name, at in began.commands.items()}


class JointCoupling:
    """The arms with yielding joints, and the body that they carry.

    The wrenches in `JointBalance` are known only at positions q for which the body was solved, with its handle at the
    flange's pose. `BalanceSearch` corrects q until the joints are in balance. Each correction needs one more solve of
    the body, from the beginning of the step. Equilibria are solved to `FINER` times the
    tolerance, because the error of a wrench is larger on joints that are softer than the body.

    Args:
        arms: of the scene; arms without springs are left out.
        stepper: of the body.
        dynamics: time scheme of the scene; None for equilibria.
        loads: of the scene; gravity acts on the links.
        tolerance: of the solver, over the size of the body.
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
        self._near = BALANCED * tolerance * self._size
        self._finer = {"tolerance": FINER * tolerance} if dynamics is None else {}

    def __bool__(self) -> bool:
        return bool(self._arms)

    def at_rest(self) -> Links:
        """Return the initial motion of the yielding joints: initial positions and no velocity."""
        return {arm.name: LinkMotion.at(arm.start[arm.springs.yielding]) for arm in self._arms}

    @staticmethod
    def restored(links: Mapping[str, Sequence[Vector]]) -> Links:
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
            for move in (CALM * now.velocities, CALM**2 * now.balanced):
                far = distance(arm, motions, now.positions, now.positions + move, self._size)
                if not far <= self._near / BALANCED:
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

        Without dynamics, the step is divided into more and more parts if it fails: at the joints' positions before a
        part, a command may press the body too far.

        Args:
            state: of the body.
            links: motion of the yielding joints before the step.
            motors: motions of the motors before and after the step.
            targets: poses of handles and obstacles after the step; those on arms are replaced.
            commands: after the step.
            duration: of the step [s].
            deadline: of the step; None for none.
        """
        task = _Task(state=state, links=links, motors=motors, targets=targets, commands=commands)
        if self._dynamics is not None:
            count = max(1, math.ceil(duration / self._dynamics.step - ROUNDING))
            task = changed(task, state=self._stepper.started(state, commands))
            return self._in_parts(task, count, duration, deadline)
        spent = 0
        for count in PARTS:
            found = self._in_parts(task, count, duration, deadline)
            spent += found.march.iterations
            if found.march.sound or past(deadline):
                break
        return changed(found, march=changed(found.march, iterations=spent))

    def _in_parts(self, task: _Task, count: int, duration: float, deadline: Deadline | None) -> CoupledStep:
        """Return the outcome of a step in ``count`` equal parts; it ends with the first part that fails."""
        h, state, links, march = float(f"{duration / count:.9g}"), task.state, task.links, None
        for number in range(count):
            share = (number + 1) / count
            poses, values = task.at(share)
            balance = JointBalance(
                arms=self._arms,
                size=self._size,
                before=Carriers.part_way(*task.motors, number / count),
                after=Carriers.part_way(*task.motors, share),
                links=links,
                rules={name: link.rule(self._dynamics, h) for name, link in links.items()} if self._dynamics else {},
                gravity=total_gravity(self._loads, values),
                h=h,
                last=state.poses,
                wrenches=self._wrenches,
            )

            def solve(carried: Mapping[str, Pose], start=state, poses=poses, values=values) -> March:
                given = {"duration": h, "deadline": deadline, **self._finer}
                return self._stepper.step(start, {**poses, **carried}, values, **given)

            found = self._balanced(balance, solve, deadline)
            march, links = _joined(march, found.march), found.links
            state = march.state
            if march.reached and share < 1.0 and past(deadline):
                told = f"{number + 1} of {count} parts of the step are done: {deadline.reason}"
                march = changed(_flawed(march, told), reached=False)
            if not march.reached or (self._dynamics is None and not march.sound):
                break
        return CoupledStep(march=march, links=links, poses=found.poses)

    def _balanced(
        self, balance: JointBalance, solve: Callable[[Mapping[str, Pose]], March], deadline: Deadline | None
    ) -> CoupledStep:
        """Return body and joints in balance, or what is nearest to it; ``solve`` solves the body at given poses."""
        q, near = balance.predicted(), self._allowed(balance)
        search = BalanceSearch(balance.first_derivative(q))
        spent, least, best = 0, math.inf, None
        for _ in range(SOLVES):
            march = solve(balance.poses(q))
            spent += march.iterations
            gap = balance.gap(q, march.state)
            length = balance.length(q, search.bound(gap))
            ended = not march.reached or (deadline is not None and deadline.after is not None)
            if best is None or length < least or ended:
                least, best = length, (q, march)
            if ended or length <= near:
                break
            q = search.next(q, gap, longest=LONGEST_CORRECTION * self._size / length)
        q, march = best
        if march.reached and not least <= near:
            march = _flawed(march, f"yielding joints are not in balance: the flange is {least:.3g} m away from it")
        march = changed(march, iterations=spent)
        return CoupledStep(march=march, links=balance.moved(q, march.simulated), poses=balance.poses(q))

    def _wrenches(self, state: State) -> tuple[Mapping[str, Vector], Mapping[str, Touch]]:
        """Return dicts from handle or obstacle to its reaction, and from contact to its points, in a state."""
        contacts = {contact.name: contact.touch(state, self._origin) for contact in self._stepper.actuation.contacts}
        return state.summary.reactions, contacts

    def _allowed(self, balance: JointBalance) -> float:
        """Return the largest correction [m] that is left out; in a motion it is reduced as in `Integrator.solve`."""
        if not balance.rules:
            return self._near
        return self._near * min(1.0, max(FINEST, ACCURACY * balance.swing() / self._size))


def _flawed(march: March, flaw: str) -> March:
    """Return an outcome that has not converged, with a further flaw in its message."""
    message = f"{march.message}; {flaw}" if march.message else flaw
    summary = changed(march.state.summary, converged=False, message=message)
    return changed(march, state=march.state.with_(summary=summary), converged=False, message=message)


def _joined(first: March | None, second: March) -> March:
    """Return the outcome of two successive parts of a step; ``first`` is None before the first part."""
    if first is None:
        return second
    if not first.converged and first.message != second.message:
        second = _flawed(second, f"in an earlier part of the step: {first.message}")
    return changed(
        second,
        iterations=first.iterations + second.iterations,
        increments=first.increments + second.increments,
        snapped=first.snapped or second.snapped,
        restarts=max(first.restarts, second.restarts),
        simulated=None if second.simulated is None else first.simulated + second.simulated,
    )
