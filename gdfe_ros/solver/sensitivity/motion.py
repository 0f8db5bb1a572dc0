# SPDX-License-Identifier: Apache-2.0
"""Derivatives along a motion: internal steps propagate derivatives of positions and of the terms' stored states."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from gdfe_ros.errors import GdfeError
from gdfe_ros.solver.minimise.curvature import TangentProducts
from gdfe_ros.solver.motion import inertia
from gdfe_ros.solver.motion.stepper import MotionStepper
from gdfe_ros.solver.motion.time_path import InternalStep
from gdfe_ros.solver.sensitivity.columns import Column, Pair, Tangents, VariedInputs, own_side, pair_of
from gdfe_ros.solver.sensitivity.parameter import Parameter, move_pose
from gdfe_ros.solver.state import State
from gdfe_ros.solver.terms.term import TermTable, terms_energy
from gdfe_ros.solver.vectors import Array
from gdfe_ros.threads import one_blas_thread

Kept = Mapping[str, Mapping[str, Array]]
"""Dict from term name to the term's stored state, itself a dict from name to array."""
REACTIONS = "(reactions)"
"""Key of the reactions in a dict from term name to state."""
REPLACED = "no derivative: the state was replaced after `follow`, by restore, reset or set_positions; remedy: follow"


@dataclass(frozen=True, eq=False, kw_only=True)
class Carried:
    """Derivative of a state in motion with respect to one parameter.

    Attributes:
        positions: (n, 3) derivative of the positions.
        terms: derivatives of the terms' stored states.
        share: fraction of the parameter's change that the present command or pose already contains.
        reactions: dict from handle or obstacle name to the derivative (6,) of its reaction.
    """

    positions: Array
    terms: Kept
    share: float = 0.0
    reactions: Mapping[str, Array] = field(default_factory=dict)


