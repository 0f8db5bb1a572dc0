# SPDX-License-Identifier: Apache-2.0
"""The least-squares problem of a fit: unknowns, residuals, derivatives, and the search over growing horizons."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from gdfe_ros.errors import GdfeError
from gdfe_ros.fitting.comparison import Own, first_own, residuals
from gdfe_ros.fitting.fitted_parameter import FittedParameter
from gdfe_ros.fitting.recording import POSITIONS, Recording
from gdfe_ros.fitting.trajectory import (
    NotSimulatedError,
    Simulations,
    Trajectory,
    require_simulated,
    trajectory_columns,
)

SHARE = 0.01
"""Assumed standard deviation of a series that states none, divided by the largest range of the series with its unit."""
NUDGE = {"shift": 1e-5, "turn": 1e-5, "translation": 1e-6}
"""Change of a recording's unknown in a finite difference [s], [rad], [m]; no simulation is needed for it."""
LARGEST_POSITION = 20.0
"""Largest plausible distance of a position from the origin [body lengths]; beyond it, unit or origin is wrong."""
FAILED = 1e3
"""Residual of every value of a trial that cannot be simulated, so that the search rejects the trial."""


@dataclass(frozen=True, eq=False)
class FitPoint:
    """Simulations of all recordings at given unknowns.

    Attributes:
        values: values of the parameters.
        own: unknowns of each recording.
        trajectories: simulated trajectory of each recording.
    """

    values: tuple[float, ...]
    own: tuple[Own, ...]
    trajectories: tuple[Trajectory, ...]


