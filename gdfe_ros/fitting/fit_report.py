# SPDX-License-Identifier: Apache-2.0
"""Output of a fit: rows of text, scene, values, table of residuals, picture, HTML page."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from gdfe_ros.analysis.report.charts import numbers_of
from gdfe_ros.analysis.report.template import build_page, tabulate
from gdfe_ros.errors import show_point
from gdfe_ros.fitting.comparison import predict_series, split
from gdfe_ros.fitting.fit import Fit
from gdfe_ros.fitting.problem import FitPoint, FitProblem
from gdfe_ros.fitting.recording import ROW
from gdfe_ros.fitting.statistics import percent
from gdfe_ros.scene.report import unit_of
from gdfe_ros.untrusted.bounded_text import quote_formula

RESIDUAL = "residual: simulated - measured"


def fit_page(fit: Fit, shown: Sequence[ComparedColumn]) -> str:
    """Return the HTML text of a fit's page; ``shown`` are the columns that have charts."""
    return build_page(
        title=f"{fit.scene.name}, fitted",
        description=fit.scene.description,
        tables=[
            tabulate("Parameters", parameter_rows(fit), ("key", "value", "95 % interval", "correlations")),
            tabulate("Recordings", match_rows(fit), ("recording", "series", "", "values", "misfit", "of the motion")),
            *([tabulate("Warnings", [("", text) for text in fit.warnings])] if fit.warnings else []),
        ],
        charts=[_chart(curve) for curve in shown],
        remarks=[NOT_INCLUDED],
    )


