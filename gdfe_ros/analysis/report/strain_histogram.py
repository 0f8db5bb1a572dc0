# SPDX-License-Identifier: Apache-2.0
"""Histogram of the cells' strains over time; its memory does not depend on the length of the run."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_FINE = 2048
_SMALLEST = 1e-6


class StrainHistogram:
    """Histogram of the cells' strains for each group of consecutive steps.

    The largest strain of a run need not be known in advance. If a strain exceeds the range, the range is doubled and
    pairs of classes are merged.

    Args:
        steps: number of steps of the run.
        columns: largest number of groups.
    """

    def __init__(self, steps: int, *, columns: int) -> None:
        self._steps, self._columns = max(1, steps), min(columns, max(1, steps))
        self._counts = np.zeros((self._columns, _FINE))
        self._times = np.full(self._columns, np.nan)
        self._range, self._most = _SMALLEST, 0.0

    def add(self, number: int, time: float, strain: NDArray[np.float32]) -> None:
        """Add the strains (m,) of step ``number`` at ``time`` [s]; values that are not finite are left out."""
        values = strain[np.isfinite(strain)].astype(float)
        if not values.size:
            return
        self._most = max(self._most, float(values.max()))
        while self._most >= self._range:
            self._range *= 2.0
            merged = self._counts.reshape(self._columns, -1, 2).sum(axis=2)
            self._counts = np.hstack([merged, np.zeros_like(merged)])
        column = number * self._columns // self._steps
        places = np.clip(values * (_FINE / self._range), 0, _FINE - 1).astype(np.int64)
        self._counts[column] += np.bincount(places, minlength=_FINE)
        self._times[column] = time

    def shares(self, bins: int) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return the histogram in ``bins`` classes up to the largest strain of the run.

        Returns:
            End of each group (c,) [s], edges of the classes (bins + 1,), and fractions (bins, c) of the cells in each
            class, averaged over each group. c is 0 if no strains were added.
        """
        seen = np.isfinite(self._times)
        edges = np.linspace(0.0, max(self._most, _SMALLEST) * (1.0 + 1e-9), bins + 1)
        middles = (np.arange(_FINE) + 0.5) * self._range / _FINE
        places = np.clip(np.searchsorted(edges, middles, side="right") - 1, 0, bins - 1)
        shares = np.zeros((bins, self._columns))
        np.add.at(shares, places, self._counts.T)
        return self._times[seen], edges, (shares / np.maximum(self._counts.sum(axis=1), 1.0))[:, seen]
