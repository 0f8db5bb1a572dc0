# SPDX-License-Identifier: Apache-2.0
"""Hyperelastic equilibrium for the ``energy`` policy: descents on the constant matrix, pressures in between."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.actuators.external import External
from gdfe_ros.compiled import start_threads
from gdfe_ros.materials.table import LAME, PENALTY, SHEAR, YOUNG
from gdfe_ros.solver import descent as entries
from gdfe_ros.solver.actuation import Actuation
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.deadline import Deadline, past
from gdfe_ros.solver.descent import Problem
from gdfe_ros.solver.descents import FARTHEST, SAFETY, Descents, Observer, Task
from gdfe_ros.solver.dormancy import Dormancy
from gdfe_ros.solver.element_state import update_shares
from gdfe_ros.solver.fields import store_energies
from gdfe_ros.solver.global_matrix import Factorisation, GlobalMatrix, assemble
from gdfe_ros.solver.outcome import Outcome, State
from gdfe_ros.solver.pressures import Pressures
from gdfe_ros.solver.scope import Scope
from gdfe_ros.solver.settings import Skip

FIRST_TOLERANCE = 1e-2
TIGHTEN = 0.1
SHARE_SLACK = 10.0
"""Change of a share, over the tolerance, that leaves the positions within it."""
WARM_SLACK = 10.0
"""Misfit of an element's volume, over the tolerance, that a step of a motion may leave to the next one's pressures."""
WARM_ITERATIONS, COLD_ITERATIONS, LEARNING_ITERATIONS = 3, 12, 60
"""Least iterations of a step that continues a motion, and of one that does not: with a stream of small commands the
work is even from step to step and the error stays far below the tolerance, which alone would let it build up. The third
is for a driven body while the history is not full: it does not know the softest modes yet, which forces move most."""
LEAP = 100.0
"""Of the tolerance: where the start lies farther from the last equilibrium, nothing is taken for granted."""
RAN_AWAY = "the body runs away: its energy has no lower bound; a material or a load is unstable there"
MAX_UPDATES = 60


class EnergyEquilibrium:
    """Finds positions at which every element's force, derived from its energy, balances.

    Args:
        body: the discretised body.
        actuation: what acts on it; None for nothing.
        library: what factors the constant matrix; None chooses.
        skip: work that may be left out.
        threads: most that share the elements.

    Attributes:
        matrix: the constant matrix.
        patience: iterations after which a shorter motion is the better idea.
    """

    patience = 2000

    def __init__(
        self,
        body: Body,
        actuation: Actuation | None = None,
        *,
        library: Factorisation | None = None,
        skip: Collection[Skip] = tuple(Skip),
        threads: int = 1,
    ) -> None:
        self._body, self._threads = body, threads
        if threads > 1:
            start_threads()
        self._actuation = actuation or Actuation(body)
        parameters = body.table.parameters[body.material]
        stiffness = 2.0 * parameters[:, SHEAR] + parameters[:, PENALTY] + parameters[:, LAME]
        bending = parameters[:, YOUNG] * np.cbrt(body.shape.volume) / 6.0
        self.matrix = GlobalMatrix(assemble(body.shape, stiffness, bending), body.unknowns, library=library)
        self._descents = Descents(body, stiffness, bending)
        self._actuation.stiffen(self.matrix)
        memory = entries.LONG_MEMORY if self._actuation.drives else entries.MEMORY
        still = self._actuation.grown is None
        self._whole = self._scope = Scope.whole(body, self.matrix, memory, rigid=still, skip=skip)
        pushed = self._external is not None
        self._dormancy = Dormancy(body, self._whole, skip if still and not self._descents.lumps else (), pushed=pushed)
        self.pressures = Pressures(body)
        count = len(body.material)
        self._share, self._kept_share = np.ones(count), np.ones(count)
        self._stored, self._ratio = np.zeros(count), np.ones(count)
        self._tolerance, self._warm = 0.0, False
        self.reset()

    def reset(self) -> None:
        """Forget pressures, shares and history; wake what is held."""
        self.pressures.reset()
        self._kept_share = np.ones_like(self._share)
        self._whole.descent.status[:] = 0.0
        self._dormancy.reset()
        self._scope = self._whole

    def observe(self, observer: Observer | None) -> None:
        """Have somebody see the energy of every iteration; None for nobody."""
        self._descents.observer = observer

    def accept(self) -> None:
        """Keep the pressures and shares of the last solve as the start of the next."""
        self.pressures.accept()
        self._kept_share = self._share.copy()
        self._dormancy.accept(self._scope, self._tolerance)
        if self._dormancy.waits:
            positions = self._whole.descent.x.copy()
            self._whole.place(positions, positions)
            self._task(self._whole, positions).evaluate()
            self._dormancy.learn_forces()

    @property
    def skipped(self) -> dict[str, int]:
        """What the last solve left out, by name."""
        counts = self._scope.skipped(self._body, self._whole)
        return counts if self._external is not None else {**counts, Skip.ACTUATORS.value: 1}

    def prepare(self, base: NDArray[np.float64]) -> Scope:
        """Choose what the next solve, with the plates at ``base`` (n, 3) [m], looks at."""
        self._scope = self._dormancy.choose(base)
        return self._scope

    def solve(
        self,
        start: NDArray[np.float64],
        base: NDArray[np.float64],
        *,
        tolerance: float,
        limit: int,
        deadline: Deadline | None = None,
        ratio: float = 0.0,
    ) -> Outcome:
        """Find the equilibrium from ``start`` with the plates at ``base``.

        Args:
            start: positions (n, 3) [m] to start from; sliding plates keep the offset they have there.
            base: commanded positions (n, 3) [m] of the plates' vertices; other rows are not read.
            tolerance: estimated largest distance to the equilibrium over the body's size.
            limit: most iterations.
            deadline: when it has passed, the best iterate is returned.
            ratio: how much of the last accepted step ``start`` repeats; pressures follow, and the tolerance is
                aimed at from the start.
        """
        self._tolerance = tolerance
        near = LEAP * tolerance * self._body.size
        self._warm = ratio != 0.0 and bool(np.abs(start - self._whole.descent.x).max() <= near)
        self.pressures.start(self._scope.elements, ratio)
        self._share[...] = self._kept_share
        stiffened = self.pressures.stiffened
        outcome = self._solve(start, base, tolerance, limit, deadline, ratio)
        if self._scope is self._whole or past(deadline):
            return outcome
        target = SAFETY * tolerance * self._body.size
        if outcome.converged and self.pressures.stiffened == stiffened:
            moved = self._dormancy.disturbance(target)
            if moved <= target:
                return dataclasses.replace(outcome, residual=max(outcome.residual, moved / target * tolerance))
        self._scope = self._whole
        if outcome.converged:
            start = outcome.positions
        else:
            self.pressures.start(self._scope.elements, ratio)
            self._share[...] = self._kept_share
        again = self._solve(start, base, tolerance, limit - outcome.iterations, deadline, ratio)
        return dataclasses.replace(again, iterations=outcome.iterations + again.iterations)

    def _solve(
        self,
        start: NDArray[np.float64],
        base: NDArray[np.float64],
        tolerance: float,
        limit: int,
        deadline: Deadline | None,
        ratio: float,
    ) -> Outcome:
        """Find the equilibrium of what is in the scope."""
        scope, descent = self._scope, self._scope.descent
        if scope is self._whole:
            self._dormancy.forget_forces()
        task = self._task(scope, base, deadline)
        self._descents.begin(scope, watched=not self._warm)
        scope.place(start, base)
        task.evaluate()
        updates = len(scope.carried) or len(scope.softening) or self._actuation.updates
        inner = max(FIRST_TOLERANCE, tolerance) if updates and ratio == 0.0 else tolerance
        iterations = 0
        least = WARM_ITERATIONS if self._warm else COLD_ITERATIONS
        if self._actuation.drives and descent.status[entries.COUNT] < entries.LONG_MEMORY:
            least = LEARNING_ITERATIONS
        settled = not updates
        self.pressures.begin()
        for _ in range(MAX_UPDATES):
            used = self._descents.descend(task, tolerance=inner, least=least, limit=limit - iterations)
            iterations += used
            least = 0
            stalled, blocked = descent.status[[entries.STALLED, entries.BLOCKED]]
            hopeless = stalled and (stalled == entries.RUNAWAY or blocked)
            if iterations >= limit or hopeless or past(deadline) or not updates:
                break
            # Where no descent is left above the tolerance, new pressures and shares may open one.
            last = inner == tolerance or bool(stalled)
            settled = self._update(scope, tolerance, still=used == 0) and last
            if settled:
                break
            task.evaluate()
            inner = max(tolerance, TIGHTEN * inner)
        if self._descents.ran_away(scope):
            self.pressures.start(scope.elements, ratio)
            scope.place(start, base)
            task.evaluate()
            return Outcome(descent.x.copy(), False, iterations, FARTHEST, RAN_AWAY, diverged=True)
        return self._outcome(task, iterations, tolerance, limit, settled=settled)

    def state(self) -> State:
        """Return energy, volumes and forces of the last solve."""
        body, descent = self._body, self._scope.descent
        store_energies(
            descent.x,
            self._scope.elements,
            body.shape,
            body.material,
            self.pressures.table,
            self.pressures.values,
            descent.energies,
            self._stored,
            self._ratio,
            True,
        )
        outside = None if self._external is None else descent.outside
        return State(float(self._stored.sum()), float(self._ratio.min()), descent.force, outside)

    @property
    def _external(self) -> External | None:
        """Loads and actuators for the kernels; None compiles and costs nothing."""
        external = self._actuation.external
        return external if external.active else None

    def _task(self, scope: Scope, base: NDArray[np.float64], deadline: Deadline | None = None) -> Task:
        body, pressures = self._body, self.pressures
        problem = Problem(
            body.shape,
            scope.blocks,
            body.material,
            pressures.values,
            self._share,
            pressures.table,
            scope.unknowns,
            base,
            scope.threads(self._threads),
        )
        return Task(scope, problem, self._external, deadline)

    def _update(self, scope: Scope, tolerance: float, *, still: bool) -> bool:
        """Update pressures and shares; tell whether the positions stay within the tolerance all the same."""
        body, x, settled = self._body, scope.descent.x, True
        if len(scope.carried):
            misfit = self.pressures.update(x, scope.carried, still=still)
            settled = misfit <= (WARM_SLACK if self._warm else 1.0) * tolerance
        if self._actuation.updates:
            settled = self._actuation.update(x) <= tolerance and settled
        if len(scope.softening):
            change = update_shares(x, scope.softening, body.shape, body.material, body.table, self._share)
            settled = settled and change <= SHARE_SLACK * (WARM_SLACK if self._warm else 1.0) * tolerance
        return settled

    def _outcome(self, task: Task, iterations: int, tolerance: float, limit: int, *, settled: bool) -> Outcome:
        descent = task.scope.descent
        residual, positions = self._descents.residual(task.scope), descent.x.copy()
        if residual <= tolerance and settled:
            return Outcome(positions, True, iterations, residual)
        if past(task.deadline):
            reason = "the deadline passed"
        elif iterations >= limit:
            reason = f"stopped after {limit} iterations"
        elif residual <= tolerance:
            reason = f"pressures and shape factors have not settled in {MAX_UPDATES} updates"
        else:
            reason = "no further descent is possible at the precision of the energy"
        message = f"{reason}: about {residual:.3g} of the body's size from equilibrium, tolerance {tolerance:.3g}"
        exhausted = bool(descent.status[entries.STALLED] == entries.EXHAUSTED)
        return Outcome(positions, False, iterations, residual, message, exhausted)
