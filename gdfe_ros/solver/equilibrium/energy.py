# SPDX-License-Identifier: Apache-2.0
"""Equilibrium solver of the policy ``energy``: set-up of its matrices and terms, solves, and forces at a state."""

from __future__ import annotations

from collections.abc import Callable, Collection
from functools import partial

import numpy as np

from gdfe_ros.compiled import start_threads
from gdfe_ros.constraints import Pose
from gdfe_ros.materials.table import LAME, LOCAL, PENALTY, SHEAR, YOUNG
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.contact.contact_forces import ContactForces
from gdfe_ros.solver.contact.contact_term import FAINT
from gdfe_ros.solver.descent.active_set import ActiveSet
from gdfe_ros.solver.equilibrium.predictor import Predictor
from gdfe_ros.solver.equilibrium.solve import Model, Solve
from gdfe_ros.solver.equilibrium.stability import Stability
from gdfe_ros.solver.forces.actuation import Actuation, vertex_forces
from gdfe_ros.solver.forces.pressures import at_rest
from gdfe_ros.solver.handle_motions import HandleMotions
from gdfe_ros.solver.matrix.constant_matrix import SINGULAR, ConstantMatrix, assemble
from gdfe_ros.solver.minimise.level import TangentLevel
from gdfe_ros.solver.minimise.minimiser import Minimiser, Observer
from gdfe_ros.solver.settings import Skip
from gdfe_ros.solver.solution import Increment, Solution
from gdfe_ros.solver.state import State, replace_fields
from gdfe_ros.solver.vectors import Array
from gdfe_ros.threads import one_blas_thread


