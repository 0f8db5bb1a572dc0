# SPDX-License-Identifier: Apache-2.0
"""The braided pneumatic module: one modulus fitted at 36 kPa, the tilt predicted to 75 degrees in three directions.

``python -m benchmarks.measured_robots.module`` prints the table of docs/measured_module.md (two minutes).
``--data FILE`` compares with another file of the same columns. Forces on the tip are not in the model.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from itertools import groupby
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import newton
from scipy.spatial.transform import Rotation

from benchmarks.curves import POINTS, Curve, draw_panels
from benchmarks.markdown import markdown_table
from benchmarks.measured_robots import ROBOTS
from benchmarks.measured_robots.module_body import LAYERS, LENGTH, module_scene
from benchmarks.report import run_script
from gdfe_ros import Command, Simulation

Array = NDArray[np.float64]
MEASURED = ROBOTS / "stiffflop_noload_plateaus.csv"
PAIRS = ("p0", "p1", "p2")
FITTED = (34e3, 38e3)
"""Range of the pressures [Pa] of the states to which the modulus is fitted."""
LEAST = 5e3
"""Least pressure [Pa] of a state under pressure."""
STEP = 12e3
"""Largest increment of the pressures [Pa]."""
BEYOND = 5.5e-3
"""Distance of the recorded point beyond the end of the silicone [m], as the recorded arcs of constant curvature say."""
START = 100e3
"""Modulus [Pa] of the first simulation."""


def recorded(path: Path = MEASURED) -> list[dict[str, Any]]:
    """Return the states under pressure: pressures (3,) [Pa], tilt, azimuth [degrees], displacement (3,) [m]."""
    rows = np.genfromtxt(path, delimiter=",", names=True)
    pressures = np.array([rows[f"{name}_Pa"] for name in PAIRS]).T
    places = np.array([rows[f"tip_{axis}_m"] for axis in "xyz"]).T
    rest = places[np.flatnonzero(pressures.max(axis=1) < LEAST)[0]]
    return [
        {
            "pressures": np.where(pressures[k] < LEAST, 0.0, pressures[k]),
            "tilt": float(rows["tilt_deg"][k]),
            "azimuth": float(rows["tilt_azimuth_deg"][k]),
            "moved": places[k] - rest,
        }
        for k in np.lexsort((pressures.max(axis=1), *(pressures.T < LEAST)))
        if pressures[k].max() >= LEAST
    ]


def bend(simulation: Simulation, pressures: Sequence[float]) -> dict[str, Any] | None:
    """Return tilt, azimuth [degrees], displacement (3,) [m] and length [m] under pressures (3,); None if there is none.

    The displacement includes that by gravity, which is 0.3 mm along the axis. The simulation goes on from its present
    state if its pressures have the same direction, else from the initial one.
    """
    goal = np.asarray(pressures, dtype=np.float64)
    present = np.array([simulation.commands[f"{name}a"] for name in PAIRS])
    if np.any((present > 0.0) != (goal > 0.0)) or np.any(present > goal):
        simulation.reset()
        present = np.zeros(3)
    for fraction in np.linspace(0.0, 1.0, 1 + int(np.ceil((goal - present).max() / STEP)))[1:]:
        given = zip(PAIRS, present + fraction * (goal - present), strict=True)
        command = {f"{name}{letter}": float(value) for name, value in given for letter in "ab"}
        if not simulation.step(Command(actuators=command)).converged:
            return None
    place, axis = _place(simulation)
    layers = simulation.positions.reshape(LAYERS + 1, -1, 3).mean(axis=1)
    return {
        "tilt": float(np.degrees(np.arccos(np.clip(axis[2], -1.0, 1.0)))),
        "azimuth": float(np.degrees(np.arctan2(axis[1], axis[0]))),
        "moved": place - (0.0, 0.0, LENGTH + BEYOND),
        "length": float(np.linalg.norm(np.diff(layers, axis=0), axis=1).sum()),
    }


def fit_modulus(states: Sequence[Mapping[str, Any]]) -> float:
    """Return the modulus [Pa] with which the mean tilt of the fitted states is the recorded one."""
    used = [state for state in states if FITTED[0] <= max(state["pressures"]) <= FITTED[1]]
    pressure = float(np.mean([max(state["pressures"]) for state in used]))
    tilt = float(np.mean([state["tilt"] for state in used]))

    def away(young: float) -> float:
        return bend(make_module(young), (pressure, 0.0, 0.0))["tilt"] - tilt

    return float(newton(away, START, x1=0.95 * START, tol=0.002 * START))


def measure_module(path: Path = MEASURED) -> dict[str, Any]:
    """Return the modulus fitted to the recordings of the page, and recorded and predicted values of the states."""
    groups = [list(group) for _, group in groupby(recorded(path), key=lambda state: tuple(state["pressures"] > 0.0))]
    young = fit_modulus(recorded())
    with ProcessPoolExecutor(len(groups), mp_context=get_context("spawn")) as pool:
        parts = list(pool.map(_predict, groups, [young] * len(groups)))
    return {"young": young, "rows": [row for part in parts for row in part]}


def _predict(states: Sequence[Mapping[str, Any]], young: float) -> list[dict[str, Any]]:
    """Return recorded and predicted values of states with pressures in one direction, ascending."""
    simulation = make_module(young)
    return [
        {"recorded": _plain(state), "found": (found := bend(simulation, state["pressures"])) and _plain(found)}
        for state in states
    ]


def module_table(report: Mapping[str, Any]) -> dict[str, str]:
    """Return the table under its name, after a line with the modulus."""
    head = ("pressures [kPa]", "", "tilt [degrees]: recorded", "predicted", "error", "azimuth: recorded, predicted",
            "displacement [mm]: recorded", "predicted", "length, predicted [mm]")  # fmt: skip
    table = markdown_table(head, [_row(row) for row in report["rows"]])
    return {"module": f"The fitted modulus is {1e-3 * report['young']:.1f} kPa.\n\n{table}"}


def _row(row: Mapping[str, Any]) -> list[str]:
    told, found = row["recorded"], row["found"]
    kind = "fitted" if FITTED[0] <= max(told["pressures"]) <= FITTED[1] else "predicted"
    start = [_pressures(told), kind, f"{told['tilt']:.1f}"]
    if found is None:
        return [*start, "none", "", "", f"{1e3 * np.linalg.norm(told['moved']):.1f}", "none", ""]
    return [
        *start,
        f"{found['tilt']:.1f}",
        f"{100.0 * (found['tilt'] / told['tilt'] - 1.0):+.0f} %",
        f"{told['azimuth']:.0f}, {found['azimuth']:.0f}",
        f"{1e3 * np.linalg.norm(told['moved']):.1f}",
        f"{1e3 * np.linalg.norm(found['moved']):.1f}",
        f"{1e3 * found['length']:.1f}",
    ]


def _pressures(told: Mapping[str, Any]) -> str:
    return ", ".join(f"{name} {1e-3 * p:.0f}" for name, p in zip(PAIRS, told["pressures"], strict=True) if p)


def draw_module(folder: Path, report: Mapping[str, Any]) -> None:
    """Draw recorded and predicted tilts over the pressure, and axial over lateral displacements."""
    rows = sorted((row for row in report["rows"] if row["found"]), key=lambda row: max(row["recorded"]["pressures"]))
    panels: dict[str, list[Curve]] = {
        "tilt [degrees] over pressure [kPa]": [],
        "axial over lateral displacement [mm]": [],
    }
    for which, looks in (("recorded", {**POINTS, "marker": "o"}), ("found", {"color": "k", "label": "simulated"})):
        moved = 1e3 * np.array([row[which]["moved"] for row in rows])
        pressures = [1e-3 * max(row["recorded"]["pressures"]) for row in rows]
        tilts, (left, right) = [row[which]["tilt"] for row in rows], panels.values()
        left.append((pressures, tilts, looks))
        right.append((np.hypot(moved[:, 0], moved[:, 1]), moved[:, 2], looks))
    draw_panels(folder / "measured_module.png", panels, x="", y="", columns=2)


def probe() -> dict[str, float]:
    """Return the tilt [degrees] of the module with the first modulus at 36 kPa."""
    found = bend(make_module(START), (36e3, 0.0, 0.0))
    return {"tilt at 36 kPa, E = 100 kPa [degrees]": found["tilt"]}


def make_module(young: float) -> Simulation:
    """Return the simulation of the module with a modulus [Pa]."""
    with tempfile.TemporaryDirectory() as folder:
        return Simulation(module_scene(Path(folder), young))


def _place(simulation: Simulation) -> tuple[Array, Array]:
    """Return the recorded point (3,) [m] beyond the end of the silicone, and the axis of the tip (3,)."""
    pose = simulation.handle_pose("tip")
    axis = Rotation.from_rotvec(pose.rotation).as_matrix()[:, 2]
    return np.array([0.0, 0.0, LENGTH]) + pose.translation + BEYOND * axis, axis


def _plain(state: Mapping[str, Any]) -> dict[str, Any]:
    return {name: np.round(value, 7).tolist() for name, value in state.items()}


if __name__ == "__main__":
    run_script(
        "benchmarks.measured_robots.module",
        "The braided pneumatic module.",
        "measured_module",
        measure=measure_module,
        tables=module_table,
        probe=probe,
        draw=draw_module,
        data=MEASURED,
    )
