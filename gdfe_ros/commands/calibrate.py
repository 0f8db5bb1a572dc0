# SPDX-License-Identifier: Apache-2.0
"""``gdfe calibrate``: repeat the calibration of the paper's Sec. 4.2.1 and compare it with Eq. 7.

Bars whose halves have different shape factors are stretched by 100 %.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.table import Table
from scipy.optimize import brentq

from gdfe_ros.paper.shape_factor import CALIBRATED_TO, geometric_ratio
from gdfe_ros.scene import load_scene
from gdfe_ros.simulation import Simulation
from gdfe_ros.untrusted.terminal import PlainConsole, make_table

LEFT = 0.9
"""Shape factor of the left half; the right half has ``LEFT`` / R_G."""
RATIOS = (1.0, 2.0, 5.0, 10.0, 20.0, 30.0, 60.0, CALIBRATED_TO)


@dataclass(frozen=True)
class CalibrationPoint:
    """Result for one bar: the stiffness ratio that results from a ratio of shape factors.

    Attributes:
        geometric: R_G, ratio of the shape factors.
        published: R_M, the ratio of the moduli that Eq. 7 assigns to R_G.
        strain: mean eps_eq of the right half, divided by that of the left half.
        energy: mean 1/2 eps_eq^2 of the right half, divided by that of the left half. For equal moduli this is the
            ratio of the strain energies.
        converged: whether every load step converged.
    """

    geometric: float
    published: float
    strain: float
    energy: float
    converged: bool


def calibrate(steps: int) -> list[CalibrationPoint]:
    """Return the result of a bar for each of ``RATIOS``, stretched in ``steps`` steps with the ``relative`` policy."""
    return [_point(ratio, steps) for ratio in RATIOS]


def find_published_ratio(geometric: float) -> float:
    """Return the ratio of moduli R_M that Eq. 7 assigns to a ratio of shape factors R_G >= 1.

    Eq. 7 gives R_G as a function of R_M >= 1. For R_G below its value at R_M = 1, the result is 1.
    """
    if geometric <= geometric_ratio(1.0):
        return 1.0
    return float(brentq(lambda ratio: float(geometric_ratio(ratio)) - geometric, 1.0, 1e3))


def _point(ratio: float, steps: int) -> CalibrationPoint:
    names = list(load_scene("calibration").materials)
    overrides = {f"materials.{names[0]}.omega": LEFT, f"materials.{names[1]}.omega": LEFT / ratio}
    simulation = Simulation(load_scene("calibration", overrides=overrides))
    results = list(simulation.play(steps))
    strain, left = simulation.fields().eps_eq, simulation.scene.cell_material == 0
    means = [float(np.average(values)) for values in (strain[left], strain[~left])]
    squares = [float(np.average(values**2)) for values in (strain[left], strain[~left])]
    return CalibrationPoint(
        ratio,
        find_published_ratio(ratio),
        means[1] / means[0],
        squares[1] / squares[0],
        all(result.converged for result in results),
    )


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
    heads = ("R_G", "R_M by Eq. 7", "mean eps_eq", "strain energy", "converged")
    rows = [
        (f"{each.geometric:g}", f"{each.published:.2f}", f"{each.strain:.2f}", f"{each.energy:.2f}",
         "yes" if each.converged else "no")
        for each in points
    ]  # fmt: skip
    return make_table("Sec. 4.2.1: bar 4:1:1, stretched by 100 %, ratio right to left", heads, rows, right=heads)


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
