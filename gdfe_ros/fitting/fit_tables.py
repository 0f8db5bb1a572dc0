# SPDX-License-Identifier: Apache-2.0
"""Results of a fit as rows of text."""

from __future__ import annotations

import numpy as np

from gdfe_ros.fitting.fit import Fit
from gdfe_ros.fitting.verdict import percent
from gdfe_ros.scene.report import unit_of

NOT_INCLUDED = "The intervals do not include the error of the mesh; repeat the fit with twice as many cells to see it."
"""What a reader of the intervals has to know."""


def parameter_rows(fit: Fit) -> list[tuple[str, str, str, str]]:
    """Return a row for each parameter: key, value with unit, 95 % interval, correlations with the ones above it."""
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
    pairs = [(fit.problem, fit.solved.point)]
    if fit.held_out is not None:
        pairs.append((fit.held_out, fit.prediction))
    rows = []
    for problem, point in pairs:
        for recording, own in zip(problem.recordings, point.own, strict=True):
            rest = list(own)
            words = []
            if recording.shift_between is not None:
                words.append(f"time shift {1e3 * rest.pop(0):.3g} ms")
            if recording.frame == 6:
                words.append(f"rotation vector {_three(rest[:3])} rad")
            if recording.frame:
                words.append(f"translation {_three(rest[-3:])} m")
            if words:
                rows.append((recording.name, ", ".join(words)))
    return rows


def _three(values: list[float]) -> str:
    return "(" + ", ".join(f"{value:.4g}" for value in values) + ")"
