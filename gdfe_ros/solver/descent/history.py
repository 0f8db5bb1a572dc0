# SPDX-License-Identifier: Apache-2.0
"""The quasi-Newton history as a value that a state can store."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.solver.descent.workspace import Workspace, numbers


@dataclass(frozen=True, eq=False)
class UpdateHistory:
    """The pairs of an L-BFGS history, oldest first; an immutable value.

    Attributes:
        steps: (3 r,) each, changes s of the unknowns [m].
        images: (3 r,) each, v = H_0 y [m], where y is the change of the gradient [N].
        triangle, gram: (k, k) s_i . y_j (upper triangle) and y_i . v_j [J].
    """

    steps: tuple[NDArray[np.float64], ...]
    images: tuple[NDArray[np.float64], ...]
    triangle: NDArray[np.float64]
    gram: NDArray[np.float64]

    @classmethod
    def empty(cls) -> UpdateHistory:
        """Return a history without pairs."""
        return cls((), (), np.zeros((0, 0)), np.zeros((0, 0)))


class HistoryKeeper:
    """Copies histories between a workspace and immutable values; unchanged pairs are not copied.

    Args:
        workspace: the workspace.
    """

    def __init__(self, workspace: Workspace) -> None:
        self._workspace, self._status = workspace, numbers(workspace)
        self._held: UpdateHistory | None = None
        self._pairs: dict[int, tuple[NDArray[np.float64], NDArray[np.float64]]] = {}

    def load(self, history: UpdateHistory) -> None:
        """Load ``history`` into the workspace for the next minimisation."""
        held, self._held = self._held, None
        if held is history:
            return
        work, status, count = self._workspace, self._status, len(history.steps)
        self._pairs = {}
        for i, pair in enumerate(zip(history.steps, history.images, strict=True)):
            status["serial"] += 1
            work.row[i], work.serial[i] = i, status["serial"]
            work.steps[i], work.images[i] = pair
            self._pairs[int(status["serial"])] = pair
        work.row[count:] = np.arange(count, len(work.row))
        work.triangle[:count, :count], work.gram[:count, :count] = history.triangle, history.gram
        status["count"], status["pending"] = count, 0

    def export(self) -> UpdateHistory:
        """Return the history at the end of the last minimisation."""
        work, known = self._workspace, self._pairs
        count = int(self._status["count"])
        rows = work.row[:count]
        self._pairs = {
            serial: known.get(serial) or (work.steps[row].copy(), work.images[row].copy())
            for row, serial in zip(rows.tolist(), work.serial[rows].tolist(), strict=True)
        }
        steps, images = zip(*self._pairs.values(), strict=True) if count else ((), ())
        triangle, gram = work.triangle[:count, :count].copy(), work.gram[:count, :count].copy()
        self._held = UpdateHistory(steps, images, triangle, gram)
        return self._held
