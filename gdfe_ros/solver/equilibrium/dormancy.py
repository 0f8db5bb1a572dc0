# SPDX-License-Identifier: Apache-2.0
"""Which part of a body the commands reach: the rest is held, and wakes when its forces ask for it.

The elements of the held part keep the forces of their last evaluation. At its border forces change with what moves
beside it; how far they would move the held vertices is estimated as any step is, by the constant matrix, and bounds the
error. Beyond the tolerance the whole body is solved once more. This is the paper's outlook: "discount elements which
are not relevant to the actuation".
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
from gdfe_ros.solver.state import Known, Sleep, State
from gdfe_ros.solver.value import changed

QUIET = 0.1
"""Of the tolerance: a vertex that a step moves less is at rest."""
PATIENCE, MOST_PATIENCE = 4, 64
"""Steps of the whole body in a row in which a vertex must be at rest before it is held: at first, and after parts
that did not last."""
WORTH = 0.75
"""Share of the free vertices beyond which a part does not pay."""
MOST_REST = 32
"""Steps, at most, in which nobody looks at vertices after a part would have been too large."""
LEAST_VERTICES = 1500
"""Free vertices below which a factor of its own does not pay."""
LAYERS = 2
"""Layers of elements around what moved that are kept awake."""
SHORT, LONG = 8, 32
"""Steps within which a part that wakes was chosen too small, and from which on it was chosen well."""
STIRRED = 0.25
"""Of the largest motion of a held vertex on waking: what moved more is no longer held."""
CERTAIN = 0.5
"""Of the tolerance: an estimate from the size of the border's forces that lies below is not refined."""


@dataclass(frozen=True, eq=False)
class Part:
    """A part of a body that is awake.

    Attributes:
        awake: (n,) vertices that it was made of.
        active: what it moves.
        watched: int32 held vertices whose forces may change.
        rows: of these among the body's free vertices.
        handles: int32 vertices of handles beside held elements.
    """

    awake: NDArray[np.bool_]
    active: ActiveSet
    watched: NDArray[np.int32]
    rows: NDArray[np.int64]
    handles: NDArray[np.int32]


