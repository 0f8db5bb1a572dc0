# SPDX-License-Identifier: Apache-2.0
"""Proof that an equilibrium is a minimum of the energy, and the descent from a saddle.

The proof is the Cholesky factor of the tangent at the equilibrium: it exists only if the tangent is positive definite.
The factor has two further uses: it gives the distance to the equilibrium, and preconditions the next step. Without a
factor, the Lanczos method finds a direction of negative curvature. The body is moved along this direction while the
energy falls, and the minimisation continues from there.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np

from gdfe_ros.solver.descent.loop import UNPROVEN
from gdfe_ros.solver.descent.search import ENERGY_ROUNDING
from gdfe_ros.solver.equilibrium.solve import Model, Solve
from gdfe_ros.solver.minimise.curvature import Lanczos, Lowest, TangentProducts
from gdfe_ros.solver.minimise.minimiser import Minimiser, Task
from gdfe_ros.solver.outcome import Outcome, join, past, tell
from gdfe_ros.solver.solution import Solution
from gdfe_ros.solver.state import replace_fields
from gdfe_ros.solver.vectors import Array, largest, largest_distance


class Proof(NamedTuple):
    """Result of factoring the tangent at an equilibrium.

    Attributes:
        stable: whether the equilibrium is a minimum; None if that is unknown.
        direction: (3 r,) direction along which the energy may fall: the softest direction, or the step M^-1 g [m].
        distance: estimated distance to the equilibrium, divided by the body's size.
        measured: whether ``distance`` is reliable. It is unreliable if the tangent is not positive definite and the
            body has neither contacts nor multipliers.
    """

    stable: bool | None
    direction: Array
    distance: float
    measured: bool

    @property
    def counts(self) -> bool:
        """Whether the distance is reliable, and the equilibrium is no known saddle."""
        return self.measured and self.stable is not False


class Stability:
    """Proves that equilibria are minima, and moves the body away from saddles.

    A factor proves a minimum only if the kept tangent of every term is the whole second derivative of its energy.
    Otherwise the Lanczos method searches for negative curvature also where a factor exists. If the forces of a term
    have no potential, a minimum is still an equilibrium, but its stability is not known.

    Args:
        model: the data common to all solves of the body.
    """

    LANCZOS = Lanczos()
    """The method that searches for negative curvature."""
    GROWTH, LONG = 2.0, 1e-2
    """A solution needs a new proof if the strain energy has grown by the first factor since the last proof, or if a
    vertex has moved by more than the second number times the body's size in one solve.
    """
    DEAR, SURE = 40, 0.3
    """If a factorisation costs more than the first number of solutions with the factor, the Lanczos method with the
    kept tangent M is tried first. It proves a minimum if the least eigenvalue of M^-1 K exceeds the second number.
    """
    NEAR = 3
    """Largest number of further iterations after which a proof is still valid, if it was made within the minimisation's
    target. In a nearly flat valley of the energy, even tiny motions change the curvature.
    """
    ROUNDS = 24
    """Largest number of factored tangents in one solve. Each saddle needs one; a long, nearly flat valley of the energy
    needs many.
    """
    SEEN = 0.1
    """A decrease of the energy counts if it exceeds this fraction of the bound of its rounding error. The bound is a
    sum of worst cases. If rounding is mistaken for a decrease, another proof follows.
    """
    FIRST, DOUBLINGS, SHORTENINGS = 1e-3, 12, 6
    """First length of a step along a direction of negative curvature, divided by the body's size; largest numbers of
    doublings and of divisions by four of this length.
    """

    def __init__(self, model: Model) -> None:
        body, actuation = model.body, model.actuation
        self._size, self._product, self._minimiser = body.size, TangentProducts(body), model.minimiser
        self._exact = all(term.exact for term in actuation.terms)
        self._conservative = all(term.conservative for term in actuation.terms)
        # After a proof with contact, a further descent would disturb forces that have settled.
        self._nearest = Minimiser.SHARE * (1.0 if actuation.contacts else UNPROVEN)
        # Contacts and multipliers hold soft motions of the tangent.
        self._free = not (actuation.contacts or actuation.updates)
        self._noise = np.random.default_rng(0).standard_normal(3 * body.unknowns.rows)
        self._noise[body.unknowns.fixed] = 0.0

    def judge(self, solve: Solve, found: Solution) -> Solution:
        """Return a solution with its stability: by a new proof if `_is_due`, otherwise by the last proof.

        From a saddle, the solve continues to an equilibrium of lower energy.
        """
        if not found.converged:
            return found
        if self._is_due(solve, found):
            proved = self._prove(solve, found)
            return proved if self._conservative else _tell(proved, stable=None)
        return _tell(found, stable=solve.start.summary.stable, proved=solve.start.proved)

    def _is_due(self, solve: Solve, found: Solution) -> bool:
        """Return whether a solution needs a new proof.

        It needs one if there is no last proof, after a large change of energy or positions (`GROWTH`, `LONG`), after a
        divided, resumed or long solve, and if the tangent is overdue for renewal.
        """
        start, energy = solve.start, found.state.summary.energy
        if start.proved is None or energy > self.GROWTH * start.proved or solve.interrupted:
            return True
        costly = found.iterations > max(Minimiser.LEAST_AGE, self._minimiser.level.price)
        overdue = self._minimiser.is_overdue(found.state.tangent)
        return costly or overdue or largest_distance(found.positions, start.positions) > self.LONG * self._size

    def _prove(self, solve: Solve, found: Solution) -> Solution:
        """Return a solution with its stability, after leaving saddles and following nearly flat valleys."""
        task = solve.task_at(found.state)
        if known := self._prove_with_kept(task, solve, found):
            return known
        for count in range(self.ROUNDS):
            proof = self._factor(task)
            found = replace_fields(found, state=found.state.with_(tangent=self._minimiser.tangent))
            near = proof.distance <= self._nearest * solve.final_tolerance
            late = past(solve.problem.deadline) or found.iterations >= solve.problem.limit
            if late or (near and proof.counts):
                return _tell(found, stable=proof.stable, distance=proof.distance)
            solve.go_on_from(found.state)
            leaves = count or not (proof.stable and proof.counts)  # in a nearly flat valley, or beside a saddle
            if leaves and not self._leave(solve, found, task, proof.direction) and near:
                return _tell(found, stable=proof.stable, distance=proof.distance)
            again = solve.descend(spent=found.iterations)
            total = found.iterations + again.iterations
            if not (again.converged and again.min_det > 0.0):
                return _tell(replace_fields(found, iterations=total), stable=proof.stable)
            found = replace_fields(again, iterations=total, began=found.began)
            lasting = proof.distance <= Minimiser.SHARE * solve.final_tolerance and again.iterations <= self.NEAR
            if proof.stable and lasting:
                return _tell(found, stable=True)
            task = solve.task_at(found.state)
        return self._conclude(found, proof, solve.problem.tolerance)

    def _conclude(self, found: Solution, proof: Proof, tolerance: float) -> Solution:
        """Return the solution after all `ROUNDS`: with its stability if near enough, otherwise as not converged."""
        if proof.measured and proof.distance <= tolerance:
            return _tell(found, stable=proof.stable, distance=proof.distance)
        state = found.state.with_flaw(tell(Outcome.NEUTRAL), error_estimate=proof.distance)
        return replace_fields(found, state=state, ended=Outcome.NEUTRAL)

    def _factor(self, task: Task) -> Proof:
        """Factor the tangent at the unknowns of ``task``; return the result."""
        definite = self._minimiser.renew(task)
        stable, direction = self._examine(task, definite=definite)
        distance, step = self._minimiser.newton_step(task)
        measured = definite or not self._free or self._minimiser.tangent is None
        return Proof(stable, step if direction is None else direction, distance, measured)

    def _prove_with_kept(self, task: Task, solve: Solve, found: Solution) -> Solution | None:
        """Return the solution if the kept tangent M proves it a minimum; None if not, or if a new factor is cheap."""
        minimiser = self._minimiser
        if minimiser.tangent is None or minimiser.level.price <= self.DEAR:
            return None
        minimiser.level.turn(task.active.workspace.x)
        seen = self.look(task)
        if not (seen.known and seen.value > self.SURE):
            return None
        distance, _ = minimiser.newton_step(task)
        near = distance <= min(Minimiser.SHARE, seen.value) * solve.final_tolerance
        return _tell(found, stable=True, distance=distance / seen.value) if near else None

    def _leave(self, solve: Solve, found: Solution, task: Task, direction: Array) -> bool:
        """Move the solve to the point that `leave` finds along ``direction`` (3 r,); return False if there is none."""
        if (down := self.leave(task, direction)) is None:
            return False
        task.active.workspace.u[...], positions = down
        slides, turns = task.active.rigid_motion()
        solve.go_on_from(found.state.with_(positions=positions, slides=slides, turns=turns))
        return True

    def _examine(self, task: Task, *, definite: bool) -> tuple[bool | None, Array | None]:
        """Return whether the energy has positive curvature in every direction, None if that is unknown.

        The second result is None, or the softest direction (3 r,) if its curvature is not positive.
        """
        if definite and self._exact:
            return True, None
        seen = self.look(task)
        if seen.value > -self.LANCZOS.flat:
            proved = not (self._exact and self._free) and seen.known and seen.value > self.LANCZOS.flat
            return (True, None) if proved else (None, seen.direction)
        return False, seen.direction

    def look(self, task: Task) -> Lowest:
        """Return the softest direction at the unknowns of ``task``; all terms must have been evaluated there.

        The Lanczos method starts from a random vector with a fixed seed, which contains all modes. The loads of a
        perfectly symmetric body would not contain the buckling mode.
        """
        with task.turn:
            self._product.begin(task)
            product, forces = self._product, self._minimiser.contact_forces
            if forces is not None:
                product = forces.support(task.problem, task.active.workspace, product)
            return self.LANCZOS.lowest(product, partial(self._minimiser.precondition, task), self._noise)

    def leave(self, task: Task, direction: Array) -> tuple[Array, Array] | None:
        """Return the point of least energy on the arc of a ``direction`` (3 r,); None if the energy does not fall.

        The point is given by its unknowns (3 r,) and vertex positions (n, 3) [m]. The first length is divided by four
        until the energy falls, and then doubled while the energy falls further. A straight line instead of the arc
        would stretch, for example, a bent column that turns about its axis.
        """
        work, status = task.active.workspace, task.active.status
        sign = -1.0 if float(work.gradient @ direction) > 0.0 else 1.0
        longest = largest(direction)
        unit, length, best, found = sign / longest * direction, min(self.FIRST * self._size, longest), np.inf, None
        noise = float(status["grain"] + ENERGY_ROUNDING * (status["absolute"] + status["outside"]))
        least = float(status["energy"]) - self.SEEN * noise
        self._product.begin(task)
        for _ in range(self.SHORTENINGS + self.DOUBLINGS):
            with task.turn:
                step = self._minimiser.follow_arc(task, length * unit)
                energy = self._product.energy(step)
            if not energy < min(least, best):
                if found is not None:
                    break
                length *= 0.25
                continue
            best, found = energy, (work.u + step, self._product.positions.copy())
            length *= 2.0
        return found


def _tell(
    found: Solution, *, stable: bool | None, proved: float | None = None, distance: float | None = None
) -> Solution:
    """Return a solution with its stability, and a message if it is unstable.

    ``proved`` is the strain energy [J] at the last proof; None if this solution is the last proved one. ``distance`` is
    a better estimate of the distance to the equilibrium, divided by the body's size.
    """
    if not found.converged:
        return found
    message = join("" if stable is not False else tell(Outcome.UNSTABLE), found.message)
    estimate = found.error_estimate if distance is None else distance
    summary = replace_fields(found.state.summary, stable=stable, message=message, error_estimate=estimate)
    proved = summary.energy if proved is None else proved
    return replace_fields(found, state=found.state.with_(summary=summary, proved=proved))