class EquilibriumSolver:
    """Equilibrium solver of the policy ``energy``: finds positions at which all forces of elements and terms balance.

    Args:
        body: the discretised body.
        actuation: the external terms; None for none.
        skip: kinds of work that are left out where possible.
        threads: largest number of threads among which the elements are divided.
        predictor: function that makes the predictor of a solve's start from the handles' kinematics and the constant
            matrix; None in statics, for `Predictor`.
        softening: whether hourglass scales follow the strain. With ``newmark`` they stay constant, because a change of
            scale would create or remove energy.

    Attributes:
        matrix: the constant matrix.
        handles: the kinematics of the handles.
        model: the data common to all solves.
        minimiser: the minimiser of the potential.
        whole: the active set of the whole body.
        patience: number of iterations after which a solve ends and a shorter increment is tried.
    """

    patience = 2000
    INVERSE_ITERATIONS = 6
    """Number of inverse iterations with the tangent's factor; they give the softness of the body (`first_shift`) to
    within a tenth.
    """

    def __init__(
        self,
        body: Body,
        actuation: Actuation | None = None,
        *,
        skip: Collection[Skip] = tuple(Skip),
        threads: int = 1,
        predictor: Callable[[HandleMotions, ConstantMatrix], Predictor] | None = None,
        softening: bool = True,
    ) -> None:
        self.body = body
        if threads > 1:
            start_threads()
        self.actuation = actuation or Actuation(body)
        parameters = body.table.parameters[body.material]
        stiffness = 2.0 * parameters[:, SHEAR] + parameters[:, PENALTY] + parameters[:, LAME] + parameters[:, LOCAL]
        bending = parameters[:, YOUNG] * np.cbrt(body.shape.volume) / 6.0
        shares = [term.stiffness() for term in self.actuation.terms]
        assembled = sum(
            (share for share in shares if share is not None), assemble(body.shape, stiffness, bending, len(body.rest))
        )
        self.matrix = ConstantMatrix(assembled.tocsc(), body.rest, body.unknowns)
        self.actuation.fit(self.matrix)
        self.handles = HandleMotions(body)
        self._predictor = (predictor or partial(Predictor, body))(self.handles, self.matrix)
        rigid = not self.actuation.growths
        self.whole = ActiveSet(body, self.matrix, rigid=rigid, skip=skip, softening=softening)
        level = TangentLevel(body, self.matrix.assembled, self.actuation.terms)
        moving, touching = predictor is not None, self.actuation.contacts
        forces = ContactForces(self.actuation.held, body.unknowns, len(body.rest)) if touching else None
        self.minimiser = Minimiser(body, stiffness, level, moving=moving, contact_forces=forces)
        own = self.actuation, self.handles, self.minimiser
        self.model = Model(body, *own, self.whole, self.whole.threads(threads), moving)
        if level.affordable:
            with one_blas_thread():
                self._take_rest()
        self._stability = None if moving or not body.unknowns.rows else Stability(self.model)

    def _take_rest(self) -> None:
        """Give the minimiser the tangent of the undeformed body, unless the body is a mechanism.

        The softness of the body is also computed: the least eigenvalue of its tangent relative to the constant matrix.
        It becomes the first multiple of the constant matrix that is added to an indefinite tangent.
        """
        unknowns, level, work = self.whole.unknowns, self.minimiser.level, self.whole.workspace
        if not len(unknowns.free):
            return
        task = Solve.at(self.model, self.at_rest()).evaluate()
        tangent = level.factor_tangent(task.problem, work.u, work.x)
        if tangent.shift > 0.0:
            return
        load = np.random.default_rng(0).standard_normal(3 * unknowns.rows)
        load[unknowns.fixed] = 0.0
        for _ in range(self.INVERSE_ITERATIONS):
            found = np.empty_like(load)
            level.solve(load, found)
            least = float(found @ load) / float(found @ self._weigh(found))
            load = self._weigh(found / np.abs(found).max())
        if least >= SINGULAR:  # otherwise the body can turn or move as a whole
            level.first_shift, self.minimiser.rest = least, tangent
            level.keep(tangent)

    def _weigh(self, field: Array) -> Array:
        """Return the constant matrix times a vector ``field`` (3 r,) of unknowns; rows of handles become zero."""
        weighed = np.zeros_like(field)
        free = 3 * len(self.whole.unknowns.free)
        weighed[:free] = self.matrix.multiply(field[:free].reshape(-1, 3)).ravel()
        return weighed

    def at_rest(self) -> State:
        """Return the undeformed state; it is no equilibrium if the body is inside of an obstacle."""
        body, actuation = self.body, self.actuation
        saved, neutral = actuation.at_rest(), actuation.neutral
        actuation.begin(neutral, saved, body.rest, {handle.name: Pose() for handle in body.handles})
        entered = [contact.name for contact in actuation.contacts if contact.inside]
        return actuation.rest_state(
            converged=not entered,
            message=f"not solved yet: the undeformed body is inside of {', '.join(entered)}" if entered else "",
            terms=saved,
            elements=at_rest(body),
            balance=actuation.balance(body.rest, neutral),
            proved=0.0,
        )

    @property
    def remarks(self) -> list[str]:
        """Remarks on solves: on a motion that begins inside of something, and on tangents that are too expensive."""
        level, found = self.minimiser.level, []
        if self.model.moving and (pushed := self._find_pushed()):
            text = f"the undeformed body is inside of {', '.join(pushed)}, or nearer than its flat faces can tell"
            away = "in the first step, contact pushes it away, perhaps at a high velocity"
            found.append(f"{text}; {away}; remedy: begin farther away; near round obstacles, finer cells")
        if level.affordable:
            return found
        text = f"the factor of the body's tangent would take {level.memory / 1e9:.2g} GB"
        fits = "it is made only where a solve needs it" if level.fits else "which are not free"
        rough = "error estimates rest on the constant matrix and are rough"
        return [*found, f"{text}, {fits}; {rough}; remedy: coarser cells"]

    def _find_pushed(self) -> list[str]:
        """Return the names of the contacts in which the undeformed body has gaps below zero."""
        self.at_rest()
        closed, contacts = -FAINT * self.body.size, self.actuation.contacts
        return [each.name for each in contacts if each.stencils.places[:, 0].min(initial=0.0) < closed]

    def observe(self, observer: Observer | None) -> None:
        """Set the observer, which is called with the energy of every iteration; None for none."""
        self.minimiser.observer = observer

    def solve(self, problem: Increment, start: State) -> Solution:
        """Find the equilibrium of ``problem`` from ``start``, which is not modified.

        In statics, the stability of the solution is examined. In motion, the tangent is renewed if that lowers the cost
        of the next solves.
        """
        base = self.handles.base(problem.poses, start.poses, start.base)
        predicted = self._predictor.predict(start, base, start.change_to(problem.commands))
        solve = Solve(self.model, problem, start, predicted)
        found = solve.descend()
        if self._stability is not None:
            return self._stability.judge(solve, found)
        if found.converged and self.minimiser.is_overdue(found.state.tangent):
            self.minimiser.renew(solve.task_at(found.state))
            return replace_fields(found, state=found.state.with_(tangent=self.minimiser.tangent))
        return found

    def accept(self, solution: Solution, previous: State) -> State:
        """Return the complete state of ``solution``, which follows the state ``previous``."""
        found = solution.state
        return found.with_(
            motion=self._predictor.motion(previous, found, previous.change_to(found.commands)),
            turns=self.handles.within_a_turn(found.turns),
        )

    def forces(self, state: State) -> Array:
        """Return dE/dx (n, 3) [N] of elements and terms at a state; elements inside handles contribute nothing."""
        work, vertices = self.whole.workspace, np.arange(len(self.body.rest), dtype=np.int32)
        Solve.at(self.model, state).evaluate()
        return vertex_forces(self.body, vertices, work.force) + work.outside

    def count_skipped(self) -> dict[str, int]:
        """Return how much work of each kind every solve leaves out, as in `StepResult.skipped`."""
        counts = dict(self.whole.skipped)
        return counts if self.actuation.terms else {**counts, Skip.ACTUATORS.value: 1}