class Trail:
    """Computes the derivatives of a motion, internal step by internal step.

    Args:
        stepper: the stepper of the motion.
        parameters: parameters of the derivatives.
        state: state at the beginning; it depends on no parameter.
        tangents: cache of tangents for several trails.
    """

    MOST_LENGTHS = 4
    """Largest number of equilibrium solvers, one for each step length and scheme, whose tangents are cached."""

    def __init__(
        self, stepper: MotionStepper, parameters: Sequence[Parameter], state: State, tangents: dict[int, Tangents]
    ) -> None:
        self._stepper, self._tangents = stepper, tangents
        self.parameters, self.state, self.flaw = tuple(parameters), state, ""
        none = {name: {key: np.zeros_like(array) for key, array in kept.items()} for name, kept in state.terms.items()}
        still = Carried(positions=np.zeros_like(state.positions), terms=none)
        self.columns = [still for _ in parameters]
        self._began = [0.0 for _ in parameters]

    def begin(self, state: State) -> None:
        """Begin a step of the simulation at ``state``, from which commands change linearly."""
        if state.positions is not self.state.positions:
            self.flaw = REPLACED
        self._began = [column.share for column in self.columns]

    def observe(self, stage: InternalStep) -> None:
        """Propagate the derivatives through an internal step. If the step has no derivative, `flaw` gets the reason."""
        self.state = stage.after
        if self.flaw:
            return
        try:
            with one_blas_thread():
                self.columns = self._start_columns(stage) if stage.dynamics is None else self._step(stage)
        except GdfeError as error:
            self.flaw = str(error)

    def _step(self, stage: InternalStep) -> list[Carried]:
        dynamics, h, body = stage.dynamics, stage.h, self._stepper.body
        equilibrium = self._stepper.equilibrium_of(dynamics, h)
        if id(equilibrium) not in self._tangents:
            while len(self._tangents) >= self.MOST_LENGTHS:
                del self._tangents[next(iter(self._tangents))]
            self._tangents[id(equilibrium)] = Tangents(equilibrium)
        solve = self._tangents[id(equilibrium)].at(stage.before, stage.after)
        own, found = own_side(body, stage.before, stage.after), []
        try:
            for parameter, column, began in zip(self.parameters, self.columns, self._began, strict=True):
                share = began + stage.share * (1.0 - began)
                pairs = [pair_of(parameter, own, h=h, scheme=dynamics, share=share)]
                if (history := self._history(own, parameter, column)) is not None:
                    pairs.append(history)
                made = Column(solve, pairs)
                terms = made.after(lambda side, x: self._finish_terms(stage, side, x))
                struck = terms.pop(REACTIONS)
                touched = [contact.name for contact in equilibrium.actuation.contacts if contact.on_body]
                reactions = {**made.reactions(), **{name: struck[name] for name in touched}}
                found.append(Carried(positions=made.change.positions, terms=terms, share=share, reactions=reactions))
        finally:
            solve.restore()
        return found

    def _history(self, own: VariedInputs, parameter: Parameter, column: Carried) -> Pair | None:
        """Return the inputs of two solves from varied initial states; None if the initial state has no derivative."""
        kept = column.terms[inertia.NAME]
        h, size = own.start.terms[inertia.NAME]["h"][0] or 1.0, self._stepper.body.size
        ways = (np.abs(kept["velocity"]).max(initial=0.0) * h, np.abs(kept["acceleration"]).max(initial=0.0) * h * h)
        largest = max(np.abs(column.positions).max(initial=0.0), *ways)
        if not (largest > 0.0 or column.share):
            return None
        step = TangentProducts.SPACING * size / max(largest, 1e-300) if largest > 0.0 else parameter.step(own.commands)
        sides = (replace(own, start=_beside(own.start, parameter, column, sign * step)) for sign in (1.0, -1.0))
        return Pair(*sides, own, step)

    def _finish_terms(self, stage: InternalStep, side: VariedInputs, x: Array) -> Kept:
        """Return the terms' states after a varied step that ends at ``x`` (n, 3) [m]; `REACTIONS` is a further key."""
        dynamics, h, terms = stage.dynamics, stage.h, {}
        actuation = self._stepper.equilibrium_of(dynamics, h).actuation
        for contact in actuation.contacts:
            contact.look(x)
        for term in actuation.terms:
            terms[term.name] = side.terms.get(term.name, term).finish(side.start.terms[term.name], x)
        now = stage.after.with_(positions=x, poses=side.poses, commands=side.commands, terms=terms)
        now = self._stepper.strike(dynamics, side.start, now, h, side.free_mass)
        return {**now.terms, REACTIONS: now.summary.reactions}

    def _start_columns(self, stage: InternalStep) -> list[Carried]:
        """Return the derivatives at the start of a motion; only the initial accelerations depend on the parameters."""
        stepper, h = self._stepper, stage.h
        acceleration = stage.after.terms[inertia.NAME]["acceleration"]
        velocity = stage.after.terms[inertia.NAME]["velocity"]
        loads, found = [term for term in stepper.actuation.terms if term.name in stepper.actuation.loaded], []
        for parameter, column in zip(self.parameters, self.columns, strict=True):
            pulls, step = [], parameter.step(stage.after.commands)
            for change in (step, -step):
                pull, others = np.zeros_like(acceleration), {}
                if parameter.model is not None:
                    variant = parameter.model(parameter.value + change)
                    others = variant.terms()
                    pull -= variant.mass @ (acceleration + variant.dynamics.damping.mass * velocity)
                commands = parameter.change_commands(stage.after.commands, change)
                for term in (others.get(load.name, load) for load in loads):
                    term.begin(commands, {}, stage.after.positions, 0.0)
                    force = np.zeros_like(pull)
                    terms_energy(stage.after.positions, TermTable.of(term), force, np.zeros(1))
                    pull -= force
                pulls.append(pull)
            gained = stepper.free_mass.accelerate((pulls[0] - pulls[1]) / (2.0 * step))
            kept = dict(column.terms[inertia.NAME])
            kept.update(acceleration=gained, balanced=gained, before=0.5 * h * h * gained, velocity_before=-h * gained)
            kept = {key: kept.get(key, np.zeros_like(array)) for key, array in stage.after.terms[inertia.NAME].items()}
            share = 1.0 if parameter.command in stepper.actuation.loaded else column.share
            found.append(replace(column, terms={**column.terms, inertia.NAME: kept}, share=share))
        self._began = [column.share for column in found]
        return found


def _beside(state: State, parameter: Parameter, column: Carried, step: float) -> State:
    """Return ``state`` plus ``step`` times its derivative ``column``."""
    terms = {
        name: {key: array + step * column.terms[name][key] if key in column.terms[name] else array
               for key, array in kept.items()}
        for name, kept in state.terms.items()
    }  # fmt: skip
    poses = state.poses
    if parameter.handle:
        change = column.share * step * np.eye(6)[parameter.axis]
        poses = {**poses, parameter.handle: move_pose(poses[parameter.handle], change)}
    return state.with_(
        positions=state.positions + step * column.positions,
        poses=poses,
        commands=parameter.change_commands(state.commands, column.share * step),
        terms=terms,
    )
