# SPDX-License-Identifier: Apache-2.0
"""One step to new plate poses: substeps, prediction, equilibrium, retry."""

from __future__ import annotations

import copy
import dataclasses
import time
from collections.abc import Callable, Mapping
from functools import partial

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.constraints import Pose
from gdfe_ros.solver.actuation import Actuation, inflated
from gdfe_ros.solver.balance import LEAST_MOTION, Balance, weigh
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.deadline import Deadline, past
from gdfe_ros.solver.equilibrium import EnergyEquilibrium
from gdfe_ros.solver.fields import ElementFields, element_fields, least_volume_ratio
from gdfe_ros.solver.increments import planned_increments
from gdfe_ros.solver.outcome import Outcome, State
from gdfe_ros.solver.predictor import Predictor
from gdfe_ros.solver.reactions import handle_reactions
from gdfe_ros.solver.recovery import NEAR, March, is_better
from gdfe_ros.solver.relative import RelativeEquilibrium
from gdfe_ros.solver.result import StepResult
from gdfe_ros.solver.settings import Policy, Skip, SolverSettings
from gdfe_ros.solver.turning import Trials, Turning

ROUNDING = 1e-9
SNAPPED = "the body jumped to another equilibrium of less energy, as in buckling; smaller steps do not change that"
FOLDS = "elements would turn inside out"
SHORTEST_SUBSTEP, SHORTEST_JUMP = 1.0 / 256.0, 1.0 / 32.0
"""Shares of a command; of a jump the second is enough to tell that smaller steps do not prevent it."""


