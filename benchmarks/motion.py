# SPDX-License-Identifier: Apache-2.0
"""Motion: error against wall time on `drop`, a measured beam beside a simulated one, robots beside real time.

``make bench-motion`` writes runs/motion/motion.json and prints the tables of docs/theory/motion.md.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.signal import find_peaks

from benchmarks.markdown import markdown_table
from gdfe_ros.scene import load_scene
from gdfe_ros.simulation import Simulation

DATA = Path(__file__).parents[1] / "test" / "data"
DROPS = (
    ([20, 1, 1], "newmark", 0.01),
    ([20, 2, 2], "generalised_alpha", 0.01),
    ([20, 2, 2], "bdf2", 0.01),
    ([20, 2, 2], "newmark", 0.01),
    ([20, 2, 2], "generalised_alpha", 0.005),
    ([40, 4, 4], "generalised_alpha", 0.01),
    ([40, 4, 4], "generalised_alpha", 0.005),
    ([40, 4, 4], "generalised_alpha", 0.002),
    ([40, 4, 4], "newmark", 0.002),
)
"""Cells, scheme and step [s]."""
LOADS = (0, 52, 101)
"""Attached to the measured beam [g]."""
DAMPINGS = {
    "viscosity": {"viscosity": 420.0},
    "viscosity and mass": {"viscosity": 260.0, "mass": 2.0},
    "one Prony branch": None,
}
"""Fits to the decay of the beam without load; the pair needs a second frequency, and takes those of all three."""
PRONY = [{"share": 0.25, "time": 0.035}]
ROBOTS = (
    "tendon_finger",
    "gripper",
    "three_chamber_arm",
    "shape_memory_strip",
    "swinging_arm",
    "whip",
    "silicone_beam",
)
STEPS = (0.002, 0.005, 0.010)
LASTS = 0.5
"""Simulated time of a robot [s]."""


def measure_drop(cells: list[int], scheme: str, step: float) -> dict[str, Any]:
    """Return the rms error of the tip's path in one second, and what it took."""
    given = {"mesh.bar.cells": cells, "dynamics.scheme": scheme, "dynamics.step": step}
    simulation = Simulation(load_scene("drop", overrides=given))
    simulation.warm_up()
    started, path, times, iterations = time.perf_counter(), [], [], []
    while simulation.time < 1.0 - 1e-9:
        result = simulation.step()
        path.append(simulation.probe_positions()["tip"])
        times.append(result.time)
        iterations.append(result.iterations)
    seconds = time.perf_counter() - started
    return {
        "cells": cells,
        "scheme": scheme,
        "step": step,
        "error": path_error(np.array(times), np.array(path)),
        "seconds": seconds,
        "iterations": float(np.mean(iterations)),
    }


def path_error(times: NDArray[np.float64], path: NDArray[np.float64]) -> float:
    """Return the rms distance of the tip (n, 3) [m] of `drop` to the reference, over its largest displacement."""
    reference = np.load(DATA / "reference" / "motion_drop.npz")
    tip = reference["tip_centre"]
    away = path - CubicSpline(reference["t"], tip)(times)
    return float(np.sqrt((away**2).sum(axis=1).mean()) / np.linalg.norm(tip - tip[0], axis=1).max())


def swings(times: NDArray[np.float64], height: NDArray[np.float64]) -> tuple[float, float, float]:
    """Return sag, frequency [Hz] and damping ratio of the first swings; the sag is the mean of the last half second."""
    sag = -float(height[times > times[-1] - 0.5].mean())
    away = height + sag
    extremes = np.sort(np.concatenate([find_peaks(sign * away, prominence=0.2)[0] for sign in (1, -1)]))[:9]
    before, here, after = (away[extremes + shift] for shift in (-1, 0, 1))
    offset = 0.5 * (before - after) / (before - 2.0 * here + after)
    moments = times[extremes] + offset * (times[1] - times[0])
    count = np.arange(len(extremes))
    decay = np.polyfit(count, np.log(np.abs(here - 0.25 * (before - after) * offset)), 1)[0] / np.pi
    return sag, float(0.5 / np.polyfit(count, moments, 1)[0]), float(-decay / np.sqrt(1.0 + decay**2))


