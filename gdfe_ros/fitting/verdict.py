# SPDX-License-Identifier: Apache-2.0
"""Agreement of a fit with each recording, and warnings about the fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.fitting.parameter import FittedParameter
from gdfe_ros.fitting.problem import FitPoint, FitProblem
from gdfe_ros.fitting.statistics import STRUCTURED, Confidence, autocorrelation

POOR = 0.5
"""Misfit, divided by the measured motion, above which the model explains little of it."""
WORSE = 1.5
"""Ratio of a held-out recording's misfit to that of the fitted recordings above which its prediction is bad."""
SLIGHT = 0.02
"""Misfit, divided by the measured motion, below which there is no warning about structure or prediction."""


@dataclass(frozen=True, eq=False)
class Match:
    """Agreement of a fit with one series of a recording.

    Attributes:
        recording: name of the recording.
        series: name of the series.
        held_out: whether the recording was only predicted, not fitted.
        count: number of compared values.
        unit: SI unit of the values.
        rms: root mean square of simulated minus measured values, in SI units.
        relative: ``rms`` divided by the size of the motion. The size is the root mean square of displacements, or of
            other values minus their mean. For points on a surface it is their largest extent.
        largest: largest absolute difference, in SI units.
        autocorrelation: largest correlation of successive residuals among the columns; NaN if there are too few.
        residual: simulated minus measured values, in SI units, (m, c); distances (m, p) for points on a surface.
    """

    recording: str
    series: str
    held_out: bool
    count: int
    unit: str
    rms: float
    relative: float
    largest: float
    autocorrelation: float
    residual: NDArray[np.float64]


def matches(problem: FitProblem, point: FitPoint, *, held_out: bool = False) -> list[Match]:
    """Return the agreement with each series of each recording."""
    found = []
    for recording, sigmas, parts in zip(
        problem.recordings, problem.sigmas, problem.series_residuals(point), strict=True
    ):
        for series, sigma, part in zip(recording.series, sigmas, parts, strict=True):
            residual = part * sigma
            sound = residual[np.isfinite(residual)]
            rms = float(np.sqrt(np.mean(sound**2))) if sound.size else np.nan
            size = _size(series.values, displacement=series.observable.displacement)
            given = (series.observable.unit, rms, rms / size if size else np.nan, float(np.abs(sound).max(initial=0.0)))
            found.append(
                Match(recording.name, series.name, held_out, sound.size, *given, autocorrelation(residual), residual)
            )
    return found


def _size(values: NDArray[np.float64], *, displacement: bool) -> float:
    """Return the size of the measured motion, as in `Match.relative`."""
    if values.ndim == 3:
        return float(np.nanmax(np.ptp(values.reshape(-1, 3), axis=0)))
    away = values if displacement else values - np.nanmean(values, axis=0)
    return float(np.sqrt(np.nanmean(np.nansum(away**2, axis=1) / values.shape[1])))


def warnings(
    fitted: Sequence[Match], held_out: Sequence[Match], known: Confidence, parameters: Sequence[FittedParameter]
) -> list[str]:
    """Return warnings about a fit, one sentence each."""
    notes = list(known.loose)
    for estimate, parameter in zip(known.estimates, parameters, strict=True):
        if estimate.bound:
            end = getattr(parameter, estimate.bound)
            text = f"{estimate.key} ends at its bound {end:g}: a value beyond it fits the data better"
            notes.append(f"{text}; remedy: wider bounds, or a model with the missing effect")
    for match in fitted:
        if match.relative > POOR:
            notes.append(
                f"{match.recording}, {match.series}: the misfit is {percent(match.relative)} of the motion, so that "
                "the model explains little of it; check units, signs and columns in the match file, and the bounds"
            )
        if match.autocorrelation > STRUCTURED and match.relative > SLIGHT:
            notes.append(
                f"{match.recording}, {match.series}: residuals are structured (correlation with the next one "
                f"{match.autocorrelation:.2f}, {percent(match.relative)} of the motion): the parameters absorb "
                "what the model lacks, and the confidence intervals are too narrow"
            )
    own = np.sqrt(np.nanmean([match.relative**2 for match in fitted])) if fitted else np.nan
    for match in held_out:
        if match.relative > max(WORSE * own, SLIGHT):
            notes.append(
                f"{match.recording}, {match.series}: held out and predicted to {percent(match.relative)} of the "
                f"motion; the fitted recordings are met to {percent(own)}: the model lacks an effect in which the "
                "recordings differ"
            )
    return notes


def percent(fraction: float) -> str:
    """Return a fraction as a percentage with two digits, e.g. ``14 %``, or with all digits from 100 % on."""
    return f"{100.0 * fraction:.{2 if fraction < 0.995 else 3}g} %" if fraction < 9.995 else f"{100.0 * fraction:.0f} %"
