# SPDX-License-Identifier: Apache-2.0
"""Pictures of recorded and simulated curves, a panel for each test."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

Curve = tuple[Sequence[float], Sequence[float], Mapping[str, Any]]
"""Abscissas, ordinates, and keyword arguments of ``plot``."""
POINTS = {"ls": "", "marker": ".", "color": "#6b6f76"}
"""Looks of recorded points."""


def draw_panels(path: Path, panels: Mapping[str, Sequence[Curve]], *, x: str, y: str, columns: int) -> None:
    """Draw the curves of each panel under its title; ``x`` and ``y`` are the labels of all axes."""
    rows = -(-len(panels) // columns)
    figure = Figure(figsize=(max(4.5 * columns, 8.0), 2.6 * rows), dpi=110, layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for axis, (title, curves) in zip(axes, panels.items(), strict=False):
        for across, along, looks in curves:
            axis.plot(across, along, **looks)
        axis.set_title(title, loc="left", fontsize=9)
        axis.grid(color="0.92")
        if any("label" in looks for *_, looks in curves):
            axis.legend(fontsize=7, frameon=False)
    for axis in axes[len(panels) :]:
        axis.set_axis_off()
    figure.supxlabel(x, fontsize=9)
    figure.supylabel(y, fontsize=9)
    figure.savefig(path)
