# SPDX-License-Identifier: Apache-2.0
"""A silicone beam: sag, frequency and damping as recorded and as simulated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import find_peaks

from benchmarks.curves import POINTS, draw_panels
from gdfe_ros.scene import load_scene
from gdfe_ros.simulation import Simulation

MEASURED = Path(__file__).parents[1] / "test" / "data" / "measured"
LOADS = (0, 52, 101)
"""Masses that were attached to the measured beam [g]."""
DAMPINGS = {
    "viscosity": {"viscosity": 420.0},
    "viscosity and mass": {"viscosity": 260.0, "mass": 2.0},
    "one Prony branch": None,
}
"""Dict from name to damping parameters, fitted to the decay of the beam without load. Viscosity and mass together are
fitted to the decays with all three loads, because this fit needs more than one frequency. None stands for `PRONY`.
"""
SHOWN = "viscosity and mass"
"""The entry of `DAMPINGS` that the picture shows."""
PRONY = [{"share": 0.25, "time": 0.035}]
LASTS = 2.2
"""Duration of each recording and of each simulation [s]."""
TARGETS = (0.05, 0.03, 0.20)
"""Goals of the comparison: largest relative differences of sag, frequency and damping ratio."""
Curve = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Times [s] and heights [mm]."""


def swings(times: NDArray[np.float64], height: NDArray[np.float64]) -> tuple[float, float, float]:
    """Return sag [mm], frequency [Hz] and damping ratio; the sag is the mean of the last half second."""
    sag = -float(height[times > times[-1] - 0.5].mean())
    away = height + sag
    extremes = np.sort(np.concatenate([find_peaks(sign * away, prominence=0.2)[0] for sign in (1, -1)]))[:9]
    before, here, after = (away[extremes + shift] for shift in (-1, 0, 1))
    offset = 0.5 * (before - after) / (before - 2.0 * here + after)
    moments = times[extremes] + offset * (times[1] - times[0])
    count = np.arange(len(extremes))
    decay = np.polyfit(count, np.log(np.abs(here - 0.25 * (before - after) * offset)), 1)[0] / np.pi
    return sag, float(0.5 / np.polyfit(count, moments, 1)[0]), float(-decay / np.sqrt(1.0 + decay**2))


def measured_beam(load: int) -> Curve:
    """Return the recorded curve of the beam with a load [g]: the mean of its markers."""
    data = np.genfromtxt(MEASURED / f"beam_{load}g.csv", delimiter=",", names=True)
    first = data["t_s"] < LASTS
    height = np.mean([data[f"m{number}_up_mm"] for number in (1, 2, 3)], axis=0)
    return data["t_s"][first], height[first]


def simulated_beam(load: int, damping: Mapping[str, float] | None) -> Curve:
    """Return the simulated curve of the beam: the mean of its end face. ``damping`` None means the Prony branch."""
    simulation = beam_simulation(load, damping)
    end = simulation.mesh.vertices[:, 0] > 0.0999
    height, times = [], []
    while simulation.time < LASTS:
        result = simulation.step()
        height.append(1e3 * result.positions[end, 2].mean())
        times.append(result.time)
    return np.array(times), np.array(height)


def beam_simulation(load: int, damping: Mapping[str, float] | None) -> Simulation:
    """Return the scene `silicone_beam` with a load [g] and a damping; None means the Prony branch."""
    given: dict[str, Any] = {"dynamics": {"step": 0.005, **({"damping": damping} if damping else {"prony": PRONY})}}
    if load:
        given["masses"] = {"load": {"mass": 1e-3 * load, "where": {"face": "x+"}}}
    return Simulation(load_scene("silicone_beam", overrides=given))


def measure_beam() -> dict[str, Any]:
    """Return rows with sag [mm], frequency [Hz] and damping ratio, and the curves that the picture shows."""
    rows, shown = [], {}
    for name, damping in DAMPINGS.items():
        for load in LOADS:
            curve = simulated_beam(load, damping)
            found = {"measured": swings(*measured_beam(load)), "simulated": swings(*curve)}
            rows.append({"damping": name, "load": load, **found})
            if name == SHOWN:
                shown[f"{load}"] = [[round(float(value), 4) for value in values] for values in curve]
    return {"rows": rows, "swings": shown}


def draw_swings(path: Path, shown: Mapping[str, Sequence[Sequence[float]]]) -> None:
    """Draw recorded and simulated curves, a panel for each load."""
    panels = {
        f"{load} g at the end": [
            (*measured_beam(load), {**POINTS, "label": "recorded"}),
            (*shown[f"{load}"], {"lw": 1.3, "label": "simulated"}),
        ]
        for load in LOADS
    }
    draw_panels(path, panels, x="time since the release [s]", y="tip [mm]", columns=1)
