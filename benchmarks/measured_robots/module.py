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
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.optimize import newton
from scipy.spatial.transform import Rotation

from benchmarks.markdown import markdown_table
from benchmarks.measured_robots import ROBOTS
from benchmarks.measured_robots.module_body import LAYERS, LENGTH, THREAD, module_scene
from benchmarks.report import options, write_report
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
MODELS: dict[str, tuple[str, float]] = {
    "neo-Hooke, stiff thread": ("neo_hookean", THREAD),
    "neo-Hooke, yielding thread": ("neo_hookean", 0.1 * THREAD),
    "Mooney, stiff thread": ("mooney_rivlin", THREAD),
}
"""Dict from model to law and stiffness of the hoops [N/m]; the first one is the prediction, the others are variants."""
PREDICTION = next(iter(MODELS))
PICTURE = "measured_module.png"


def law(kind: str, young: float) -> dict[str, Any]:
    """Return an entry for a law with one modulus [Pa]; the law of Mooney has equal constants."""
    if kind == "neo_hookean":
        return {"law": kind, "young": float(young)}
    return {"law": kind, "c10": float(young) / 12.0, "c01": float(young) / 12.0}


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


def fit_modulus(kind: str, thread: float, states: Sequence[Mapping[str, Any]]) -> float:
    """Return the modulus [Pa] with which the mean tilt of the fitted states is the recorded one."""
    used = [state for state in states if FITTED[0] <= max(state["pressures"]) <= FITTED[1]]
    pressure = float(np.mean([max(state["pressures"]) for state in used]))
    tilt = float(np.mean([state["tilt"] for state in used]))

    def away(young: float) -> float:
        found = bend(_module(kind, thread, young), (pressure, 0.0, 0.0))
        return found["tilt"] - tilt

    return float(newton(away, START, x1=0.95 * START, tol=0.002 * START))


def measure_module(
    path: Path = MEASURED, *, models: Sequence[str] = (PREDICTION,), young: float | None = None
) -> dict[str, Any]:
    """Return the fitted modulus of each model, and its predictions: variants only of the states of the first pair."""
    states, report = recorded(path), {}
    groups = [list(group) for _, group in groupby(states, key=lambda state: tuple(state["pressures"] > 0.0))]
    with ProcessPoolExecutor(len(groups), mp_context=get_context("spawn")) as pool:
        for name in models:
            fitted = fit_modulus(*MODELS[name], recorded()) if young is None else young
            print(f"{name}: {1e-3 * fitted:.1f} kPa", flush=True)
            used = groups if name == models[0] else [group for group in groups if group[0]["pressures"][0]]
            parts = list(pool.map(_predict, used, [name] * len(used), [fitted] * len(used)))
            report[name] = {"young": fitted, "rows": [row for part in parts for row in part]}
    return report


def _predict(states: Sequence[Mapping[str, Any]], name: str, young: float) -> list[dict[str, Any]]:
    """Return recorded and predicted values of states with pressures in one direction, ascending."""
    simulation = _module(*MODELS[name], young)
    return [
        {"recorded": _plain(state), "found": (found := bend(simulation, state["pressures"])) and _plain(found)}
        for state in states
    ]


def module_tables(report: Mapping[str, Any]) -> dict[str, str]:
    """Return the table of the first model of a report."""
    head = ("pressures [kPa]", "", "tilt [degrees]: recorded", "predicted", "error", "azimuth: recorded, predicted",
            "displacement [mm]: recorded", "predicted", "length, predicted [mm]")  # fmt: skip
    first = next(iter(report.values()))
    table = markdown_table(head, [_row(row) for row in first["rows"]])
    return {"module": f"The fitted modulus is {1e-3 * first['young']:.1f} kPa.\n\n{table}"}


def _row(row: Mapping[str, Any]) -> list[str]:
    told, found = row["recorded"], row["found"]
    kind = "fitted" if FITTED[0] <= max(told["pressures"]) <= FITTED[1] else "predicted"
    start = [_pressures(told), kind, f"{told['tilt']:.1f}"]
    if found is None:
        return [*start, "none", "", "", f"{1e3 * np.linalg.norm(told['moved']):.1f}", "none", ""]
    return [
        *start,
        f"{found['tilt']:.1f}",
        _error(row),
        f"{told['azimuth']:.0f}, {found['azimuth']:.0f}",
        f"{1e3 * np.linalg.norm(told['moved']):.1f}",
        f"{1e3 * np.linalg.norm(found['moved']):.1f}",
        f"{1e3 * found['length']:.1f}",
    ]


