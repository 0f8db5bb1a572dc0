# SPDX-License-Identifier: Apache-2.0
"""Motion: error against time on `drop` with several solvers, and a measured beam.

``make bench-motion`` writes a report and two pictures into runs/bench, and prints the tables of docs/theory/motion.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from benchmarks.beam import LOADS, TARGETS, beam_simulation, draw_swings, measure_beam
from benchmarks.drop import drop_settings, list_runs, measure_ours, measure_peers
from benchmarks.front_picture import draw_front
from benchmarks.markdown import markdown_table
from benchmarks.replay import STEPS as REPLAYED
from benchmarks.replay import figures, summed
from benchmarks.report import run_script
from gdfe_ros.scene import load_scene
from gdfe_ros.simulation import Simulation

FINE = 4
"""Number of cells across a bar from which a mesh is too fine for the probe."""


def all_tables(report: Mapping[str, Any]) -> dict[str, str]:
    """Return dict from name to table of a report."""
    drops = [
        [row["solver"], row["kind"], "x".join(map(str, row["cells"])), f"{1e3 * row['step']:g}",
         f"{100 * row['error']:.2f}", f"{row['seconds']:.2f}",
         f"{row['iterations']:.1f}" if "iterations" in row else ""]
        for row in report["drop"]
    ]  # fmt: skip
    heads = ("solver", "scheme or element", "cells", "h [ms]", "error [%]", "time [s]", "iterations per step")
    missing = "".join(f"\n\nNot measured: {text}." for text in report["missing"])
    return {
        "drop": markdown_table(heads, drops) + missing,
        "beam": _beam_table(report["beam"]["rows"]),
    }


def _beam_table(rows: list[dict[str, Any]]) -> str:
    cells = [
        [row["damping"], f"{row['load']} g", *(f"{value:.3g} ({100 * (value / real - 1):+.0f} %)" for value, real in
         zip(row["simulated"], row["measured"], strict=True))]
        for row in rows
    ]  # fmt: skip
    aimed = ["goal", "", *(f"±{100 * target:.0f} %" for target in TARGETS)]
    return markdown_table(("damping", "load", "sag [mm]", "frequency [Hz]", "damping ratio"), [*cells, aimed])


def draw_paths(path: Path, rows: list[dict[str, Any]]) -> None:
    """Draw processor time against the error of the tip's path."""
    points: dict[str, list[tuple[float, float]]] = {}
    for row in rows:
        points.setdefault(row["solver"], []).append((100 * row["error"], row["seconds"]))
    figure = Figure(figsize=(7.5, 4.6), dpi=130, layout="constrained")
    axes = figure.subplots()
    draw_front(axes, points)
    axes.axhline(1.0, color="0.6", lw=0.8, ls="--")
    axes.annotate("real time", (axes.get_xlim()[1], 1.0), fontsize=8, color="0.4", ha="right", va="bottom")
    axes.set(xlabel="rms error of the tip's path [%]", ylabel="processor time for one second [s]")
    axes.legend(fontsize=9, frameon=False, loc="upper right")
    figure.savefig(path)


def draw(folder: Path, report: Mapping[str, Any]) -> None:
    """Draw the two pictures of a report into a folder."""
    draw_paths(folder / "motion_front.png", report["drop"])
    draw_swings(folder / "beam.png", report["beam"]["swings"])


def measure() -> dict[str, Any]:
    """Return the data of all tables."""
    peers, missing = measure_peers()
    return {
        "drop": [measure_ours(*run) for run in list_runs("gdfe_ros")] + peers,
        "missing": missing,
        "beam": measure_beam(),
    }


def probe() -> dict[str, float]:
    """Return the figures of the first steps of `drop` on the coarser meshes, and of the loaded beam."""
    found: dict[str, float] = {}
    for scheme, cells, h in list_runs("gdfe_ros"):
        if cells[1] < FINE:
            name = f"drop, {'x'.join(map(str, cells))}, {scheme}, {h:g} s"
            simulation = Simulation(load_scene("drop", overrides=drop_settings(scheme, cells, h)))
            found |= figures(name, [simulation.step() for _ in range(REPLAYED)], simulation)
    beam = beam_simulation(LOADS[-1], None)
    found |= figures("beam", [beam.step() for _ in range(REPLAYED)], beam)
    return summed(found)


if __name__ == "__main__":
    run_script(
        "benchmarks.motion",
        "Motion: error against time, a measured beam.",
        "motion",
        measure=measure,
        tables=all_tables,
        probe=probe,
        draw=draw,
    )
