# SPDX-License-Identifier: Apache-2.0
"""A recording for a fit: its commands and its measured series."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.command import Command
from gdfe_ros.fitting.observable import Observable

TIME, ROW = "time [s]", "row"
"""Values of `Recording.over`."""


@dataclass(frozen=True, eq=False)
class Series:
    """Measured values of one quantity.

    Attributes:
        name: name in tables and pictures.
        observable: simulated quantity with which it is compared.
        times: (m,) on the recording's clock [s], ascending.
        values: (m, c) in SI units, or (m, p, 3) for points on a surface; NaN if a value is missing.
        along: matrix (c, d) from the d simulated values to the c measured values; None for the identity.
        labels: labels of the c columns.
        sigma: standard deviation of a value in SI units; None if unknown.
    """

    name: str
    observable: Observable
    times: NDArray[np.float64]
    values: NDArray[np.float64]
    labels: tuple[str, ...]
    along: NDArray[np.float64] | None = None
    sigma: float | None = None

    @property
    def count(self) -> int:
        """Number of measured values; for points on a surface, number of measured points."""
        finite = np.isfinite(self.values)
        return int(finite.all(axis=2).sum()) if self.values.ndim == 3 else int(finite.sum())

    @property
    def span(self) -> float:
        """Largest range of the values of a column; missing values (NaN) are left out."""
        ranges = np.fmax.reduce(self.values, axis=0) - np.fmin.reduce(self.values, axis=0)
        return float(np.fmax.reduce(ranges.ravel(), initial=0.0))

    @property
    def largest(self) -> float:
        """Largest magnitude of a value; missing values (NaN) are left out."""
        return float(np.fmax.reduce(np.abs(self.values).ravel(), initial=0.0))


@dataclass(frozen=True, eq=False)
class Schedule:
    """Steps of a simulation with their commands.

    Attributes:
        times: ends of the steps (k,) on the simulation's clock [s], ascending.
        commands: command of each step (k,).
    """

    times: NDArray[np.float64]
    commands: tuple[Command, ...]


@dataclass(frozen=True, eq=False)
class Recording:
    """One recording: measured series, and the steps and commands of its simulation.

    Attributes:
        name: name of the recording.
        series: measured series.
        schedule: steps and commands of its simulation.
        overrides: dict from dotted scene key to the value for this recording.
        shift: time [s] by which the recording's clock is ahead of the simulation's, or its initial value for a fit.
        shift_between: bounds of the fitted time shift [s]; None if it is not fitted.
        frame: number of fitted unknowns of the frame: 0, 3 (translation) or 6 (rotation vector, translation).
        from_equilibrium: whether a motion starts from the equilibrium of its first commands, not from the scene's
            initial state.
        remarks: remarks for the user on reading the recording.
        over: the quantity along which values are drawn: time, or the number of a row in a file without times.
    """

    name: str
    series: tuple[Series, ...]
    schedule: Schedule
    overrides: Mapping[str, Any] = field(default_factory=dict)
    shift: float = 0.0
    shift_between: tuple[float, float] | None = None
    frame: int = 0
    from_equilibrium: bool = False
    remarks: tuple[str, ...] = ()
    over: str = TIME

    @property
    def unknowns(self) -> int:
        """Number of the recording's unknowns: time shift and frame."""
        return self.frame + (self.shift_between is not None)

    @property
    def count(self) -> int:
        """Number of measured values."""
        return sum(series.count for series in self.series)
