# SPDX-License-Identifier: Apache-2.0
"""The measured pneumatic arm: its recordings compared with arcs of constant length, and with models.

``python -m benchmarks.measured_arm`` prints both tables; the models need some minutes. Without gravity the tip depends
only on pressure / modulus. Therefore one curve of a model is sufficient for its fit. The modulus is fitted to the
recordings from 50 to 200 mbar.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table
from scipy.interpolate import PchipInterpolator
from scipy.optimize import minimize_scalar

from benchmarks.measured_arm.arc import turned
from benchmarks.measured_arm.scene import arm_scene, tips
from benchmarks.measured_arm.section import LENGTH, Section

RECORDED = Path(__file__).parents[2] / "test" / "data" / "measured" / "arm_pressure.csv"
MBAR = 100.0
FITTED = 200.0 * MBAR
"""Largest pressure [Pa] to which the modulus is fitted; higher pressures are predicted."""
YOUNG = 263824.0
MATERIAL = {"law": "neo_hookean", "young": YOUNG, "poisson": 0.45, "density": 1.0}
"""Material with the authors' modulus. Its density is so small that the tip depends only on pressure / modulus."""
MODELS = {
    "no fibres": (Section(), 0.0),
    "inextensible rings every 6.8 mm": (Section(), 6.8e-3),
    "rings, and partitions of 5 mm": (Section(partition=5e-3), 6.8e-3),
}
"""Dict from model to its section and the spacing of its rings [m]. The thickness of the partitions is not published."""
STEP = 20.0 * MBAR


def recorded() -> dict[str, NDArray[np.float64]]:
    """Return the recorded pressure [Pa], axial, lateral and total displacement [m] and tilt [rad], (k,) each."""
    rows = np.genfromtxt(RECORDED, delimiter=",", skip_header=2)[:, 1:]
    scales = {"pressure": MBAR, "axial": 1e-3, "lateral": 1e-3, "total": 1e-3, "tilt": np.pi / 180.0}
    return {name: scale * column for (name, scale), column in zip(scales.items(), rows.T, strict=True)}


def arcs() -> Table:
    """Return the table that compares the recordings with arcs of constant length."""
    data = recorded()
    ratios, angles = turned(data["axial"], data["lateral"], data["tilt"], LENGTH)
    table = Table(title="recorded, beside an arc of 102 mm that ends at the recorded tilt")
    for column in ("mbar", "tilt [deg]", "total [mm]", "total over the arc's", "turned by [deg]"):
        table.add_column(column, justify="right")
    for row in zip(data["pressure"] / MBAR, np.rad2deg(data["tilt"]), 1e3 * data["total"], ratios, strict=True):
        angle = np.rad2deg(angles[len(table.rows)])
        table.add_row(f"{row[0]:.0f}", f"{row[1]:.2f}", f"{row[2]:.2f}", f"{row[3]:.3f}", f"{angle:.1f}")
    return table


def fitted(curve: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
    """Return the ratio of the fitted modulus to the model's, and of total to recorded displacements (k,).

    Displacements beyond the model's last equilibrium are NaN.

    Args:
        curve: pressure [Pa], total displacement [m] and tilt [rad] of a model (m, 3).
    """
    data = recorded()
    total, low = PchipInterpolator(curve[:, 0], curve[:, 1], extrapolate=False), data["pressure"] <= FITTED

    def ratios(modulus: float) -> NDArray[np.float64]:
        return total(data["pressure"] / modulus) / data["total"]

    def misfit(logarithm: float) -> float:
        return float(np.sum((ratios(np.exp(logarithm))[low] - 1.0) ** 2))

    least = np.log(FITTED / curve[-1, 0]) + 1e-9
    best = float(np.exp(minimize_scalar(misfit, bounds=(least, least + 3.0), method="bounded").x))
    return best, ratios(best)


def models(folder: Path) -> Table:
    """Return the table of the models."""
    data = recorded()
    table = Table(title="total displacement over the recorded one, modulus fitted to 50 to 200 mbar")
    table.add_column("model")
    for column in ("E [kPa]", "last equilibrium [mbar]", "rms, fitted", *(f"{p / MBAR:.0f}" for p in data["pressure"])):
        table.add_column(column, justify="right")
    low = data["pressure"] <= FITTED
    for name, (section, hoops) in MODELS.items():
        curve = tips(arm_scene(folder, section, MATERIAL, hoops=hoops), step=STEP, most=400.0 * MBAR)
        modulus, ratios = fitted(curve)
        rms = float(np.sqrt(np.mean((ratios[low] - 1.0) ** 2)))
        own = [f"{1e-3 * YOUNG * modulus:.0f}", f"{modulus * curve[-1, 0] / MBAR:.0f}", f"{100.0 * rms:.0f} %"]
        table.add_row(name, *own, *("none" if np.isnan(ratio) else f"{ratio:.2f}" for ratio in ratios))
    return table


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the tables."""
    parser = argparse.ArgumentParser(description="The measured pneumatic arm.")
    parser.add_argument("--recorded", action="store_true", help="only what the recordings say by themselves")
    console = Console(width=180)
    given = parser.parse_args(arguments)
    console.print(arcs())
    if not given.recorded:
        with tempfile.TemporaryDirectory() as folder:
            console.print(models(Path(folder)))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