def _error(row: Mapping[str, Any]) -> str:
    return (
        "none" if row["found"] is None else f"{100.0 * (row['found']['tilt'] / row['recorded']['tilt'] - 1.0):+.0f} %"
    )


def _pressures(told: Mapping[str, Any]) -> str:
    return ", ".join(f"{name} {1e-3 * p:.0f}" for name, p in zip(PAIRS, told["pressures"], strict=True) if p)


def draw_module(path: Path, report: Mapping[str, Any]) -> None:
    """Draw recorded and predicted tilts over the pressure, and the predicted axis of the module in each state."""
    figure = Figure(figsize=(9.0, 4.0), dpi=110, layout="constrained")
    left, right = figure.subplots(1, 2)
    first = next(iter(report.values()))["rows"]
    for number, (pair, colour) in enumerate(zip(PAIRS, ("#1b6ca8", "#b8502a", "#3c8d40"), strict=True)):
        rows = [row for row in first if row["recorded"]["pressures"][number]]
        pressure = [1e-3 * row["recorded"]["pressures"][number] for row in rows]
        left.plot(pressure, [row["recorded"]["tilt"] for row in rows], "o", color=colour, label=f"{pair}, recorded")
        aside = [1e3 * np.hypot(*row["recorded"]["moved"][:2]) for row in rows]
        right.plot(aside, [1e3 * row["recorded"]["moved"][2] for row in rows], "o", color=colour)
    rows = sorted((row for row in first if row["found"]), key=lambda row: max(row["recorded"]["pressures"]))
    pressure = [0.0, *(1e-3 * max(row["recorded"]["pressures"]) for row in rows)]
    left.plot(pressure, [0.0, *(row["found"]["tilt"] for row in rows)], "k-", lw=1.2, label="simulated")
    moved = 1e3 * np.array([row["found"]["moved"] for row in rows])
    right.plot(np.hypot(moved[:, 0], moved[:, 1]), moved[:, 2], "k-", lw=1.2)
    left.set(xlabel="pressure [kPa]", ylabel="tilt of the tip [degrees]")
    right.set(xlabel="lateral displacement of the tip [mm]", ylabel="axial displacement [mm]")
    left.legend(fontsize=8, frameon=False)
    for axis in (left, right):
        axis.grid(color="0.92")
    figure.savefig(path)


def probe() -> dict[str, float]:
    """Return the tilt [degrees] of the module with the first modulus at 36 kPa."""
    found = bend(_module("neo_hookean", THREAD, START), (36e3, 0.0, 0.0))
    return {"tilt at 36 kPa, E = 100 kPa [degrees]": found["tilt"]}


def main() -> None:
    """Fit, predict, write the report and the picture, and print the tables."""
    parser = options("benchmarks.measured_robots.module", "The braided pneumatic module.", "measured_module")
    parser.add_argument("--data", type=Path, default=MEASURED, help="states to predict; default: those of the page")
    parser.add_argument("--models", nargs="+", choices=tuple(MODELS), default=(PREDICTION,), help="default: the first")
    parser.add_argument("--young", type=float, help="modulus [Pa] that replaces the fit")
    given = parser.parse_args()
    report = measure_module(given.data, models=given.models, young=given.young)
    write_report(given.out, report, probe())
    pictures = given.pictures or given.out.parent
    pictures.mkdir(parents=True, exist_ok=True)
    draw_module(pictures / PICTURE, report)
    for name, model in report.items():
        print(f"\n{name}\n\n{module_tables({name: model})['module']}")


def _module(kind: str, thread: float, young: float) -> Simulation:
    with tempfile.TemporaryDirectory() as folder:
        return Simulation(module_scene(Path(folder), law(kind, young), thread=thread))


def _place(simulation: Simulation) -> tuple[Array, Array]:
    """Return the recorded point (3,) [m] beyond the end of the silicone, and the axis of the tip (3,)."""
    pose = simulation.handle_pose("tip")
    axis = Rotation.from_rotvec(pose.rotation).as_matrix()[:, 2]
    return np.array([0.0, 0.0, LENGTH]) + pose.translation + BEYOND * axis, axis


def _plain(state: Mapping[str, Any]) -> dict[str, Any]:
    return {name: np.round(value, 7).tolist() for name, value in state.items()}


if __name__ == "__main__":
    main()
