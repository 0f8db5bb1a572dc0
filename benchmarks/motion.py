# SPDX-License-Identifier: Apache-2.0
"""Motion: error against time on `drop` with several solvers, long runs, a measured beam, speed of robots.

``make bench-motion`` writes a report and two pictures into runs/bench, and prints the tables of docs/theory/motion.md.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from benchmarks.beam import LOADS, TARGETS, beam_simulation, draw_swings, measure_beam
from benchmarks.drop import OURS, drop_settings, front, measure_ours, measure_peers
from benchmarks.markdown import markdown_table
from benchmarks.replay import STEPS as REPLAYED
from benchmarks.replay import figures, first_steps, summed
from benchmarks.report import options, write_report
from gdfe_ros.scene import load_scene
from gdfe_ros.simulation import Simulation

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
FINE = 4
"""Number of cells across a bar from which a mesh is too fine for the probe."""
LASTS = 0.5
"""Simulated time of each robot [s]."""
LONG, LONG_STEP = 10.0, 0.005
"""Simulated time and time step of the long run of `drop` [s]."""
TURNS, SPIN, SPIN_STEP = 100, 20.0, 0.002
"""A free spinning body: number of revolutions, angular velocity [rad/s], and time step [s]."""
SPINNING = {
    "mesh.bar": {"size": [0.10, 0.02, 0.02], "cells": [5, 1, 1]},
    "materials.rubber.young": 1e6,
    "handles": {},
    "loads": {},
    "program": None,
    "probes": {},
    "dynamics": {"scheme": "newmark", "step": SPIN_STEP, "spin": [0.0, 0.0, SPIN]},
}
COLOURS = {"gdfe_ros": "#1b6ca8", "MuJoCo": "#edae49", "CalculiX": "#66a182"}


def measure_energy() -> dict[str, float]:
    """Return the largest change of the total energy of `drop` with `newmark`, divided by the largest kinetic energy."""
    simulation = Simulation(load_scene("drop", overrides={"dynamics.scheme": "newmark", "dynamics.step": LONG_STEP}))
    total, kinetic = [], []
    while simulation.time < LONG - 1e-9:
        energy = simulation.step().energies
        total.append(energy["kinetic"] + energy["elastic"] + energy["potential"])
        kinetic.append(energy["kinetic"])
    return {"seconds": LONG, "step": LONG_STEP, "strays": float(np.abs(total).max() / max(kinetic))}


def measure_spin() -> dict[str, float]:
    """Return the largest changes of angular momentum (relative) and linear momentum / (mass * rim speed) in a spin."""
    simulation = Simulation(load_scene("drop", overrides=SPINNING))
    mass, rest = simulation.stepper.mass, simulation.mesh.vertices
    centre, weights = rest.mean(axis=0), np.asarray(mass.sum(axis=0)).ravel()
    start = np.cross(rest - centre, mass @ np.cross([0.0, 0.0, SPIN], rest - centre)).sum(axis=0)
    angular = linear = 0.0
    while simulation.time < TURNS * 2.0 * np.pi / SPIN:
        result = simulation.step()
        momentum = mass @ result.velocities
        away = result.positions - weights @ result.positions / weights.sum()
        angular = max(angular, float(np.linalg.norm(np.cross(away, momentum).sum(axis=0) - start)))
        linear = max(linear, float(np.linalg.norm(momentum.sum(axis=0))))
    rim = weights.sum() * SPIN * 0.5 * simulation.mesh.size
    scaled = {"angular": angular / float(np.linalg.norm(start)), "linear": linear / float(rim)}
    return {"turns": TURNS, "step": SPIN_STEP, "per_turn": 2.0 * np.pi / SPIN / SPIN_STEP, **scaled}


def measure_robot(name: str, step: float) -> dict[str, Any]:
    """Return simulated time / processor time, and mean iterations, in the first half second of a robot's program."""
    simulation = _moving(name, step)
    simulation.warm_up()
    started, results = time.process_time(), []
    for result in simulation.play():
        results.append(result)
        if simulation.time >= LASTS:
            break
    ratio = simulation.time / (time.process_time() - started)
    iterations = float(np.mean([result.iterations for result in results]))
    done = all(result.converged for result in results)
    return {"robot": name, "step": step, "ratio": ratio, "iterations": iterations, "converged": done}


