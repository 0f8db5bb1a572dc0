# SPDX-License-Identifier: Apache-2.0
"""Statistics of a fit: intervals, correlations, wrong bounds, agreement with each recording, and warnings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from gdfe_ros.errors import GdfeError
from gdfe_ros.fitting.fitted_parameter import FittedParameter
from gdfe_ros.fitting.problem import FitPoint, FitProblem, Solved
from gdfe_ros.fitting.trajectory import NotSimulatedError

CONFIDENCE = 0.95
LOOSE = 1.0
"""The data determine a combination of parameters (a unit vector in the coordinates u) if its standard deviation is at
most this number. A standard deviation of 1 is a factor e, or the whole interval of a parameter.
"""
ALIKE = 0.995
"""Magnitude of the correlation of two parameters above which the data determine only one combination of them."""
STRUCTURED = 0.5
"""Correlation of successive residuals above which they count as structured; for noise it is about 0."""
FEWEST = 8
"""Least number of values in a series for which the structure of its residuals is examined."""
AT_BOUND = 1e-3
"""A value is at a bound if the distance of u from the bound, divided by the interval of u, is below this."""


@dataclass(frozen=True)
class FittedValue:
    """A fitted value.

    Attributes:
        key: key of the parameter.
        value: fitted value.
        low: lower end of the 95 % confidence interval; NaN if the value is at a bound.
        high: upper end of the interval; NaN if the value is at a bound.
        bound: `low` or `high` if the value is at this bound; empty otherwise.
    """

    key: str
    value: float
    low: float
    high: float
    bound: str


@dataclass(frozen=True, eq=False)
class Confidence:
    """Confidence in the fitted parameters.

    Attributes:
        estimates: value and interval of each parameter.
        correlations: correlations between the parameters' coordinates u; NaN for a value at its bound.
        loose: one sentence for each combination of parameters that the data do not determine.
    """

    estimates: tuple[FittedValue, ...]
    correlations: NDArray[np.float64]
    loose: tuple[str, ...]


def confidence(problem: FitProblem, solved: Solved) -> Confidence:
    """Return confidence intervals and correlations of the parameters, from the Jacobian J at the solution.

    The covariance of the unknowns is s^2 (J^T J)^-1 with s^2 = 2 cost / (number of values - number of unknowns).
    Parameters at a bound are constants here, not unknowns.
    """
    parameters, count = problem.parameters, len(problem.parameters)
    bounds = [_bound(p, float(u)) for p, u in zip(parameters, solved.unknowns[:count], strict=True)]
    held = np.array([bool(text) for text in bounds] + [False] * (len(solved.unknowns) - count))
    free = np.flatnonzero(~held)
    jacobian = solved.jacobian[:, free]
    values = sum(recording.count for recording in problem.recordings)
    degrees = max(1, values - free.size)
    variance = 2.0 * solved.cost / degrees
    scale = np.linalg.norm(jacobian, axis=0)
    scale[scale == 0.0] = 1.0
    _, singular, rows = np.linalg.svd(jacobian / scale, full_matrices=False)
    kept = np.maximum(singular, 1e-10 * singular.max(initial=1e-300))
    spread = (rows.T / kept) / scale[:, None]
    covariance = variance * spread @ spread.T
    full = np.full((len(held), len(held)), np.nan)
    full[np.ix_(free, free)] = covariance
    deviation = np.sqrt(np.diag(full))
    reach = student.ppf(0.5 + 0.5 * CONFIDENCE, degrees) * deviation
    found = []
    for p, u, half, bound in zip(parameters, solved.unknowns[:count], reach, bounds, strict=False):
        ends = (np.nan, np.nan) if bound else _ends(p, float(u), float(half))
        found.append(FittedValue(p.key, p.value(float(u)), *ends, bound))
    with np.errstate(invalid="ignore"):
        correlations = (full / np.outer(deviation, deviation))[:count, :count]
    own = [place for place in free if place < count]
    loose = _loose([parameters[place].key for place in own], full[np.ix_(own, own)])
    return Confidence(tuple(found), correlations, tuple(loose))


def _bound(parameter: FittedParameter, coordinate: float) -> str:
    low, high = parameter.coordinate(parameter.low), parameter.coordinate(parameter.high)
    near = AT_BOUND * (high - low)
    return "low" if coordinate - low < near else "high" if high - coordinate < near else ""


def _ends(parameter: FittedParameter, coordinate: float, half: float) -> tuple[float, float]:
    """Return the ends of a confidence interval as values of the parameter; they may be beyond the bounds."""
    if parameter.logarithmic:
        half = min(half, 300.0)
        return float(np.exp(coordinate - half)), float(np.exp(coordinate + half))
    width = parameter.high - parameter.low
    return (coordinate - half) * width, (coordinate + half) * width


def _loose(keys: Sequence[str], covariance: NDArray[np.float64]) -> list[str]:
    """Return sentences about the combinations of parameters that the data do not determine."""
    if not keys:
        return []
    variances, directions = np.linalg.eigh(covariance)
    notes = []
    for variance, direction in zip(variances, directions.T, strict=True):
        if np.sqrt(max(variance, 0.0)) > LOOSE:
            parts = [place for place in np.argsort(-np.abs(direction)) if abs(direction[place]) > 0.2]
            named = " and ".join(keys[place] for place in parts)
            text = " separately" if len(parts) > 1 else ""
            notes.append(f"the data do not determine {named}{text}: they hardly depend on it; remedy: fit fewer")
    deviation = np.sqrt(np.diag(covariance))
    with np.errstate(invalid="ignore", divide="ignore"):
        alike = covariance / np.outer(deviation, deviation)
    for i in range(len(keys)):
        for j in range(i):
            if abs(alike[i, j]) > ALIKE and not notes:
                what = "ratio" if alike[i, j] > 0.0 else "product"
                pair = f"{keys[j]} and {keys[i]}"
                notes.append(
                    f"the data hardly determine {pair} separately (correlation {alike[i, j]:.4f}), only about their "
                    f"{what}; remedy: fix one of them, or record a quantity that only one of them changes"
                )
    return notes


def autocorrelation(residual: NDArray[np.float64]) -> float:
    """Return the largest correlation of successive residuals among c columns (m, c); NaN for m below `FEWEST`."""
    found = []
    for column in residual.reshape(residual.shape[0], -1).T:
        sound = column[np.isfinite(column)]
        energy = float(sound @ sound)
        if sound.size >= FEWEST and energy > 0.0:
            found.append(float(sound[1:] @ sound[:-1]) / energy)
    return max(found, default=np.nan)


DECADES = (1, 2, 3)
"""Powers of ten by which `require_bounds` multiplies an upper bound, or divides a lower bound, to try values beyond."""
BETTER = 0.25
"""A bound counts as wrong if, at a value beyond it, the sum of squares is below this fraction of the sum at the bound.
"""


def require_bounds(problem: FitProblem, solved: Solved, known: Confidence) -> None:
    """Check that no fitted parameter lies at a bound beyond which the fit is far better.

    The tried values are some powers of ten beyond the bound (`DECADES`). Parameters whose lower bound is not positive
    are not checked.

    Raises:
        GdfeError: a parameter lies at such a bound; the error names the best of the tried values.
    """
    for place, (parameter, estimate) in enumerate(zip(problem.parameters, known.estimates, strict=True)):
        if not estimate.bound or not parameter.logarithmic:
            continue
        sign = 1.0 if estimate.bound == "high" else -1.0
        tried = [(_cost(problem, solved, place, estimate.value * 10.0 ** (sign * n)), n) for n in DECADES]
        cost, decade = min(tried)
        if cost < BETTER * solved.cost:
            asked = estimate.value * 10.0 ** (sign * decade)
            raise GdfeError(
                f"{parameter.key} ends at its bound {estimate.value:g}, but the data are fitted best by about "
                f"{asked:.1g}, where the misfit is {np.sqrt(solved.cost / cost):.2g} times smaller; remedy: check the "
                "unit (1 MPa is 1.0e6), or give wider bounds"
            )


def _cost(problem: FitProblem, solved: Solved, place: int, value: float) -> float:
    """Return half the sum of squares if the parameter at ``place`` has ``value``, which may be beyond its bound."""
    values = list(solved.point.values)
    values[place] = value
    trajectories = problem.trajectories(tuple(values))
    if any(isinstance(item, NotSimulatedError) for item in trajectories):
        return np.inf
    residual = problem.stack_residuals(trajectories, solved.point.own)
    return 0.5 * float(residual @ residual)


POOR = 0.5
"""Misfit, divided by the measured motion, above which a warning says that the model explains little of the motion."""
WORSE = 1.5
"""A prediction is bad if the held-out recording's misfit exceeds this multiple of the fitted recordings' misfit."""
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
            found.append(Match(recording.name, series.name, held_out, sound.size, *given, autocorrelation(residual)))
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
