# SPDX-License-Identifier: Apache-2.0
"""Products of the inverse initial matrix and the pairs of L-BFGS, which `compliance.add_pairs` needs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.solver.descent.loop import Metric, precondition
from gdfe_ros.solver.descent.workspace import Workspace, numbers
from gdfe_ros.solver.matrix.constant_matrix import apply_inverse


class PairImages:
    """The products M^-1 y of all pairs (s, y) of a history. They are kept as long as the matrix and the pair."""

    def __init__(self) -> None:
        self._images, self._frames = np.zeros((0, 0)), np.zeros((0, 9))
        self._known: tuple[tuple[object, ...] | None, NDArray[np.float64]] = None, np.zeros(0)

    def of(
        self, work: Workspace, metric: Metric, key: tuple[object, ...], frames: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the products M^-1 y (memory, 3 r) of all pairs; those that are known are not computed again."""
        status, memory = numbers(work), len(work.curvature)
        last, curvature = self._known
        same = (
            last is not None
            and len(last) == len(key)
            and all(a is b or (isinstance(a, float | bool) and a == b) for a, b in zip(last, key, strict=True))
        )
        if not same or self._images.shape != work.changes.shape or not np.array_equal(frames, self._frames):
            self._images, curvature, self._frames = np.empty_like(work.changes), np.full(memory, np.nan), frames.copy()
        for k in range(int(status["count"])):
            at = (int(status["head"]) - 1 - k) % memory
            if curvature[at] == work.curvature[at]:
                continue
            image = self._images[at]
            if status["wild"]:
                apply_inverse(work.changes[at], metric.coupling, image)
                image *= float(status["scale"])
            else:
                precondition(metric, work.changes[at], image)
            curvature[at] = work.curvature[at]
        self._known = key, curvature
        return self._images