def _moving(name: str, step: float) -> Simulation:
    given = {"dynamics.step": step} if load_scene(name).dynamics else {"dynamics": {"step": step}}
    return Simulation(load_scene(name, overrides=given))


def all_tables(report: Mapping[str, Any]) -> dict[str, str]:
    """Return dict from name to table of a report."""
    drops = [
        [row["solver"], row["kind"], "x".join(map(str, row["cells"])), f"{1e3 * row['step']:g}",
         f"{100 * row['error']:.2f}", f"{row['seconds']:.2f}",
         f"{row['iterations']:.1f}" if "iterations" in row else ""]
        for row in report["drop"]
    ]  # fmt: skip
    robots = []
    for name in dict.fromkeys(row["robot"] for row in report["robots"]):
        rows = [row for row in report["robots"] if row["robot"] == name]
        robots.append([f"`{name}`", *(f"{row['ratio']:.2g} ({row['iterations']:.0f})" for row in rows)])
    fast = [row["robot"] for row in report["robots"] if row["step"] == STEPS[-1] and row["ratio"] > 1.0]
    said = f"With steps of {1e3 * STEPS[-1]:g} ms, {len(fast)} of {len(robots)} robots run faster than real time."
    heads = ("solver", "scheme or element", "cells", "h [ms]", "error [%]", "time [s]", "iterations per step")
    missing = "".join(f"\n\nNot measured: {text}." for text in report["missing"])
    return {
        "drop": markdown_table(heads, drops) + missing,
        "long": _long_table(report["long"]),
        "beam": _beam_table(report["beam"]["rows"]),
        "beam_theory": _theory_table(report["beam"]["theory"]),
        "moving": f"{markdown_table(('robot', *(f'h = {1e3 * step:g} ms' for step in STEPS)), robots)}\n\n{said}",
    }


def _long_table(report: Mapping[str, Any]) -> str:
    energy, spin = report["energy"], report["spin"]
    step = f"{1e3 * energy['step']:g} ms"
    turn = f"{1e3 * spin['step']:g} ms, {spin['per_turn']:.0f} a turn"
    turns = f"a free body, {spin['turns']} turns"
    rows = [
        (f"`drop`, {energy['seconds']:g} s", step, "total energy over the largest kinetic",
         f"{100 * energy['strays']:.2g} %", "0.5 %"),
        (turns, turn, "angular momentum", f"{100 * spin['angular']:.2g} %", "0.1 %"),
        (turns, turn, "linear momentum, over that of its rim", f"{spin['linear']:.1g}", "rounding"),
    ]  # fmt: skip
    return markdown_table(("run", "h", "conserved quantity", "largest deviation", "goal"), rows)


def _beam_table(rows: list[dict[str, Any]]) -> str:
    cells = [
        [row["damping"], f"{row['load']} g", *(f"{value:.3g} ({100 * (value / real - 1):+.0f} %)" for value, real in
         zip(row["simulated"], row["measured"], strict=True))]
        for row in rows
    ]  # fmt: skip
    aimed = ["goal", "", *(f"±{100 * target:.0f} %" for target in TARGETS)]
    return markdown_table(("damping", "load", "sag [mm]", "frequency [Hz]", "damping ratio"), [*cells, aimed])


