# SPDX-License-Identifier: Apache-2.0
"""Dormancy: freezes the part of a body that the commands do not reach, and wakes it when its forces change.

The frozen elements keep the forces of their last evaluation. Moving neighbours change the forces at the border of the
frozen part. The constant matrix estimates the displacement that these changes would cause in the frozen vertices. If
this estimate of the error exceeds the tolerance, the whole body is solved once more. The paper names this in its
outlook: "discount elements which are not relevant to the actuation".
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.solver.body import Body
from gdfe_ros.solver.descent.active_set import ActiveSet
from gdfe_ros.solver.matrix.unknowns import gather_rows
from gdfe_ros.solver.settings import Skip
from gdfe_ros.solver.state import DormancyState, Known, State
from gdfe_ros.solver.value import changed

QUIET = 0.1
"""A vertex counts as at rest if its displacement in a step, divided by tolerance times body size, is at most this."""
PATIENCE, MOST_PATIENCE = 4, 64
"""Number of successive steps of the whole body in which a vertex must be at rest before it is frozen: initial and
largest value. The number is doubled after each awake part that was too small.
"""
WORTH = 0.75
"""Largest fraction of the free vertices that an awake part may have; larger parts save no time."""
MOST_REST = 32
"""Largest number of steps for which the search for vertices to freeze pauses. It pauses if the awake part would be too
large (`WORTH`), each time twice as long."""
LEAST_VERTICES = 1500
"""With fewer free vertices, freezing saves no time, because the awake part needs a factor of its own."""
LAYERS = 2
"""Number of layers of elements around the moving vertices that are not frozen."""
SHORT, LONG = 8, 32
"""An awake part that lasts for fewer than `SHORT` steps was too small. After `LONG` steps, `PATIENCE` applies again."""
STIRRED = 0.25
"""A frozen vertex joins the awake part if its displacement on waking exceeds this fraction of the largest displacement
of a frozen vertex.
"""
CERTAIN = 0.5
"""A displacement estimated without a solve is accepted up to this fraction of the allowed displacement."""


@dataclass(frozen=True, eq=False)
class AwakePart:
    """An awake part of a body.

    Attributes:
        awake: (n,) bool, vertices that the part must contain.
        active: unknowns and elements of the part.
        watched: (k,) int32 frozen vertices whose forces may change.
        rows: indices of the watched vertices among the body's free vertices.
        handles: int32 vertices of handles next to frozen elements.
    """

    awake: NDArray[np.bool_]
    active: ActiveSet
    watched: NDArray[np.int32]
    rows: NDArray[np.int64]
    handles: NDArray[np.int32]


class Dormancy:
    """Chooses in each step between the whole body and its awake part.

    Args:
        body: the discretised body.
        whole: the active set of the whole body.
        skip: kinds of work that may be left out.
        pushed: whether terms other than the elements act, possibly on frozen vertices.
    """

    def __init__(self, body: Body, whole: ActiveSet, skip: Collection[Skip], *, pushed: bool) -> None:
        self._body, self._whole, self._skip, self._pushed = body, whole, skip, pushed
        self._possible = Skip.DORMANT in skip and len(whole.unknowns.free) >= LEAST_VERTICES
        self._alive = np.zeros(len(body.rest), dtype=bool)
        self._alive[whole.unknowns.members] = True
        self._part: AwakePart | None = None

    def forbid(self) -> None:
        """Disable freezing permanently, for bodies whose displacements the constant matrix cannot estimate."""
        self._possible = False

    def at_rest(self) -> DormancyState | None:
        """Return the dormancy state with nothing frozen; None if freezing is disabled."""
        if not self._possible:
            return None
        return DormancyState(
            awake=None,
            known=None,
            border=None,
            yielding=np.inf,
            before=self._body.rest,
            calm=np.ones(len(self._body.rest), dtype=bool),
            count=0,
            patience=PATIENCE,
            rests=0,
            longer_rest=1,
            lasted=0,
        )

    def choose(self, state: State, base: NDArray[np.float64]) -> ActiveSet:
        """Return the active set of a solve from ``state``, with the handles commanded to ``base`` (n, 3) [m]."""
        sleep = state.sleep
        if sleep is None or sleep.awake is None or sleep.known is None:
            return self._whole
        return self._whole if self.touched(state, base) else self._made(sleep.awake).active

    def touched(self, state: State, base: NDArray[np.float64]) -> bool:
        """Return whether handles next to frozen elements move from ``state`` to ``base`` (n, 3) [m]."""
        if state.sleep is None or state.sleep.awake is None:
            return False
        handles = self._made(state.sleep.awake).handles
        return not np.array_equal(base[handles], state.positions[handles])

    def is_part(self, active: ActiveSet) -> bool:
        """Return whether an active set leaves out frozen elements."""
        return active is not self._whole

    def disturbance(self, sleep: DormancyState, target: float) -> tuple[float, float]:
        """Return the displacement [m] that the frozen vertices would have if they were free, and a compliance [m/N].

        The compliance is the displacement divided by the norm of the change of the forces on the frozen vertices. The
        displacement is estimated by a solve with the constant matrix. If the last compliance gives at most `CERTAIN`
        times ``target`` [m], it is used instead of a solve.
        """
        part = self._made(sleep.awake)
        change = self._forces(part) - sleep.border
        size = float(np.linalg.norm(change))
        if size == 0.0:
            return 0.0, sleep.yielding
        if size * sleep.yielding <= CERTAIN * target:
            return size * sleep.yielding, sleep.yielding
        right = np.zeros((len(self._whole.unknowns.free), 3))
        right[part.rows] = change
        out = np.empty_like(right)
        self._whole.matrix.solve(right, out)
        reach = float(np.linalg.norm(out, axis=1).max())
        return reach, reach / size

    def accepted(
        self, sleep: DormancyState | None, active: ActiveSet, positions: NDArray[np.float64], tolerance: float
    ) -> DormancyState | None:
        """Return the dormancy state after a step that solved ``active`` and ended at ``positions`` (n, 3) [m].

        After a change of the awake part, the dormancy state has no forces of frozen elements yet; `learned` adds them.
        """
        if sleep is None:
            return None
        if self.is_part(active):
            lasted = sleep.lasted + 1
            return changed(sleep, lasted=lasted, patience=PATIENCE if lasted == LONG else sleep.patience)
        if sleep.awake is None and sleep.rests > 0:
            return changed(sleep, rests=sleep.rests - 1)
        moved = np.linalg.norm(positions - sleep.before, axis=1)
        sleep = changed(sleep, before=positions)
        if sleep.awake is not None:
            return self._widened(sleep, moved)
        if moved.max() > QUIET * tolerance * self._body.size:
            return self._watched(sleep, moved <= QUIET * tolerance * self._body.size)
        return sleep

    def learned(self, sleep: DormancyState | None, evaluate: Callable[[], Known]) -> DormancyState | None:
        """Return ``sleep`` with the forces of the frozen elements; ``evaluate`` computes the forces of all elements."""
        if sleep is None or sleep.awake is None or sleep.known is not None:
            return sleep
        known = evaluate()
        return changed(sleep, known=known, border=self._forces(self._made(sleep.awake)))

    def woken(self, sleep: DormancyState | None) -> DormancyState | None:
        """Return ``sleep`` with nothing frozen, after handles moved next to frozen elements."""
        return None if sleep is None else self._dropped(sleep)

    def _watched(self, sleep: DormancyState, quiet: NDArray[np.bool_]) -> DormancyState:
        """Count a step; freeze the vertices that were at rest (``quiet``) in all of the last ``patience`` steps."""
        calm, count = sleep.calm & quiet, sleep.count + 1
        if count < sleep.patience:
            return changed(sleep, calm=calm, count=count)
        return changed(self._taken(sleep, ~calm), count=0, calm=np.ones_like(calm))

    def _widened(self, sleep: DormancyState, moved: NDArray[np.float64]) -> DormancyState:
        """Keep the awake part after a solve of the whole body; enlarge it if it lasted for fewer than `SHORT` steps."""
        if sleep.lasted < SHORT:
            held = self._made(sleep.awake).active.frozen
            stirred = np.zeros(len(moved), dtype=bool)
            stirred[held] = moved[held] > STIRRED * moved[held].max()
            patience = min(2 * sleep.patience, MOST_PATIENCE)
            sleep = self._taken(changed(sleep, patience=patience), stirred | sleep.awake)
        return changed(sleep, lasted=0, known=None, border=None)

    def _taken(self, sleep: DormancyState, awake: NDArray[np.bool_]) -> DormancyState:
        """Freeze all but the vertices ``awake`` (n,) and `LAYERS` layers around them; none if these are too many."""
        cells, free = self._body.cells, self._whole.unknowns.free
        awake = awake | self._alive
        for _ in range(LAYERS):
            awake[cells[awake[cells].any(axis=1)]] = True
        if awake[free].sum() > WORTH * len(free):
            rest = min(2 * sleep.longer_rest, MOST_REST)
            return changed(self._dropped(sleep), rests=rest, longer_rest=rest)
        return changed(sleep, awake=awake, known=None, border=None, yielding=np.inf, lasted=0, longer_rest=1)

    def _dropped(self, sleep: DormancyState) -> DormancyState:
        calm = np.ones_like(sleep.calm)
        return changed(sleep, awake=None, known=None, border=None, lasted=0, count=0, calm=calm)

    def _made(self, awake: NDArray[np.bool_]) -> AwakePart:
        """Return the part with the vertices ``awake`` (n,); the last part is cached because its factor is expensive."""
        if self._part is None or not (awake is self._part.awake or np.array_equal(awake, self._part.awake)):
            whole = self._whole
            free = np.zeros_like(awake)
            free[whole.unknowns.free] = True
            active = whole.part(self._body, awake & free, self._skip)
            asleep, beside = np.zeros_like(awake), np.zeros_like(awake)
            asleep[self._body.cells[np.setdiff1d(whole.elements, active.elements)]] = True
            beside[self._body.cells[active.elements]] = True
            prescribed = whole.unknowns.prescribed
            watched = active.frozen if self._pushed else active.frozen[beside[active.frozen]]
            rows = np.searchsorted(whole.unknowns.free, watched).astype(np.int64)
            self._part = AwakePart(awake, active, watched, rows, prescribed[asleep[prescribed]])
        return self._part

    def _forces(self, part: AwakePart) -> NDArray[np.float64]:
        """Return dE/dx (k, 3) [N] of the watched vertices of ``part``."""
        work, total = self._whole.workspace, np.empty((len(part.watched), 3))
        gather_rows(work.force, self._whole.unknowns.vertices_only(part.watched), total.reshape(-1))
        return total + work.outside[part.watched] if self._pushed else total
