# SPDX-License-Identifier: Apache-2.0
"""The pneumatic arm after a step of the pressure: frequency and damping, recorded and predicted, nothing fitted to it.

``python -m benchmarks.measured_robots.arm_steps`` prints the tables of docs/measured_arm_steps.md (a minute). The
modulus is the authors', and the viscosity is that of the beam of the same silicone (`benchmarks.beam`). The pressure in
the chamber was not recorded: the simulated pressure rises at once, or evenly during a time.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import find_peaks

from benchmarks.beam import DAMPINGS
from benchmarks.curves import POINTS, draw_panels
from benchmarks.markdown import markdown_table
from benchmarks.measured_robots import ROBOTS
from benchmarks.measured_robots.arm_body import MBAR, YOUNG, Section, arm_scene, marks
from benchmarks.report import run_script
from gdfe_ros import Command, Simulation

Array = NDArray[np.float64]
MEASURED = ROBOTS / "arm_dynamic.csv"
STEP, LASTS = 0.005, 0.7
"""Time step and duration of the simulations [s]."""
RINGS = 0.6
"""Time after the command within which extremes are looked for [s]."""
PROMINENCE = 0.02
"""Least height of an extreme over its neighbours, as a fraction of the last displacement."""
CASES = ((50.0, 0.0), (50.0, 0.2), (100.0, 0.0), (100.0, 0.2))
"""Pressures [mbar] and times of filling [s] that are simulated; the model has no equilibrium far above."""
MATERIAL = {"law": "neo_hookean", "young": YOUNG, "poisson": 0.45, "density": 1070.0}


def recorded(path: Path = MEASURED) -> dict[float, tuple[Array, Array]]:
    """Return dict from pressure [mbar] to times (k,) [s] and lengths of the displacement of the free end (k,) [mm]."""
    rows = np.genfromtxt(path, delimiter=",", names=True)
    moved = 1e3 * np.linalg.norm([rows[name] for name in ("ux_axial_m", "uy_m", "uz_m")], axis=0)
    pressures = np.unique(rows["pressure_Pa"])
    return {
        float(p / MBAR): (rows["t_s"][own], moved[own]) for p in pressures if (own := rows["pressure_Pa"] == p).any()
    }


def ringing(times: Array, moved: Array) -> dict[str, float] | None:
    """Return frequency [Hz] and damping ratio of the ringing, and time of the first extreme [s]; None without ringing.

    Successive extremes are half a period apart. The logarithms of their differences fall along a line, from the largest
    difference on: what is before it belongs to the filling.
    """
    least = PROMINENCE * abs(moved[-1])
    found = [find_peaks(sign * moved, prominence=least)[0] for sign in (1.0, -1.0)]
    extremes = np.sort(np.concatenate(found))
    extremes = extremes[times[extremes] < RINGS]
    if len(extremes) < 4:
        return None
    extremes = extremes[min(int(np.argmax(np.abs(np.diff(moved[extremes])))), len(extremes) - 4) :]
    before, here, after = (moved[extremes + shift] for shift in (-1, 0, 1))
    moments = times[extremes] + 0.5 * (before - after) / (before - 2.0 * here + after) * (times[1] - times[0])
    half = float(np.polyfit(np.arange(len(moments)), moments, 1)[0])
    swings = np.abs(np.diff(here))
    decay = -float(np.polyfit(np.arange(len(swings)), np.log(swings), 1)[0]) / np.pi
    return {"frequency": 0.5 / half, "damping": decay / np.hypot(1.0, decay), "first": float(moments[0])}


def simulated(pressure: float, filling: float) -> tuple[Array, Array]:
    """Return times (k,) [s] and displacements (k,) [mm] of the arm for a pressure [mbar] that is reached in a time."""
    dynamics = {"step": STEP, "damping": DAMPINGS["viscosity"]}
    with tempfile.TemporaryDirectory() as folder:
        simulation = Simulation(arm_scene(Path(folder), Section(), MATERIAL, dynamics=dynamics, gravity=0.0))
    rest, found = marks(simulation), [(0.0, 0.0)]
    while simulation.time < LASTS:
        part = min(1.0, (simulation.time + STEP) / filling) if filling else 1.0
        result = simulation.step(Command(actuators={"air": part * pressure * MBAR}))
        found.append((result.time, 1e3 * float(np.linalg.norm((marks(simulation) - rest).mean(axis=0)))))
    times, moved = np.array(found).T
    return times, moved


def measure_steps(path: Path = MEASURED) -> dict[str, Any]:
    """Return the ringing of each recording and of each simulation, and the simulated curves."""
    own = {f"{p:g}": ringing(*curve) | {"last": float(curve[1][-1])} if ringing(*curve) else None
           for p, curve in recorded(path).items()}  # fmt: skip
    runs = []
    for pressure, filling in CASES:
        times, moved = simulated(pressure, filling)
        row = {"pressure": pressure, "filling": filling, "last": float(moved[-1]), "ringing": ringing(times, moved)}
        runs.append(row | {"times": np.round(times, 4).tolist(), "moved": np.round(moved, 4).tolist()})
    return {"recorded": own, "simulated": runs}


def step_tables(report: Mapping[str, Any]) -> dict[str, str]:
    """Return the table of the simulations beside the recordings at their pressures, under its name."""
    rows = []
    for run in report["simulated"]:
        told, own = report["recorded"][f"{run['pressure']:g}"], run["ringing"]
        error = f"{100.0 * (own['frequency'] / told['frequency'] - 1.0):+.0f} %" if own else ""
        pairs = [("frequency", ".2f"), ("damping", ".3f"), ("first", ".2f")]
        cells = [f"{told[name]:{form}}, {own[name]:{form}}" if own else "none" for name, form in pairs]
        last = f"{told['last']:.2f}, {run['last']:.2f}"
        rows.append([f"{run['pressure']:g}", f"{run['filling']:g}", *cells, last, error])
    heads = (
        "pressure [mbar]", "filling [s]", "frequency [Hz]: recorded, simulated", "damping ratio", "first extreme [s]",
        "last displacement [mm]", "error of the frequency",
    )  # fmt: skip
    return {"arm_steps": markdown_table(heads, rows)}


def draw_steps(folder: Path, report: Mapping[str, Any]) -> None:
    """Draw the displacement over its last value at two pressures, recorded and simulated."""
    panels = {}
    for pressure in (50.0, 100.0):
        times, moved = recorded()[pressure]
        first = times < 1.0
        panels[f"{pressure:g} mbar"] = curves = [
            (times[first], moved[first] / moved[-1], {**POINTS, "label": "recorded"})
        ]
        for run in (run for run in report["simulated"] if run["pressure"] == pressure):
            settled = np.mean(np.array(run["moved"])[np.array(run["times"]) > 0.5])
            label = f"simulated, filled in {run['filling']:g} s"
            curves.append((run["times"], np.array(run["moved"]) / settled, {"lw": 1.1, "label": label}))
    labels = {"x": "time since the command [s]", "y": "displacement over its last value"}
    draw_panels(folder / "measured_arm_steps.png", panels, **labels, columns=2)


def probe() -> dict[str, float]:
    """Return the simulated frequency [Hz] and last displacement [mm] at 50 mbar that come at once."""
    times, moved = simulated(*CASES[0])
    return {"frequency at 50 mbar [Hz]": ringing(times, moved)["frequency"], "last [mm]": float(moved[-1])}


if __name__ == "__main__":
    run_script(
        "benchmarks.measured_robots.arm_steps",
        "The arm after a pressure step.",
        "measured_arm_steps",
        measure=measure_steps,
        tables=step_tables,
        probe=probe,
        draw=draw_steps,
        data=MEASURED,
    )
