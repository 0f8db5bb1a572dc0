# SPDX-License-Identifier: Apache-2.0
"""The scene `drop` as plain data for peers, independent of our loader: a clamped bar released under its own weight."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from benchmarks.cases import LogNeoHooke

SIZE, TIP = (0.20, 0.02, 0.02), (0.20, 0.0, 0.0)
LAW = LogNeoHooke(young=0.5e6, poisson=0.45)
DENSITY, GRAVITY, LASTS = 1000.0, 9.81, 1.0
"""Density [kg/m^3], gravity [m/s^2] and simulated time [s]."""


@dataclass(frozen=True, eq=False)
class DropPath:
    """Path of the tip in a run of `drop`.

    Attributes:
        times: ends of the steps (k,) [s].
        path: positions of the middle of the end face (k, 3) [m].
        seconds: processor time of the run [s].
    """

    times: npt.NDArray[np.float64]
    path: npt.NDArray[np.float64]
    seconds: float
