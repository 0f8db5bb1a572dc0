# SPDX-License-Identifier: Apache-2.0
"""Motion: error against time on `drop` with several solvers, a measured beam, speed of robots.

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
from benchmarks.report import run_script
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
COLOURS = {"gdfe_ros": "#1b6ca8", "MuJoCo": "#edae49", "CalculiX": "#66a182"}


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
        "beam": _beam_table(report["beam"]["rows"]),
        "moving": f"{markdown_table(('robot', *(f'h = {1e3 * step:g} ms' for step in STEPS)), robots)}\n\n{said}",
    }


def _beam_table(rows: list[dict[str, Any]]) -> str:
    cells = [
        [row["damping"], f"{row['load']} g", *(f"{value:.3g} ({100 * (value / real - 1):+.0f} %)" for value, real in
         zip(row["simulated"], row["measured"], strict=True))]
        for row in rows
    ]  # fmt: skip
    aimed = ["goal", "", *(f"±{100 * target:.0f} %" for target in TARGETS)]
    return markdown_table(("damping", "load", "sag [mm]", "frequency [Hz]", "damping ratio"), [*cells, aimed])


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


def draw(folder: Path, report: Mapping[str, Any]) -> None:
    """Draw the two pictures of a report into a folder."""
    draw_front(folder / "motion_front.png", report["drop"])
    draw_swings(folder / "beam.png", report["beam"]["swings"])


def measure() -> dict[str, Any]:
    """Return the data of all tables."""
    peers, missing = measure_peers()
    return {
        "drop": [measure_ours(*row) for row in OURS] + peers,
        "missing": missing,
        "beam": measure_beam(),
        "robots": [measure_robot(name, step) for name in ROBOTS for step in STEPS],
    }


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


if __name__ == "__main__":
    run_script(
        "benchmarks.motion",
        "Motion: error against time, a measured beam, robots.",
        "motion",
        measure=measure,
        tables=all_tables,
        probe=probe,
        draw=draw,
    )