def _chart(curve: ComparedColumn) -> dict[str, Any]:
    """Return a chart of measured and simulated values over time, with the residual below."""
    times = numbers_of(curve.times)
    word = "predicted" if curve.held_out else "fitted"
    traces = [
        {"x": times, "y": numbers_of(curve.measured), "name": "measured", "mode": "markers", "marker": {"size": 4}},
        {"x": times, "y": numbers_of(curve.simulated), "name": word, "mode": "lines"},
        {
            "x": times,
            "y": numbers_of(curve.simulated - curve.measured),
            "name": RESIDUAL,
            "yaxis": "y2",
            "mode": "lines",
        },
    ]
    unit = f" [{curve.unit}]" if curve.unit else ""
    ticks = {"tick0": 0, "dtick": max(1, len(times) // 10)} if curve.over == ROW else {}
    numbers = {"exponentformat": "e", "automargin": True}
    layout = {
        "margin": {"l": 84, "r": 10, "t": 6, "b": 40},
        "xaxis": {"anchor": "y2", "title": {"text": curve.over}} | ticks,
        "yaxis": {"domain": [0.36, 1.0], "title": {"text": f"{curve.series}{unit}", "standoff": 10}} | numbers,
        "yaxis2": {"domain": [0.0, 0.28], "title": {"text": f"residual{unit}", "standoff": 10}, "nticks": 4} | numbers,
        "legend": {"orientation": "h", "y": 1.02, "yanchor": "bottom"},
    }
    return {"title": f"{curve.series} of recording {curve.recording} ({word})", "data": traces, "layout": layout}


NOT_INCLUDED = "The intervals do not include the error of the mesh; repeat the fit with twice as many cells to see it."
"""Remark below the confidence intervals."""


def parameter_rows(fit: Fit) -> list[tuple[str, str, str, str]]:
    """Return a row for each parameter: key, value with unit, 95 % interval, correlations with the parameters above."""
    rows = []
    for place, item in enumerate(fit.known.estimates):
        interval = f"at its bound ({item.bound})" if item.bound else f"{item.low:.7g} to {item.high:.7g}"
        above = fit.known.correlations[place][:place]
        correlations = "  ".join("-" if np.isnan(value) else f"{value:+.2f}" for value in above)
        rows.append((item.key, f"{item.value:.7g} {unit_of(item.key)}".rstrip(), interval, correlations))
    return rows


def match_rows(fit: Fit) -> list[tuple[str, str, str, str, str, str]]:
    """Return a row for each series: recording, series, fitted or predicted, value count, misfit, misfit / motion."""
    return [
        (
            match.recording,
            match.series,
            "predicted" if match.held_out else "fitted",
            str(match.count),
            f"{match.rms:.3g} {match.unit}".rstrip(),
            percent(match.relative),
        )
        for match in fit.matches
    ]


def own_rows(fit: Fit) -> list[tuple[str, str]]:
    """Return a row for each recording with a fitted time shift or frame: its name, and a text with the values."""
    rows = []
    for problem, point in _parts(fit):
        for recording, own in zip(problem.recordings, point.own, strict=True):
            shift, pose = split(recording, own)
            words = [f"time shift {1e3 * shift:.3g} ms"] if recording.shift_between is not None else []
            if recording.frame == 6:
                words.append(f"rotation vector {show_point(pose[0].as_rotvec())} rad")
            if pose is not None:
                words.append(f"translation {show_point(pose[1])} m")
            if words:
                rows.append((recording.name, ", ".join(words)))
    return rows


@dataclass(frozen=True, eq=False)
class ComparedColumn:
    """One measured column with the simulated values.

    Attributes:
        recording: name of the recording.
        series: name of the series, with the column's label.
        unit: SI unit of the values.
        held_out: whether its recording was only predicted, not fitted.
        times: (m,) times [s] on the recording's clock, or row numbers of a file without times.
        measured: measured values (m,).
        simulated: simulated values (m,).
        over: which of both, as in `Recording.over`.
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
    return [column for problem, point in _parts(fit) for column in _curves(problem, point, problem is fit.held_out)]


def _parts(fit: Fit) -> list[tuple[FitProblem, FitPoint]]:
    """Return pairs of problem and solution: one of the fitted recordings, and one of held-out recordings if any."""
    held_out = [(fit.held_out, fit.prediction)] if fit.held_out is not None else []
    return [(fit.problem, fit.solved.point), *held_out]


def _curves(problem: FitProblem, point: FitPoint, held_out: bool) -> Iterator[ComparedColumn]:
    parts = problem.series_residuals(point)
    for number, recording in enumerate(problem.recordings):
        values = predict_series(recording, point.trajectories[number], point.own[number])
        for place, series in enumerate(recording.series):
            make = partial(
                ComparedColumn,
                recording=recording.name,
                unit=series.observable.unit,
                held_out=held_out,
                times=series.times,
                over=recording.over,
            )
            if len(series.labels) != series.values.shape[-1] or series.values.ndim == 3:
                distance = _distance(parts[number][place] * problem.sigmas[number][place])
                yield make(series=f"{series.name}, distance", measured=np.zeros(distance.size), simulated=distance)
                continue
            for column, label in enumerate(series.labels):
                name = f"{series.name}.{label}" if label else series.name
                yield make(series=name, measured=series.values[:, column], simulated=values[place][:, column])


def _distance(residual: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the root mean square (m,) of the residuals at each time; missing values (NaN) are ignored."""
    flat = residual.reshape(residual.shape[0], -1)
    return np.sqrt(np.nanmean(flat**2, axis=1))


MOST_DRAWN = 12
"""Largest number of columns in the picture: those with the largest motion. The HTML page has all columns."""
SCENE, VALUES, RESIDUALS, PICTURE, PAGE = "scene.yaml", "fit.json", "residuals.csv", "fit.png", "fit.html"


def write_fit(out: Path, fit: Fit) -> list[Path]:
    """Write the files of a fit into a directory, which is created if it does not exist; return their paths.

    Raises:
        OSError: a file cannot be written.
    """
    out.mkdir(parents=True, exist_ok=True)
    shown = curves(fit)
    paths = [out / name for name in (SCENE, VALUES, RESIDUALS, PICTURE, PAGE)]
    scene, values, residuals, picture, page = paths
    scene.write_text(fit.scene.source, encoding="utf-8")
    values.write_text(json.dumps(_numbers(fit), indent=1), encoding="utf-8")
    _write_residuals(residuals, shown)
    _draw(picture, shown, title=fit.scene.name)
    page.write_text(fit_page(fit, shown), encoding="utf-8")
    return paths


def _numbers(fit: Fit) -> dict[str, object]:
    """Return values, intervals, correlations and misfits as plain data; numbers that are not finite become null."""
    return {
        "scene": fit.scene.name,
        "parameters": {
            item.key: {"value": item.value, "low": _plain(item.low), "high": _plain(item.high), "bound": item.bound}
            for item in fit.known.estimates
        },
        "correlations": [[_plain(value) for value in row] for row in fit.known.correlations],
        "recordings": [
            {
                "recording": match.recording,
                "series": match.series,
                "held_out": match.held_out,
                "values": match.count,
                **{key: _plain(getattr(match, key)) for key in ("rms", "relative", "largest", "autocorrelation")},
            }
            for match in fit.matches
        ],
        "warnings": list(fit.warnings),
        "simulations": fit.simulations,
    }


def _plain(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _write_residuals(path: Path, shown: Sequence[ComparedColumn]) -> None:
    """Write a row for each measured value, in SI units."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        over = " or ".join(dict.fromkeys(curve.over for curve in shown))
        writer.writerow(["recording", "series", "held_out", over, "measured", "simulated", "residual", "unit"])
        for curve in shown:
            for time, measured, simulated in zip(curve.times, curve.measured, curve.simulated, strict=True):
                numbers = (f"{value:.9g}" for value in (time, measured, simulated, simulated - measured))
                texts = quote_formula(curve.recording), quote_formula(curve.series)
                writer.writerow([*texts, int(curve.held_out), *numbers, curve.unit])


def _draw(path: Path, shown: Sequence[ComparedColumn], *, title: str) -> None:
    """Draw measured and simulated values over time, one diagram per column."""
    order = sorted(range(len(shown)), key=lambda place: -float(np.nanmax(np.abs(_moves(shown[place])))))
    chosen = [shown[place] for place in sorted(order[:MOST_DRAWN])]
    figure = Figure(figsize=(9.0, 1.0 + 1.9 * len(chosen)), dpi=110, layout="constrained")
    for axes, curve in zip(np.atleast_1d(figure.subplots(len(chosen), 1)), chosen, strict=True):
        axes.plot(curve.times, curve.measured, ".", ms=3.5, color="#6b6f76", label="measured")
        colour = "#c2562d" if curve.held_out else "#1b6ca8"
        label = "predicted" if curve.held_out else "fitted"
        axes.plot(curve.times, curve.simulated, color=colour, lw=1.2, label=label)
        axes.set_title(f"{curve.series} of recording {curve.recording}", loc="left", fontsize=9)
        axes.set_ylabel(f"{curve.series} [{curve.unit}]" if curve.unit else curve.series, fontsize=8)
        axes.tick_params(labelsize=7)
        axes.grid(color="0.93")
        axes.legend(frameon=False, fontsize=7, ncols=2, loc="upper right")
    figure.supxlabel(", ".join(dict.fromkeys(f"{curve.over} of the recording" for curve in chosen)), fontsize=8)
    figure.suptitle(title, fontsize=11)
    figure.savefig(path)


def _moves(curve: ComparedColumn) -> np.ndarray:
    return curve.measured - np.nanmean(curve.measured) + 1e-30