class FitProblem:
    """Residuals of recordings as functions of parameters.

    The unknowns are the coordinates u of the parameters, then the unknowns of each recording: time shift and frame.

    Args:
        simulations: object that runs the simulations.
        parameters: parameters to fit.
        recordings: recordings to fit.
        quads: faces (f, 4) of the body's surface, with which clouds are compared.

    Attributes:
        sigmas: standard deviation of each series of each recording (`standard_deviations`).
        horizons: for each recording, the simulation time [s] up to which it is compared.
    """

    def __init__(
        self,
        simulations: Simulations,
        parameters: Sequence[FittedParameter],
        recordings: Sequence[Recording],
        *,
        quads: NDArray[np.int32],
    ) -> None:
        self.parameters, self.recordings = tuple(parameters), tuple(recordings)
        self._simulations, self._quads = simulations, quads
        self.sigmas = standard_deviations(recordings)
        self.horizons = [np.inf] * len(self.recordings)
        self._known: tuple[tuple[object, ...], list[Trajectory | NotSimulatedError]] | None = None

    def look_to(self, share: float) -> None:
        """Compare only the first fraction ``share`` of each recording's time; 1 compares all of it."""
        ends = [max(series.times[-1] for series in recording.series) for recording in self.recordings]
        self.horizons = [np.inf if share >= 1.0 else share * end for end in ends]
        self._known = None

    def bounds(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the lower and the upper bounds (u,) of the unknowns."""
        low = [parameter.coordinate(parameter.low) for parameter in self.parameters]
        high = [parameter.coordinate(parameter.high) for parameter in self.parameters]
        for recording in self.recordings:
            shift = [recording.shift_between] if recording.shift_between is not None else []
            ends = [*shift, *([(-np.inf, np.inf)] * recording.frame)]
            low += [end[0] for end in ends]
            high += [end[1] for end in ends]
        return np.array(low), np.array(high)

    def first(self) -> NDArray[np.float64]:
        """Return the initial unknowns (u,): parameters, time shifts within their bounds, and the best-fitting frames.

        Raises:
            NotSimulatedError: the initial parameters cannot be simulated.
            GdfeError: a frame is fitted, and the recording has no positions of known points.
        """
        values = tuple(parameter.start for parameter in self.parameters)
        trajectories = self.trajectories(values)
        for item in trajectories:
            if isinstance(item, NotSimulatedError):
                remedy = "another START in --vary KEY=LOW..START..HIGH; check its unit (1 MPa is 1.0e6)"
                raise NotSimulatedError(f"the search cannot begin: {item}; remedy: {remedy}")
        own = [first_own(recording, item) for recording, item in zip(self.recordings, trajectories, strict=True)]
        coordinates = [p.coordinate(value) for p, value in zip(self.parameters, values, strict=True)]
        return np.concatenate([coordinates, *own])

    def values(self, unknowns: NDArray[np.float64]) -> tuple[float, ...]:
        """Return the parameters' values at given unknowns."""
        return self._split(unknowns)[0]

    def point(self, unknowns: NDArray[np.float64]) -> FitPoint:
        """Simulate all recordings at given unknowns.

        Raises:
            NotSimulatedError: a recording cannot be simulated.
        """
        values, own = self._split(unknowns)
        return FitPoint(values, own, tuple(require_simulated(self.trajectories(values))))

    def trajectories(self, values: tuple[float, ...]) -> list[Trajectory | NotSimulatedError]:
        """Return the simulation of each recording with given values, or its error; the last result is cached."""
        key = (values, tuple(self.horizons))
        if self._known is None or self._known[0] != key:
            given = {p.key: value for p, value in zip(self.parameters, values, strict=True)}
            tasks = [(given, *pair) for pair in zip(self.recordings, self.horizons, strict=True)]
            self._known = (key, self._simulations.run(tasks))
        return self._known[1]

    def residuals(self, unknowns: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return (simulated - measured) / sigma of all values in one vector; 0 for values that are not compared.

        If a recording cannot be simulated, every residual is `FAILED`.
        """
        values, own = self._split(unknowns)
        found = self.trajectories(values)
        if any(isinstance(item, NotSimulatedError) for item in found):
            count = sum(series.values[..., 0].size if series.values.ndim == 3 else series.values.size
                        for recording in self.recordings for series in recording.series)  # fmt: skip
            return np.full(count, FAILED)
        return self.stack_residuals(found, own)

    def jacobian(self, unknowns: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return d(residual)/d(unknown), shape (values, unknowns)."""
        here = self.point(unknowns)
        base = self.stack_residuals(here.trajectories, here.own)
        given = self._simulations, self.recordings, self.parameters, here.values, here.trajectories
        changes = trajectory_columns(*given, horizons=self.horizons)
        columns = []
        for change in changes:
            moved = [item.move_along(by, 1e-3) for item, by in zip(here.trajectories, change, strict=True)]
            columns.append((self.stack_residuals(moved, here.own) - base) / 1e-3)
        for place, recording in enumerate(self.recordings):
            for entry, size in enumerate(_nudges(recording)):
                own = [item.copy() for item in here.own]
                own[place][entry] += size
                columns.append((self.stack_residuals(here.trajectories, own) - base) / size)
        return np.stack(columns, axis=1)

    def series_residuals(self, point: FitPoint) -> list[list[NDArray[np.float64]]]:
        """Return (simulated - measured) / sigma for each recording and series; NaN for values that are not compared."""
        given = zip(self.recordings, point.trajectories, point.own, self.sigmas, self.horizons, strict=True)
        return [
            residuals(recording, trajectory, own, sigmas, quads=self._quads, horizon=horizon)
            for recording, trajectory, own, sigmas, horizon in given
        ]

    def stack_residuals(self, trajectories: Sequence[Trajectory], own: Sequence[Own]) -> NDArray[np.float64]:
        """Return the residuals of given trajectories in one vector; 0 for values that are not compared."""
        parts = self.series_residuals(FitPoint((), tuple(own), tuple(trajectories)))
        return np.nan_to_num(np.concatenate([part.ravel() for found in parts for part in found]), nan=0.0)

    def _split(self, unknowns: NDArray[np.float64]) -> tuple[tuple[float, ...], tuple[Own, ...]]:
        count = len(self.parameters)
        values = tuple(p.value(float(u)) for p, u in zip(self.parameters, unknowns[:count], strict=True))
        ends = count + np.cumsum([recording.unknowns for recording in self.recordings])
        return values, tuple(
            unknowns[end - recording.unknowns : end] for recording, end in zip(self.recordings, ends, strict=True)
        )


def standard_deviations(recordings: Sequence[Recording]) -> list[list[float]]:
    """Return the standard deviation of each series: its stated one, else `SHARE` times a range.

    The range is the largest range of all series with the same unit. If all these series are constant, their largest
    magnitude is used instead.
    """
    every = [series for recording in recordings for series in recording.series]
    units = {series.observable.unit for series in every}
    alike = {unit: [series for series in every if series.observable.unit == unit] for unit in units}
    spans = {
        unit: max(series.span for series in group) or max(series.largest for series in group)
        for unit, group in alike.items()
    }
    return [[series.sigma or SHARE * spans[series.observable.unit] for series in item.series] for item in recordings]


def require_motion(recording: Recording, size: float) -> None:
    """Check that the measured values of a recording change and are plausible.

    Args:
        recording: recording to fit.
        size: size of the body [m].

    Raises:
        GdfeError: all values are missing, do not change, or are so large that their unit must be wrong.
    """
    for series in recording.series:
        where = f"recording {recording.name}, {series.name}"
        finite = series.values[np.isfinite(series.values)]
        if not finite.size:
            raise GdfeError(f"{where}: all values are missing")
        still = series.span == 0.0 if series.values.shape[0] > 1 else not finite.any()
        if still:
            raise GdfeError(
                f"{where}: the data do not move: every value is {finite[0]:g}; nothing can be fitted to them"
            )
        if series.observable.kind not in POSITIONS or recording.frame:
            continue
        if np.abs(finite).max() > LARGEST_POSITION * size:
            raise GdfeError(
                f"{where}: values up to {np.abs(finite).max():.4g} m, and the body is {size:.3g} m long; remedy: "
                "`unit: mm` in the match file, `tip.x [mm]` in the header, or `frame: {}` for another origin"
            )


def _nudges(recording: Recording) -> list[float]:
    shift = [NUDGE["shift"]] if recording.shift_between is not None else []
    turn = [NUDGE["turn"]] * 3 if recording.frame == 6 else []
    return [*shift, *turn, *([NUDGE["translation"]] * 3 if recording.frame else [])]


HORIZONS = (1 / 16, 1 / 4, 1.0)
"""Fractions of a motion's duration that are fitted one after the other. The misfit over the whole motion has local
minima at which a simulated oscillation is off by whole periods; the misfit over the first oscillation has none.
"""
STEP = 1e-5
"""Relative change of the unknowns, or of the sum of squares, at which a search ends."""
COARSE = 0.01
"""Relative change of the sum of squares at which a search ends, if a search with a longer horizon follows."""
MOST_TRIALS = 60
SILENT = 1e-3
"""A parameter has no influence if the root mean square of d(residual)/du is below this. At this limit, a change of u by
1 changes the simulated values by a thousandth of the measured values' standard deviation.
"""


@dataclass(frozen=True, eq=False)
class Solved:
    """Solution of a search.

    Attributes:
        unknowns: unknowns found (u,).
        jacobian: d(residual)/d(unknown) at these unknowns, (values, unknowns), weighted by the loss.
        cost: half the sum of squares of the residuals, or of their loss.
        point: simulations at these unknowns.
    """

    unknowns: NDArray[np.float64]
    jacobian: NDArray[np.float64]
    cost: float
    point: FitPoint


def solve(
    problem: FitProblem, *, moves: bool, loss: str = "linear", report: Callable[[str], None] | None = None
) -> Solved:
    """Minimise the sum of squares, or of a robust loss, of the residuals.

    Args:
        problem: problem with the residuals.
        moves: whether the scene has dynamics; then the horizon grows from search to search.
        loss: loss of scipy's `least_squares`.
        report: function that is called with a line of text after each search.

    Raises:
        GdfeError: the initial values cannot be simulated, or a parameter has no influence.
    """
    low, high = problem.bounds()
    shares = HORIZONS if moves else (1.0,)
    framed = any(recording.frame for recording in problem.recordings)
    problem.look_to(1.0 if framed else shares[0])
    unknowns = problem.first()
    _require_influence(problem, unknowns)
    for share in shares:
        problem.look_to(share)
        last = share == 1.0
        accuracy = {
            "xtol": STEP,
            "ftol": STEP if last else COARSE,
            "gtol": None,
            "max_nfev": MOST_TRIALS if last else 15,
        }
        result = least_squares(
            problem.residuals,
            np.clip(unknowns, low, high),
            problem.jacobian,
            bounds=(low, high),
            x_scale="jac",
            loss=loss,
            **accuracy,
        )
        unknowns = result.x
        if report is not None:
            report(_line(problem, unknowns, share, result.nfev))
    return Solved(unknowns, result.jac, float(result.cost), problem.point(unknowns))


def _line(problem: FitProblem, unknowns: NDArray[np.float64], share: float, trials: int) -> str:
    pairs = zip(problem.parameters, problem.values(unknowns), strict=True)
    values = ", ".join(f"{parameter.key} = {value:.5g}" for parameter, value in pairs)
    return f"{100.0 * share:.3g} % of the time, {trials} trials: {values}"


def _require_influence(problem: FitProblem, unknowns: NDArray[np.float64]) -> None:
    """Raise GdfeError if a parameter has no influence, neither up to the horizons nor on whole recordings."""
    silent = _silent(problem, unknowns)
    if silent:
        problem.look_to(1.0)
        silent = _silent(problem, unknowns)
    if silent:
        raise GdfeError(
            f"{', '.join(silent)}: no influence on the measured values; remedy: leave it out of --vary, or record a "
            "quantity that it changes (damping shows in motion, density under gravity, a modulus where forces act)"
        )


def _silent(problem: FitProblem, unknowns: NDArray[np.float64]) -> list[str]:
    jacobian = problem.jacobian(unknowns)[:, : len(problem.parameters)]
    influence = np.sqrt((jacobian**2).mean(axis=0))
    return [p.key for p, size in zip(problem.parameters, influence, strict=True) if size < SILENT]