class Engine:
    """Positions, plate poses and the equilibrium solver that moves one after the other.

    Args:
        body: the discretised body.
        settings: how to solve.
        actuation: what acts on it; None for nothing.
    """

    def __init__(self, body: Body, settings: SolverSettings, actuation: Actuation | None = None) -> None:
        self.body = body
        self._settings = settings
        self.actuation = actuation or Actuation(body)
        self._turning = Turning(body)
        if settings.policy is Policy.ENERGY:
            # Plates that turn freely are moved on inside of a step, perhaps beside held elements.
            skip = [item for item in settings.skip if item is not Skip.DORMANT or not self._turning.count]
            self.equilibrium = EnergyEquilibrium(body, self.actuation, skip=skip, threads=settings.threads)
        else:
            self.equilibrium = RelativeEquilibrium(body, self.actuation)
        self._predictor = Predictor(body.unknowns)
        self.reset()

    def reset(self) -> None:
        """Go back to rest."""
        self.positions = self.body.rest.copy()
        self.poses = {handle.name: Pose() for handle in self.body.handles}
        self._base = self.body.rest.copy()
        self._last: StepResult | None = None
        self._suspect, self._tried = False, False
        self.actuation.reset()
        self.commands = dict(self.actuation.neutral)
        self.equilibrium.reset()
        self._predictor.reset()
        self._turning.reset()
        self._sound, self._accepted = True, Outcome(self.positions, True, 0, 0.0)
        still = {handle.name: np.zeros(6) for handle in self.body.handles}
        slopes = self.actuation.potential(self.positions)[1]
        self._balance: Balance | None = Balance(0.0, 0.0, slopes, still, self.poses, self.commands)

    def step(
        self,
        targets: Mapping[str, Pose],
        commands: Mapping[str, float] | None = None,
        *,
        moment: float,
        started: float,
        deadline: Deadline | None = None,
    ) -> StepResult:
        """Move the plates to ``targets`` and return the state at simulation time ``moment`` [s].

        ``commands`` drives every actuator and load; None leaves them.
        """
        wanted = dict(self.commands if commands is None else commands)
        settled = self.poses == dict(targets) and self.commands == wanted
        if self._last is not None and self._last.converged and settled and Skip.SOLVE in self._settings.skip:
            return self._idle(moment, started)
        doubtful = self._suspect or not (self._tried or np.array_equal(self.positions, self.body.rest))
        march, restarts = self._march(targets, wanted, deadline), 0
        if (self._suspect or (march.inverted and doubtful)) and not past(deadline):
            march, restarts = self._recover(march, targets, wanted, deadline)
            self._suspect, self._tried = False, True
        self._tried = self._tried and not march.sound
        self._last = self._result(march, moment, started, restarts)
        return self._last

    def place(self, positions: NDArray[np.float64]) -> None:
        """Start the next step from ``positions`` (n, 3) [m]; the plates stay where they are commanded.

        Pressures, captured shapes and the motion so far are forgotten. Where an element is inverted there, the step
        compares what it finds with the way from rest, lest it end in another minimum of the energy.
        """
        self.positions = positions.copy()
        for handle in self.body.handles:
            if not handle.free:
                self.positions[handle.vertices] = self._base[handle.vertices]
        self._last = None
        self.equilibrium.reset()
        self._predictor.reset()
        self._suspect = not least_volume_ratio(self.body, self.positions) > 0.0
        self._sound, self._balance = not self._suspect, None

    def _march(self, targets: Mapping[str, Pose], wanted: dict[str, float], deadline: Deadline | None) -> March:
        """Follow the commands, in smaller increments where the solver asks for them."""
        begin, start = dict(self.poses), self.commands
        moves = begin != dict(targets) or start != wanted
        planned = planned_increments(targets, self.poses, self.body.size)
        done, length, iterations, substeps, jumped = 0.0, 1.0 / planned, 0, 0, False
        budget = planned * self._settings.max_iterations
        while True:
            fraction = 1.0 if done + length > 1.0 - ROUNDING else done + length
            poses, drive = dict(targets), wanted
            if fraction < 1.0:
                poses = {name: begin[name].blend(targets[name], fraction) for name in targets}
                drive = {name: value + fraction * (wanted[name] - value) for name, value in start.items()}
            left = max(1, budget - iterations)
            shortest = length <= SHORTEST_SUBSTEP or not moves
            limit = left if shortest else min(left, self.equilibrium.patience)
            outcome, state, base, start_at = self._solve(poses, drive, limit, deadline)
            iterations += outcome.iterations
            substeps += 1
            exhausted = iterations >= budget or past(deadline)
            before = self.commands if outcome.diverged else None
            unstable = "" if outcome.converged else self.actuation.unstable(outcome.positions, before)
            energetic = self._settings.policy is Policy.ENERGY
            balance = weigh(outcome, state, self.actuation, poses, drive) if energetic else None
            snapped = moves and self._snapped(outcome, balance, start_at)
            folds = moves and self._sound and not state.min_det > 0.0 and not past(deadline)
            jumped = jumped or snapped
            failed = not (outcome.converged or outcome.exhausted) or state.min_det <= 0.0
            if not exhausted and ((failed and not shortest) or (snapped and length > SHORTEST_JUMP)):
                length *= 0.5
                continue
            if unstable or outcome.diverged or folds:
                message = inflated(unstable, self.commands, drive) if unstable else outcome.message
                if folds and not unstable:
                    message = f"{FOLDS} beyond {done:.3g} of the way to the command; {message}".rstrip("; ")
                outcome, state = self._withdraw(message)
                break
            self._accept(outcome, state, poses, drive, base)
            self._balance = balance
            done = fraction
            if snapped or (jumped and not outcome.converged):
                message = f"{SNAPPED}; {outcome.message}".rstrip("; ")
                outcome = dataclasses.replace(outcome, converged=False, message=message)
                break
            if done == 1.0 or exhausted:
                break
        return March(outcome, state, iterations, substeps, done == 1.0)

    def _recover(
        self, march: March, targets: Mapping[str, Pose], wanted: dict[str, float], deadline: Deadline | None
    ) -> tuple[March, int]:
        """Go to the commands again from rest; keep the better of the two and say so."""
        twin = self.branch(self._settings.tolerance)
        twin.reset()
        again = twin._march(targets, wanted, deadline)
        iterations, substeps = march.iterations + again.iterations, march.substeps + again.substeps
        if not is_better(again, march, NEAR * self._settings.tolerance * self.body.size):
            return dataclasses.replace(march, iterations=iterations, substeps=substeps), 0
        self.__dict__.update(twin.__dict__)
        message = f"restarted from rest: the other way ended in {march.flaw}; {again.outcome.message}".rstrip("; ")
        outcome = dataclasses.replace(again.outcome, message=message)
        return dataclasses.replace(again, outcome=outcome, iterations=iterations, substeps=substeps), 1

    def branch(self, tolerance: float) -> Engine:
        """Return an engine in the same state that shares nothing but the factored matrix and solves tighter."""
        shared = self.equilibrium.matrix, self.body
        twin = copy.deepcopy(self, {id(item): item for item in shared})
        twin._settings = dataclasses.replace(self._settings, tolerance=min(tolerance, self._settings.tolerance))
        twin._last = None
        return twin

    def fields(self) -> ElementFields:
        """Evaluate the element fields at the current positions."""
        return self.later_fields()()

    def later_fields(self) -> Callable[[], ElementFields]:
        """Return ``fields`` of the present state: positions and shape factors are replaced by a step, not changed."""
        omega = self.equilibrium.omega if self._settings.policy is Policy.RELATIVE else None
        return partial(element_fields, self.body, self.positions, omega)

    def pose(self, name: str) -> Pose:
        """Return the pose of a plate: as commanded, turned where it turns freely; without what it slid."""
        return self._turning.pose(name, self.poses[name])

    def _solve(
        self, poses: Mapping[str, Pose], drive: Mapping[str, float], limit: int, deadline: Deadline | None
    ) -> tuple[Outcome, State, NDArray[np.float64], NDArray[np.float64]]:
        """Return what was found, where the plates' vertices are held and where the solve began."""
        change = self._change(drive)
        moved = {name: pose for name, pose in poses.items() if pose != self.poses[name] or name in self._turning.names}
        self._turning.guess(poses, self.poses, change)
        base = self._turning.place(self._base, moved)
        movable = self.equilibrium.prepare(base)
        prediction = self._predictor.predict(self.positions, self._base, base, change, movable)
        self.actuation.apply(drive, prediction.positions, ratio=prediction.ratio)
        settings = self._settings

        def solve(start: NDArray, plates: NDArray, finer: float = 1.0) -> tuple[Outcome, State]:
            options = {"tolerance": finer * settings.tolerance, "deadline": deadline, "ratio": prediction.ratio}
            return self._with_reactions(self.equilibrium.solve(start, plates, limit=limit, **options))

        if not self._turning.count:
            return *solve(prediction.positions, base), base, prediction.positions
        trials = Trials(
            solve,
            prediction.positions,
            place=lambda: self._turning.place(base, poses),
            carry=lambda positions, motion: self._predictor.carry(positions, motion, movable),
            give_up=lambda used: used >= limit or past(deadline),
        )
        return *self._turning.balance(trials, tolerance=settings.tolerance), prediction.positions

    def _with_reactions(self, outcome: Outcome) -> tuple[Outcome, State]:
        state = self.equilibrium.state()
        reactions = handle_reactions(self.body, outcome.positions, state.force, state.outside)
        return outcome, dataclasses.replace(state, reactions=reactions)

    def _change(self, drive: Mapping[str, float]) -> NDArray[np.float64]:
        """Return the change of every command, in its own unit."""
        return np.array([drive[name] - value for name, value in self.commands.items()])

    def _snapped(self, outcome: Outcome, balance: Balance | None, start: NDArray[np.float64]) -> bool:
        """Tell whether the body jumped to another equilibrium on the way from the last one."""
        if balance is None or self._balance is None or not self._balance.jumps_to(balance):
            return False
        return np.linalg.norm(outcome.positions - start, axis=1).max() > LEAST_MOTION * self.body.size

    def _accept(
        self,
        outcome: Outcome,
        state: State,
        poses: Mapping[str, Pose],
        drive: Mapping[str, float],
        base: NDArray[np.float64],
    ) -> None:
        self._sound, self._accepted = bool(state.min_det > 0.0), outcome
        change = self._change(drive)
        self._turning.accept(poses, self.poses, change)
        self._predictor.remember(self.positions, outcome.positions, self._base, base, change)
        self.equilibrium.accept()
        self.actuation.accept()
        self.positions, self.poses, self._base = outcome.positions, dict(poses), base
        self.commands = dict(drive)

    def _withdraw(self, message: str) -> tuple[Outcome, State]:
        """Go back to the last accepted positions and say why; they are evaluated again, not solved for."""
        _, state, _, _ = self._solve(self.poses, self.commands, 0, None)
        accepted = dataclasses.replace(self._accepted, positions=self.positions.copy())
        return dataclasses.replace(accepted, converged=False, message=message), state

    def _idle(self, moment: float, started: float) -> StepResult:
        nothing = {"iterations": 0, "substeps": 0, "restarts": 0, "skipped": {Skip.SOLVE.value: 1}}
        return dataclasses.replace(self._last, time=moment, wall_time=time.perf_counter() - started, **nothing)

    def _result(self, march: March, moment: float, started: float, restarts: int) -> StepResult:
        outcome, state = march.outcome, march.state
        return StepResult(
            time=moment,
            positions=outcome.positions,
            converged=outcome.converged and march.reached,
            iterations=march.iterations,
            residual=outcome.residual,
            energy=float(state.energy),
            min_det=float(state.min_det),
            reactions=state.reactions,
            actuators=self.actuation.states(outcome.positions),
            skipped=self.equilibrium.skipped,
            substeps=march.substeps,
            restarts=restarts,
            wall_time=time.perf_counter() - started,
            policy=self._settings.policy,
            factorisation=self.equilibrium.matrix.kind.value,
            message=march.message,
        )
