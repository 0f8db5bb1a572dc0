# SPDX-License-Identifier: Apache-2.0
"""Pictures of run time against error, with the Pareto front of each solver."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from benchmarks.cases import CaseName
from benchmarks.peers.peer import PeerResult
from benchmarks.tables import NAMES

COLOURS = {"gdfe_ros": "#1b6ca8", "FElupe": "#d1495b", "CalculiX": "#66a182", "MuJoCo": "#edae49"}
Point = tuple[float, float]
"""Error [%] and time of a run."""


def draw_fronts(path: Path, results: Sequence[PeerResult]) -> None:
    """Draw solve time against mean nodal error of every cold run."""
    figure = Figure(figsize=(11.0, 6.4), dpi=150, layout="constrained")
    for axes, name in zip(figure.subplots(2, 2).ravel(), CaseName, strict=True):
        points: dict[str, list[Point]] = {}
        for each in results:
            if each.scene == name.value and not each.mesh.endswith("relative"):
                points.setdefault(NAMES[each.solver], []).append((100 * each.mean_error, 1e3 * each.time_solve))
        draw_front(axes, points)
        axes.set_title(name.value, loc="left", fontsize=10)
        axes.set(xlabel="mean nodal error [%]", ylabel="solve time, 1 thread [ms]")
    figure.axes[0].legend(fontsize=9, frameon=False)
    figure.savefig(path)


def draw_front(axes: Axes, points: Mapping[str, Iterable[Point]]) -> None:
    """Draw the runs of each solver; a line is its front."""
    for solver, own in points.items():
        for marked, style in ((own, {"ls": "", "alpha": 0.4}), (front(own), {"label": solver})):
            axes.loglog(*zip(*marked, strict=True), marker="o", ms=5, color=COLOURS[solver], **style)
    axes.grid(visible=True, which="both", color="0.92")


def front(points: Iterable[Point]) -> list[Point]:
    """Return the Pareto-optimal runs, by ascending error: no other run is better in both time and error."""
    best: list[Point] = []
    for point in sorted(points):
        if not best or point[1] < best[-1][1]:
            best.append(point)
    return best
