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
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.signal import find_peaks

from benchmarks.beam import DAMPINGS
from benchmarks.markdown import markdown_table
from benchmarks.measured_arm.__main__ import MBAR, YOUNG
from benchmarks.measured_arm.scene import arm_scene, marks
from benchmarks.measured_arm.section import Section
from benchmarks.measured_robots import ROBOTS
from benchmarks.report import options, write_report
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
PICTURE = "measured_arm_steps.png"


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
    """Return the table of the recordings, and that of the simulations beside them."""
    head = ("pressure [mbar]", "frequency [Hz]", "damping ratio", "first extreme [s]", "last displacement [mm]")
    rows = [[name, *_cells(row, row and row["last"])] for name, row in report["recorded"].items()]
    beside = []
    for run in report["simulated"]:
        told = report["recorded"][f"{run['pressure']:g}"]
        error = f"{100.0 * (run['ringing']['frequency'] / told['frequency'] - 1.0):+.0f} %" if run["ringing"] else ""
        cells = _cells(run["ringing"], run["last"])
        beside.append([f"{run['pressure']:g}", f"{run['filling']:g}", *cells, error])
    more = markdown_table((head[0], "filling [s]", *head[1:], "error of the frequency"), beside)
    return {"arm_steps_recorded": markdown_table(head, rows), "arm_steps_simulated": more}


def _cells(row: Mapping[str, float] | None, last: float | None) -> list[str]:
    if row is None:
        return ["none", "", "", "" if last is None else f"{last:.2f}"]
    return [f"{row['frequency']:.2f}", f"{row['damping']:.3f}", f"{row['first']:.2f}", f"{last:.2f}"]


def draw_steps(path: Path, report: Mapping[str, Any]) -> None:
    """Draw the displacement over its last value at two pressures, recorded and simulated."""
    curves = recorded()
    figure = Figure(figsize=(9.0, 4.0), dpi=110, layout="constrained")
    for axis, pressure in zip(figure.subplots(1, 2, sharey=True), (50.0, 100.0), strict=True):
        times, moved = curves[pressure]
        axis.plot(times, moved / moved[-1], ".", ms=3.0, color="#6b6f76", label="recorded")
        for run in report["simulated"]:
            if run["pressure"] == pressure:
                label = f"simulated, filled in {run['filling']:g} s" if run["filling"] else "simulated, filled at once"
                settled = np.mean(np.array(run["moved"])[np.array(run["times"]) > 0.5])
                axis.plot(run["times"], np.array(run["moved"]) / settled, lw=1.1, label=label)
        axis.set(title=f"{pressure:g} mbar", xlabel="time since the command [s]", xlim=(0.0, 1.0))
        axis.grid(color="0.92")
        axis.legend(fontsize=8, frameon=False)
    figure.supylabel("displacement over its last value", fontsize=9)
    figure.savefig(path)


def probe() -> dict[str, float]:
    """Return the simulated frequency [Hz] and last displacement [mm] at 50 mbar that come at once."""
    times, moved = simulated(*CASES[0])
    return {"frequency at 50 mbar [Hz]": ringing(times, moved)["frequency"], "last [mm]": float(moved[-1])}


def main() -> None:
    """Evaluate, simulate, write the report and the picture, and print the tables."""
    parser = options("benchmarks.measured_robots.arm_steps", "The arm after a pressure step.", "measured_arm_steps")
    parser.add_argument("--data", type=Path, default=MEASURED, help="recordings; default: those of the page")
    given = parser.parse_args()
    report = measure_steps(given.data)
    write_report(given.out, report, probe())
    pictures = given.pictures or given.out.parent
    pictures.mkdir(parents=True, exist_ok=True)
    draw_steps(pictures / PICTURE, report)
    print("\n\n".join(step_tables(report).values()))


if __name__ == "__main__":
    main()