def _theory_table(rows: list[dict[str, float]]) -> str:
    def beside(row: Mapping[str, float], value: str, real: str) -> str:
        return f"{row[value]:.3g} ({100 * (row[value] / row[real] - 1):+.1f} %)"

    cells = []
    for row in rows:
        lever = softer = ""
        if row["load"]:
            lever = f"{1e3 * row['lever']:.1f} mm: {beside(row, 'frequency_lever', 'frequency')}"
            softer = f"{100 * row['softer'] - 100:+.0f} %: {beside(row, 'frequency_softer', 'frequency')}"
        sag = [f"{row['sag']:.3g}", beside(row, "sag_theory", "sag")]
        frequency = [f"{row['frequency']:.3g}", beside(row, "frequency_theory", "frequency")]
        cells.append([f"{row['load']:.0f} g", *sag, *frequency, lever, softer])
    heads = (
        "load", "sag [mm]", "sag by theory [mm]", "frequency [Hz]", "frequency by theory [Hz]", "with a lever",
        "with a softer beam",
    )  # fmt: skip
    return markdown_table(heads, cells)


def draw_front(path: Path, rows: list[dict[str, Any]]) -> None:
    """Draw processor time against the error of the tip's path; a line is the Pareto front of a solver."""
    figure = Figure(figsize=(7.5, 4.6), dpi=130, layout="constrained")
    axis = figure.subplots()
    for solver, colour in COLOURS.items():
        own = [row for row in rows if row["solver"] == solver]
        for marked, style in ((own, {"ls": "", "alpha": 0.4}), (front(own), {"label": solver})):
            if marked:
                points = ([100 * row["error"] for row in marked], [row["seconds"] for row in marked])
                axis.loglog(*points, marker="o", ms=5, color=colour, **style)
    axis.axhline(1.0, color="0.6", lw=0.8, ls="--")
    axis.annotate("real time", (axis.get_xlim()[1], 1.0), fontsize=8, color="0.4", ha="right", va="bottom")
    axis.set_xlabel("rms error of the tip's path [%]", fontsize=9)
    axis.set_ylabel("processor time for one second [s]", fontsize=9)
    axis.grid(visible=True, which="both", color="0.92")
    axis.legend(fontsize=9, frameon=False, loc="upper right")
    figure.savefig(path)


def probe() -> dict[str, float]:
    """Return the figures of the first steps of `drop` on the coarser meshes, of the loaded beam, and of every robot."""
    found: dict[str, float] = {}
    for cells, scheme, h in OURS:
        if cells[1] < FINE:
            name = f"drop, {'x'.join(map(str, cells))}, {scheme}, {h:g} s"
            simulation = Simulation(load_scene("drop", overrides=drop_settings(cells, scheme, h)))
            found |= figures(name, [simulation.step() for _ in range(REPLAYED)], simulation)
    beam = beam_simulation(LOADS[-1], None)
    found |= figures("beam", [beam.step() for _ in range(REPLAYED)], beam)
    for name in ROBOTS:
        found |= first_steps(name, _moving(name, STEPS[-1]), None)
    return summed(found)


def main() -> None:
    """Run the measurement, write report and pictures, and print the tables."""
    parser = options("benchmarks.motion", "Motion: error against time, long runs, a measured beam, robots.", "motion")
    parser.add_argument("--quick", action="store_true", help="coarse meshes, no peers, one step of each robot")
    given = parser.parse_args()
    peers, missing = ([], ["peers"]) if given.quick else measure_peers()
    runs, steps = ([row for row in OURS if row[0][1] < FINE], STEPS[-1:]) if given.quick else (OURS, STEPS)
    report = {
        "drop": [measure_ours(*row) for row in runs] + peers,
        "missing": missing,
        "long": {"energy": measure_energy(), "spin": measure_spin()},
        "beam": measure_beam(),
        "robots": [measure_robot(name, step) for name in ROBOTS for step in steps],
    }
    write_report(given.out, report, probe())
    pictures = given.pictures or given.out.parent
    draw_front(pictures / "motion_front.png", report["drop"])
    draw_swings(pictures / "beam.png", report["beam"]["swings"])
    print("\n\n".join(all_tables(report).values()))


if __name__ == "__main__":
    main()
