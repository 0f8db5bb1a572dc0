# SPDX-License-Identifier: Apache-2.0
"""``gdfe calibrate``: repeat the calibration of the paper's Sec. 4.2.1 and compare it with Eq. 7."""

from __future__ import annotations

import argparse
from pathlib import Path

from rich.table import Table

from gdfe_ros.analysis.calibration import CalibrationPoint, calibrate
from gdfe_ros.terminal import PlainConsole

NOT_CONVERGED = 3


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("--steps", type=int, default=20, help="number of load steps of each bar (default: 20)")
    parser.add_argument("--picture", type=Path, metavar="FILE.png", help="draw the curve beside Eq. 7")


def run(arguments: argparse.Namespace) -> int:
    """Run the calibration and print its result; return 0, or 3 if a bar did not converge."""
    points = calibrate(arguments.steps)
    PlainConsole().print(_table(points))
    if arguments.picture:
        _draw(arguments.picture, points)
    return 0 if all(point.converged for point in points) else NOT_CONVERGED


def _table(points: list[CalibrationPoint]) -> Table:
    table = Table(title="Sec. 4.2.1: bar 4:1:1, stretched by 100 %, ratio right to left", title_justify="left")
    for head in ("R_G", "R_M by Eq. 7", "mean eps_eq", "strain energy", "converged"):
        table.add_column(head, justify="right")
    for point in points:
        values = f"{point.geometric:g}", f"{point.published:.2f}", f"{point.strain:.2f}", f"{point.energy:.2f}"
        table.add_row(*values, "yes" if point.converged else "no")
    return table


def _draw(path: Path, points: list[CalibrationPoint]) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 4.5), dpi=150, layout="constrained")
    axes = figure.subplots()
    ratios = [point.geometric for point in points]
    axes.loglog(ratios, [point.published for point in points], "k--", label="Eq. 7 (paper)")
    axes.loglog(ratios, [point.strain for point in points], "o-", color="#1b6ca8", label="ours, mean eps_eq")
    axes.loglog(ratios, [point.energy for point in points], "s-", color="#d1495b", label="ours, strain energy")
    axes.set_xlabel("ratio of shape factors R_G")
    axes.set_ylabel("ratio of stiffness R_M")
    axes.grid(visible=True, which="both", color="0.92")
    axes.legend(frameon=False)
    figure.savefig(path)
