# SPDX-License-Identifier: Apache-2.0
"""Picture of the torture test: every case is a point at its error divided by its bound."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from benchmarks.torture.case import Group, Outcome, Verdict
from benchmarks.torture.score import Score

COLOURS = {
    Verdict.CONVERGED: "#1b6ca8",
    Verdict.REPORTED: "#edae49",
    Verdict.REFUSED: "#9a8c98",
    Verdict.FAILED: "#d1495b",
}
WORDS = {
    Verdict.CONVERGED: "converged",
    Verdict.REPORTED: "not converged, and says why",
    Verdict.REFUSED: "refused by name",
    Verdict.FAILED: "failed",
}
FOOT, WITHOUT = 1e-8, 1e-10
"""Lowest drawn height of an error, and height of outcomes without an error."""


def draw_scores(path: Path, scores: Sequence[Score]) -> None:
    """Draw error / bound for every case of each group; cases without an error are below the lower line."""
    figure = Figure(figsize=(11.0, 5.2), dpi=150, layout="constrained")
    axes = figure.add_subplot()
    for column, group in enumerate(Group):
        own = sorted((score.outcome for score in scores if score.group is group), key=_order)
        heights = np.array([_height(outcome) for outcome in own])
        axes.scatter(
            column + _spread(heights),
            heights,
            s=16,
            c=[COLOURS[outcome.verdict] for outcome in own],
            alpha=0.75,
            linewidths=0,
        )
    for verdict, colour in COLOURS.items():
        count = sum(score.outcome.verdict is verdict for score in scores)
        axes.scatter([], [], s=24, c=colour, label=f"{count} {WORDS[verdict]}")
    axes.axhline(1.0, color="#d1495b", linewidth=1.2)
    axes.text(len(Group) - 0.45, 1.4, "bound", color="#d1495b", ha="right", fontsize=9)
    axes.axhline(0.3 * FOOT, color="0.8", linewidth=0.8)
    axes.set(yscale="log", ylim=(0.02 * WITHOUT, 30.0), xlim=(-0.6, len(Group) - 0.4))
    axes.set_ylabel("error over its bound", fontsize=9)
    axes.set_yticks([WITHOUT, *(10.0**power for power in range(-8, 1, 2))])
    axes.set_yticklabels(["no error\nto compare", *(f"1e{power}" for power in range(-8, 0, 2)), "1"], fontsize=8)
    axes.set_xticks(range(len(Group)), [group.value for group in Group], fontsize=9)
    axes.set_title(f"{len(scores)} torments", loc="left", fontsize=11)
    axes.legend(fontsize=9, frameon=False, ncols=4, loc="upper right", bbox_to_anchor=(1.0, 1.09))
    axes.grid(visible=True, axis="y", color="0.93")
    axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path)


def _height(outcome: Outcome) -> float:
    share = outcome.error / outcome.bound if outcome.bound > 0.0 and math.isfinite(outcome.bound) else math.nan
    return max(share, FOOT) if math.isfinite(share) else WITHOUT


def _order(outcome: Outcome) -> tuple[float, str]:
    return _height(outcome), outcome.verdict.value


def _spread(heights: np.ndarray) -> np.ndarray:
    """Return the horizontal offsets (k,) of points in their column, so that points of similar height do not overlap."""
    offsets, rows = np.zeros(len(heights)), np.round(3.0 * np.log10(np.maximum(heights, WITHOUT)))
    for row in np.unique(rows):
        own = np.flatnonzero(rows == row)
        width = min(0.45, 0.02 * len(own))
        offsets[own] = np.linspace(-width, width, len(own)) if len(own) > 1 else 0.0
    return offsets
