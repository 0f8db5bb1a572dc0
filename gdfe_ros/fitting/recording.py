# SPDX-License-Identifier: Apache-2.0
"""A recording as a fit takes it: what was commanded, what was measured."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.command import Command
from gdfe_ros.fitting.observable import Observable


@dataclass(frozen=True, eq=False)
class Series:
    """Measured values of one quantity.

    Attributes:
        name: in tables and pictures.
        observable: what of the simulation it is.
        times: (m,) on the recording's clock [s], ascending.
        values: (m, c) in SI units, NaN where a value is missing; of a surface (m, p, 3).
        along: (c, d) rows turn the d values of the simulation into the c measured ones; None: as they are.
        labels: of the c columns.
        sigma: standard deviation of a value in SI units; None: not told.
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
        """Number of measured values, of a surface that of its points."""
        finite = np.isfinite(self.values)
        return int(finite.all(axis=2).sum()) if self.values.ndim == 3 else int(finite.sum())

    @property
    def span(self) -> float:
        """Largest range of a column."""
        return float(np.nanmax(np.ptp(self.values, axis=0)))


@dataclass(frozen=True, eq=False)
class Schedule:
    """What is commanded when.

    Attributes:
        times: ends of the steps (k,) on the simulation's clock [s], ascending.
        commands: (k,) of the steps.
    """

    times: NDArray[np.float64]
    commands: tuple[Command, ...]


@dataclass(frozen=True, eq=False)
class Recording:
    """One recording.

    Attributes:
        name: of it.
        series: what was measured.
        schedule: what was commanded.
        overrides: keys of the scene that differ in this recording.
        shift: how far the recording's clock is ahead [s], where it is not fitted.
        shift_between: bounds of that time where it is fitted; None where it is not.
        frame: how many numbers of the frame are fitted: 0, 3 (translation) or 6 (rotation vector, translation).
        from_equilibrium: a motion begins in equilibrium under its first commands, else at rest.
        remarks: what a user must know of how it was read.
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

    @property
    def unknowns(self) -> int:
        """Numbers of the recording's own that are fitted."""
        return self.frame + (self.shift_between is not None)

    @property
    def count(self) -> int:
        """Number of measured values."""
        return sum(series.count for series in self.series)