def measured_beam(load: int) -> tuple[float, float, float]:
    """Return sag [mm], frequency and damping ratio of a recording: the mean of its markers."""
    data = np.genfromtxt(DATA / "measured" / f"beam_{load}g.csv", delimiter=",", names=True)
    first = data["t_s"] < 2.2
    height = np.mean([data[f"m{number}_up_mm"] for number in (1, 2, 3)], axis=0)
    return swings(data["t_s"][first], height[first])


def simulated_beam(load: int, damping: Mapping[str, float] | None) -> tuple[float, float, float]:
    """Return the same of the scene `silicone_beam`: the mean of its end face; None takes the Prony branch."""
    given: dict[str, Any] = {"dynamics": {"step": 0.005, **({"damping": damping} if damping else {"prony": PRONY})}}
    if load:
        given["masses"] = {"load": {"mass": 1e-3 * load, "where": {"face": "x+"}}}
    simulation = Simulation(load_scene("silicone_beam", overrides=given))
    end = simulation.mesh.vertices[:, 0] > 0.0999
    height, times = [], []
    while simulation.time < 2.2:
        result = simulation.step()
        height.append(1e3 * result.positions[end, 2].mean())
        times.append(result.time)
    return swings(np.array(times), np.array(height))


def measure_robot(name: str, step: float) -> dict[str, Any]:
    """Return the simulated time over wall time in the first half second of a robot's program, and iterations."""
    scene = load_scene(name)
    given = {"dynamics.step": step} if scene.dynamics else {"dynamics": {"step": step}}
    simulation = Simulation(load_scene(name, overrides=given))
    simulation.warm_up()
    started, results = time.perf_counter(), []
    for result in simulation.play():
        results.append(result)
        if simulation.time >= LASTS:
            break
    ratio = simulation.time / (time.perf_counter() - started)
    iterations = float(np.mean([result.iterations for result in results]))
    done = all(result.converged for result in results)
    return {"robot": name, "step": step, "ratio": ratio, "iterations": iterations, "converged": done}


def all_tables(report: Mapping[str, Any]) -> dict[str, str]:
    """Return the tables of a report by name."""
    drops = [
        ["x".join(map(str, row["cells"])), row["scheme"], f"{1e3 * row['step']:g}", f"{100 * row['error']:.2f}",
         f"{row['seconds']:.2f}", f"{row['iterations']:.1f}"]
        for row in report["drop"]
    ]  # fmt: skip
    beams = [
        [row["damping"], f"{row['load']} g", *(f"{value:.3g} ({100 * (value / real - 1):+.0f} %)" for value, real in
         zip(row["simulated"], row["measured"], strict=True))]
        for row in report["beam"]
    ]  # fmt: skip
    robots = []
    for name in dict.fromkeys(row["robot"] for row in report["robots"]):
        rows = [row for row in report["robots"] if row["robot"] == name]
        robots.append([f"`{name}`", *(f"{row['ratio']:.2g} ({row['iterations']:.0f})" for row in rows)])
    heads = ("cells", "scheme", "h [ms]", "error [%]", "wall time [s]", "iterations a step")
    return {
        "drop": markdown_table(heads, drops),
        "beam": markdown_table(("damping", "load", "sag [mm]", "frequency [Hz]", "damping ratio"), beams),
        "moving": markdown_table(("robot", *(f"h = {1e3 * step:g} ms" for step in STEPS)), robots),
    }


def main(out: Path) -> None:
    """Measure, keep, print."""
    measured = {load: measured_beam(load) for load in LOADS}
    report = {
        "drop": [measure_drop(*row) for row in DROPS],
        "beam": [
            {"damping": name, "load": load, "measured": measured[load], "simulated": simulated_beam(load, damping)}
            for name, damping in DAMPINGS.items()
            for load in LOADS
        ],
        "robots": [measure_robot(name, step) for name in ROBOTS for step in STEPS],
    }
    out.mkdir(parents=True, exist_ok=True)
    (out / "motion.json").write_text(json.dumps(report, indent=1))
    print("\n\n".join(all_tables(report).values()))


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "runs/motion"))
