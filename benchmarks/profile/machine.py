# SPDX-License-Identifier: Apache-2.0
"""Limits of one core of this machine, measured with loops that are compiled like the solver's."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gdfe_ros.compiled import kernel

REPEATS = 30
"""Number of runs of each loop; the fastest run is used."""
_ACCUMULATORS, _PASSES = 64, 100_000
_LARGE = 8_000_000
"""Number of entries of an array that is larger than any cache."""


@dataclass(frozen=True)
class Machine:
    """Limits of one core.

    Attributes:
        peak: rate of additions and multiplications [1/s], not contracted, as in the element kernels.
        bandwidth: rate of a copy in memory [B/s]; read and written bytes are both counted.
    """

    peak: float
    bandwidth: float

    @classmethod
    def measured(cls) -> Machine:
        """Return the measured limits of a core of this machine."""
        values = np.linspace(0.999, 1.001, _ACCUMULATORS)
        operations = 2 * _ACCUMULATORS * _PASSES
        source, target = np.zeros(_LARGE), np.zeros(_LARGE)
        return cls(
            peak=operations / fastest(lambda: _multiply_and_add(values, _PASSES)),
            bandwidth=2 * source.nbytes / fastest(lambda: np.copyto(target, source)),
        )


def fastest(work: Callable[[], object]) -> float:
    """Return the shortest wall time [s] of several runs, after one run that is not timed."""
    work()
    times = []
    for _ in range(REPEATS):
        started = time.perf_counter()
        work()
        times.append(time.perf_counter() - started)
    return min(times)


@kernel
def _multiply_and_add(values, passes):
    """Keep both floating-point units busy: 64 independent chains of a product and a sum."""
    for _ in range(passes):
        for i in range(_ACCUMULATORS):
            values[i] = values[i] * 0.999 + 0.001
