# SPDX-License-Identifier: Apache-2.0
"""Which part of a body the commands reach: the rest is held, and wakes when its forces ask for it (DESIGN 6).

The elements of the held part keep the forces of their last evaluation. At its border forces change with what moves
beside it; how far they would move the held vertices is estimated as any step is, by the constant matrix, and bounds the
error. Beyond the tolerance the whole body is solved once more. This is the paper's outlook: "discount elements which
are not relevant to the actuation".
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.solver.body import Body
from gdfe_ros.solver.scope import Scope
from gdfe_ros.solver.settings import Skip
from gdfe_ros.solver.unknowns import Unknowns, gather_rows

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


class Dormancy:
    """Chooses between the whole and a part of the body, step by step.

    Args:
        body: the discretised body.
        whole: everything that can move.
        skip: what may be left out.
        pushed: forces from outside act, perhaps on held vertices.
    """

    def __init__(self, body: Body, whole: Scope, skip: Collection[Skip], *, pushed: bool) -> None:
        self._body, self._whole, self._skip, self._pushed = body, whole, skip, pushed
        self._possible = Skip.DORMANT in skip and len(whole.unknowns.free) >= LEAST_VERTICES
        self._alive = self._anchors()
        self.reset()

    def reset(self) -> None:
        """Wake everything."""
        self._patience, self._rests, self._longer_rest = PATIENCE, 0, 1
        self._before = self._body.rest.copy() if self._possible else None
        self._drop()

    @property
    def sleeps(self) -> bool:
        """Tell whether a part is chosen and the forces of the rest are known."""
        return self._part is not None and self._known is not None

    @property
    def waits(self) -> bool:
        """Tell whether a part is chosen and only the forces of the rest are missing."""
        return self._part is not None and self._known is None

    def choose(self, base: NDArray[np.float64]) -> Scope:
        """Return the scope of a solve with the plates at ``base`` (n, 3) [m]."""
        if not self.sleeps:
            return self._whole
        plates = self._plates
        if not np.array_equal(base[plates], self._whole.descent.x[plates]):
            self._drop()
            return self._whole
        return self._part

    def forget_forces(self) -> None:
        """Take note that the held elements were evaluated elsewhere."""
        self._known = None

    def learn_forces(self) -> None:
        """Take the forces of the held elements as known: the whole body was evaluated where the part begins."""
        self._known = self._forces()

    def disturbance(self, target: float) -> float:
        """Return about how far [m] the held vertices would move by now if they were free; exact about ``target``."""
        change = self._forces() - self._known
        size = float(np.linalg.norm(change))
        if size == 0.0:
            return 0.0
        if size * self._yield <= CERTAIN * target:
            return size * self._yield
        right = np.zeros((len(self._whole.unknowns.free), 3))
        right[self._rows] = change
        out = np.empty_like(right)
        self._whole.matrix.solve(right, out)
        reach = float(np.linalg.norm(out, axis=1).max())
        self._yield = reach / size
        return reach

    def accept(self, scope: Scope, tolerance: float) -> None:
        """Look at the step that ``scope`` made, which was accepted."""
        if not self._possible:
            return
        if scope is self._part:
            self._lasted += 1
            if self._lasted == LONG:
                self._patience = PATIENCE
            return
        if self._part is None and self._rests > 0:
            self._rests -= 1
            return
        x, before = scope.descent.x, self._before
        self._before = x.copy()
        moved = np.linalg.norm(x - before, axis=1)
        if self._part is not None:
            self._widen(moved)
        elif moved.max() > QUIET * tolerance * self._body.size:
            self._watch(moved <= QUIET * tolerance * self._body.size)

    def _watch(self, quiet: NDArray[np.bool_]) -> None:
        """Count the steps in which vertices are at rest; hold what has been so for long enough."""
        self._calm &= quiet
        self._count += 1
        if self._count >= self._patience:
            self._count = 0
            self._take(~self._calm)
            self._calm[:] = True

    def _widen(self, moved: NDArray[np.float64]) -> None:
        """Go on with the part after it woke; enlarge it where it did not last."""
        if self._lasted < SHORT:
            held = self._part.held
            stirred = np.zeros(len(moved), dtype=bool)
            stirred[held] = moved[held] > STIRRED * moved[held].max()
            self._patience = min(2 * self._patience, MOST_PATIENCE)
            self._take(stirred | self._active)
        self._lasted, self._known = 0, None

    def _take(self, awake: NDArray[np.bool_]) -> None:
        """Make a part of the vertices ``awake`` (n,) and some layers around them, where that pays."""
        cells, free = self._body.cells, self._whole.unknowns.free
        active = awake | self._alive
        for _ in range(LAYERS):
            active[cells[active[cells].any(axis=1)]] = True
        if active[free].sum() > WORTH * len(free):
            self._drop()
            self._rests = self._longer_rest = min(2 * self._longer_rest, MOST_REST)
            return
        self._longer_rest = 1
        self._active = active
        self._part = self._whole.part(self._body, self._free_only(active), self._skip)
        self._lasted, self._known, self._yield = 0, None, np.inf
        self._plates, watched = self._border()
        self._rows = np.searchsorted(free, watched).astype(np.int64)
        empty = self._whole.unknowns
        self._watched = empty._replace(free=watched, plate_axes=np.zeros((0, 3)))

    def _border(self) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Return the vertices of plates beside held elements, and the held vertices whose forces may change."""
        cells, part, whole = self._body.cells, self._part, self._whole
        asleep, beside = np.zeros(len(self._body.rest), dtype=bool), np.zeros(len(self._body.rest), dtype=bool)
        asleep[cells[np.setdiff1d(whole.elements, part.elements)]] = True
        beside[cells[part.elements]] = True
        prescribed, held = whole.unknowns.prescribed, part.held
        return prescribed[asleep[prescribed]], held if self._pushed else held[beside[held]]

    def _forces(self) -> NDArray[np.float64]:
        """Return dE/dx [N] of the watched vertices."""
        descent, watched = self._whole.descent, self._watched
        total = np.empty((len(watched.free), 3))
        gather_rows(descent.force, watched, total.reshape(-1))
        return total + descent.outside[watched.free] if self._pushed else total

    def _drop(self) -> None:
        self._part: Scope | None = None
        self._known: NDArray[np.float64] | None = None
        self._watched: Unknowns | None = None
        self._lasted, self._count = 0, 0
        self._calm = np.ones(len(self._body.rest), dtype=bool)

    def _anchors(self) -> NDArray[np.bool_]:
        """Return the vertices (n,) that are never held: those around sliding plates."""
        alive = np.zeros(len(self._body.rest), dtype=bool)
        alive[self._whole.unknowns.plate_vertices] = True
        return alive

    def _free_only(self, active: NDArray[np.bool_]) -> NDArray[np.bool_]:
        free = np.zeros_like(active)
        free[self._whole.unknowns.free] = True
        return active & free
