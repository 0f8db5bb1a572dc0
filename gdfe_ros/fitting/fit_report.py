# SPDX-License-Identifier: Apache-2.0
"""Output files of a fit: scene, values, table of residuals, picture, HTML page."""

from __future__ import annotations

import csv
import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from gdfe_ros.bounded_text import quoted
from gdfe_ros.fitting.curves import ComparedColumn, curves
from gdfe_ros.fitting.fit import Fit
from gdfe_ros.fitting.fit_page import fit_page

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
                "rms": _plain(match.rms),
                "relative": _plain(match.relative),
                "largest": _plain(match.largest),
                "autocorrelation": _plain(match.autocorrelation),
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
                texts = quoted(curve.recording), quoted(curve.series)
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
