# SPDX-License-Identifier: Apache-2.0
"""Measured and simulated values of each column, for the tables, pictures and pages of a fit."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.fitting.comparison import predicted
from gdfe_ros.fitting.fit import Fit
from gdfe_ros.fitting.problem import FitPoint, FitProblem
from gdfe_ros.fitting.recording import Recording


@dataclass(frozen=True, eq=False)
class ComparedColumn:
    """One measured column with the simulated values.

    Attributes:
        recording: name of the recording.
        series: name of the series, with the column's label.
        unit: SI unit of the values.
        held_out: whether its recording was only predicted, not fitted.
        times: (m,) [s] on the recording's clock.
        measured: measured values (m,).
        simulated: simulated values (m,).
        over: the quantity of ``times``, `Recording.over`.
    """

    recording: str
    series: str
    unit: str
    held_out: bool
    times: NDArray[np.float64]
    measured: NDArray[np.float64]
    simulated: NDArray[np.float64]
    over: str


def curves(fit: Fit) -> list[ComparedColumn]:
    """Return every measured column with its simulated values; a cloud has one column of root mean square distances."""
    found = list(_curves(fit.problem, fit.solved.point, held_out=False))
    if fit.held_out is not None:
        found += _curves(fit.held_out, fit.prediction, held_out=True)
    return found


def _curves(problem: FitProblem, point: FitPoint, *, held_out: bool) -> Iterator[ComparedColumn]:
    parts = problem.series_residuals(point)
    for number, recording in enumerate(problem.recordings):
        values = predicted(recording, point.trajectories[number], point.own[number])
        for place, series in enumerate(recording.series):
            unit = series.observable.unit
            common = (recording, held_out, series.times)
            if len(series.labels) != series.values.shape[-1] or series.values.ndim == 3:
                distance = _distance(parts[number][place] * problem.sigmas[number][place])
                yield _curve(*common, f"{series.name}, distance", unit, np.zeros(distance.size), distance)
                continue
            for column, label in enumerate(series.labels):
                name = f"{series.name}.{label}" if label else series.name
                yield _curve(*common, name, unit, series.values[:, column], values[place][:, column])


def _distance(residual: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the root mean square (m,) of the residuals at each time."""
    flat = residual.reshape(residual.shape[0], -1)
    return np.sqrt(np.nanmean(flat**2, axis=1))


def _curve(
    recording: Recording,
    held_out: bool,
    times: NDArray[np.float64],
    series: str,
    unit: str,
    measured: NDArray[np.float64],
    simulated: NDArray[np.float64],
) -> ComparedColumn:
    return ComparedColumn(recording.name, series, unit, held_out, times, measured, simulated, recording.over)
