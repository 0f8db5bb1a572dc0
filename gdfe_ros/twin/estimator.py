# SPDX-License-Identifier: Apache-2.0
"""Recursive least squares for Young's moduli, with the exact derivatives of a simulation."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

SPREAD = 1.0
"""Standard deviation of the logarithm of a modulus before the first measurement: a factor of e."""
FORGETTING = 30.0
"""Time [s] after which a measurement counts 1/e: moduli change slowly, by temperature, wear and fatigue."""


class ModulusEstimator:
    r"""Estimates the logarithms of moduli from measured positions.

    With the deviation e (3,) of a measurement from the simulation, and its derivatives H = dx/d(log E), the estimate
    minimises

        sum_k w_k |e_k - H_k d|^2 / sigma_k^2 + |d|^2 / SPREAD^2

    over the correction d. The sums A = sum w H^T H / sigma^2 and b = sum w H^T e / sigma^2 are all that is stored.
    After the simulation has taken the correction, `settle` makes it the new point of linearisation.

    Args:
        count: number of moduli.
    """

    def __init__(self, count: int) -> None:
        self._prior = np.eye(count) / SPREAD**2
        self._information, self._right = np.zeros((count, count)), np.zeros(count)
        self._moved, self._last = np.zeros(count), None

    def add(self, time: float, deviation: ArrayLike, derivatives: ArrayLike, sigma: float) -> None:
        """Add a measurement.

        Args:
            time: of the measurement [s]; earlier measurements are forgotten with the time since then.
            deviation: measured minus simulated position (3,) [m].
            derivatives: of the simulated position with respect to the logarithms of the moduli (3, n) [m].
            sigma: standard deviation of the deviation along an axis [m].
        """
        rows, e = np.asarray(derivatives, dtype=np.float64), np.asarray(deviation, dtype=np.float64)
        if self._last is not None:
            kept = np.exp(-max(0.0, time - self._last) / FORGETTING)
            self._information, self._right = kept * self._information, kept * self._right
        self._last = time if self._last is None else max(time, self._last)
        self._information = self._information + rows.T @ rows / sigma**2
        self._right = self._right + rows.T @ e / sigma**2

    @property
    def correction(self) -> NDArray[np.float64]:
        """The correction d (n,) of the logarithms of the moduli that the simulation has now."""
        return np.linalg.solve(self._information + self._prior, self._right - self._prior @ self._moved)

    @property
    def deviations(self) -> NDArray[np.float64]:
        """Standard deviations (n,) of the logarithms: relative ones of the moduli, if the noise is as assumed."""
        return np.sqrt(np.diag(np.linalg.inv(self._information + self._prior)))

    def settle(self, taken: ArrayLike) -> None:
        """Note that the simulation has taken a correction (n,): deviations are smaller by it from now on."""
        step = np.asarray(taken, dtype=np.float64)
        self._moved = self._moved + step
        self._right = self._right - self._information @ step
