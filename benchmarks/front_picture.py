# SPDX-License-Identifier: Apache-2.0
"""Picture of run time against error, with the Pareto front of each solver."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure

from benchmarks.cases import CaseName
from benchmarks.peers.peer import PeerResult, Solver
from benchmarks.tables import NAMES

COLOURS = {Solver.GDFE: "#1b6ca8", Solver.FELUPE: "#d1495b", Solver.CALCULIX: "#66a182", Solver.MUJOCO: "#edae49"}


def draw_front(path: Path, results: Sequence[PeerResult]) -> None:
    """Draw solve time against mean nodal error of every cold run; a line is the front of a solver."""
    figure = Figure(figsize=(11.0, 6.4), dpi=150, layout="constrained")
    axes = figure.subplots(2, 2).ravel()
    for axis, name in zip(axes, CaseName, strict=True):
        for solver in Solver:
            here = [item for item in results if item.solver is solver and item.scene == name.value]
            here = [item for item in here if not item.mesh.endswith("relative")]
            if not here:
                continue
            colour = COLOURS[solver]
            axis.loglog(
                [100 * i.mean_error for i in here],
                [1e3 * i.time_solve for i in here],
                "o",
                ms=4,
                color=colour,
                alpha=0.4,
            )
            best = front(here)
            axis.loglog(
                [100 * i.mean_error for i in best],
                [1e3 * i.time_solve for i in best],
                "o-",
                ms=5,
                color=colour,
                label=NAMES[solver],
            )
        axis.set_title(name.value, loc="left", fontsize=10)
        axis.grid(visible=True, which="both", color="0.92")
        axis.set_xlabel("mean nodal error [%]", fontsize=9)
        axis.set_ylabel("solve time, 1 thread [ms]", fontsize=9)
    axes[0].legend(fontsize=9, frameon=False)
    figure.savefig(path)


def front(results: Sequence[PeerResult]) -> list[PeerResult]:
    """Return the Pareto-optimal runs, by ascending error: no other run is better in both time and error."""
    best: list[PeerResult] = []
    for result in sorted(results, key=lambda item: (item.mean_error, item.time_solve)):
        if not best or result.time_solve < best[-1].time_solve:
            best.append(result)
    return best