class Dormancy:
    """Chooses between the whole and a part of the body, step by step.

    Args:
        body: the discretised body.
        whole: everything that can move.
        skip: what may be left out.
        pushed: terms beside the elements act, perhaps on held vertices.
    """

    def __init__(self, body: Body, whole: ActiveSet, skip: Collection[Skip], *, pushed: bool) -> None:
        self._body, self._whole, self._skip, self._pushed = body, whole, skip, pushed
        self._possible = Skip.DORMANT in skip and len(whole.unknowns.free) >= LEAST_VERTICES
        self._alive = np.zeros(len(body.rest), dtype=bool)
        self._alive[whole.unknowns.members] = True
        self._part: Part | None = None

    def forbid(self) -> None:
        """Hold nothing, ever: where the constant matrix cannot tell how far what is held would move."""
        self._possible = False

    def at_rest(self) -> Sleep | None:
        """Return that nothing is held; None where nothing ever is."""
        if not self._possible:
            return None
        return Sleep(
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
        """Return what a solve from ``state`` looks at, with the handles commanded to ``base`` (n, 3) [m]."""
        sleep = state.sleep
        if sleep is None or sleep.awake is None or sleep.known is None:
            return self._whole
        return self._whole if self.touched(state, base) else self._made(sleep.awake).active

    def touched(self, state: State, base: NDArray[np.float64]) -> bool:
        """Tell whether handles beside what is held move from ``state`` to ``base`` (n, 3) [m]."""
        if state.sleep is None or state.sleep.awake is None:
            return False
        handles = self._made(state.sleep.awake).handles
        return not np.array_equal(base[handles], state.positions[handles])

    def is_part(self, active: ActiveSet) -> bool:
        """Tell whether something is held."""
        return active is not self._whole

    def disturbance(self, sleep: Sleep, target: float) -> tuple[float, float]:
        """Return how far [m] the held vertices would move by now if they were free, and by how much a force of 1 N.

        The first is exact about ``target`` [m].
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
        self, sleep: Sleep | None, active: ActiveSet, positions: NDArray[np.float64], tolerance: float
    ) -> Sleep | None:
        """Return what is held after a step of ``active`` to ``positions`` (n, 3) [m]; its forces may be missing."""
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

    def learned(self, sleep: Sleep | None, evaluate: Callable[[], Known]) -> Sleep | None:
        """Return ``sleep`` with the forces of what it holds; ``evaluate`` takes those of the whole body."""
        if sleep is None or sleep.awake is None or sleep.known is not None:
            return sleep
        known = evaluate()
        return changed(sleep, known=known, border=self._forces(self._made(sleep.awake)))

    def woken(self, sleep: Sleep | None) -> Sleep | None:
        """Return ``sleep`` with nothing held: handles have moved beside what was."""
        return None if sleep is None else self._dropped(sleep)

    def _watched(self, sleep: Sleep, quiet: NDArray[np.bool_]) -> Sleep:
        """Count the steps in which vertices are at rest; hold what has been so for long enough."""
        calm, count = sleep.calm & quiet, sleep.count + 1
        if count < sleep.patience:
            return changed(sleep, calm=calm, count=count)
        return changed(self._taken(sleep, ~calm), count=0, calm=np.ones_like(calm))

    def _widened(self, sleep: Sleep, moved: NDArray[np.float64]) -> Sleep:
        """Go on with the part after it woke; enlarge it where it did not last."""
        if sleep.lasted < SHORT:
            held = self._made(sleep.awake).active.held
            stirred = np.zeros(len(moved), dtype=bool)
            stirred[held] = moved[held] > STIRRED * moved[held].max()
            patience = min(2 * sleep.patience, MOST_PATIENCE)
            sleep = self._taken(changed(sleep, patience=patience), stirred | sleep.awake)
        return changed(sleep, lasted=0, known=None, border=None)

    def _taken(self, sleep: Sleep, awake: NDArray[np.bool_]) -> Sleep:
        """Hold all but the vertices ``awake`` (n,) and some layers around them, where that pays."""
        cells, free = self._body.cells, self._whole.unknowns.free
        awake = awake | self._alive
        for _ in range(LAYERS):
            awake[cells[awake[cells].any(axis=1)]] = True
        if awake[free].sum() > WORTH * len(free):
            rest = min(2 * sleep.longer_rest, MOST_REST)
            return changed(self._dropped(sleep), rests=rest, longer_rest=rest)
        return changed(sleep, awake=awake, known=None, border=None, yielding=np.inf, lasted=0, longer_rest=1)

    def _dropped(self, sleep: Sleep) -> Sleep:
        calm = np.ones_like(sleep.calm)
        return changed(sleep, awake=None, known=None, border=None, lasted=0, count=0, calm=calm)

    def _made(self, awake: NDArray[np.bool_]) -> Part:
        """Return the part of these vertices; the last one is kept, for its factor is dear."""
        if self._part is None or not (awake is self._part.awake or np.array_equal(awake, self._part.awake)):
            whole = self._whole
            free = np.zeros_like(awake)
            free[whole.unknowns.free] = True
            active = whole.part(self._body, awake & free, self._skip)
            asleep, beside = np.zeros_like(awake), np.zeros_like(awake)
            asleep[self._body.cells[np.setdiff1d(whole.elements, active.elements)]] = True
            beside[self._body.cells[active.elements]] = True
            prescribed = whole.unknowns.prescribed
            watched = active.held if self._pushed else active.held[beside[active.held]]
            rows = np.searchsorted(whole.unknowns.free, watched).astype(np.int64)
            self._part = Part(awake, active, watched, rows, prescribed[asleep[prescribed]])
        return self._part

    def _forces(self, part: Part) -> NDArray[np.float64]:
        """Return dE/dx [N] of the watched vertices."""
        work, total = self._whole.workspace, np.empty((len(part.watched), 3))
        gather_rows(work.force, self._whole.unknowns.vertices_only(part.watched), total.reshape(-1))
        return total + work.outside[part.watched] if self._pushed else total
