# SPDX-License-Identifier: Apache-2.0
"""Contact beside others and theory: a cube on a ball, a ball between plates, a slab on a slope, grips.

``make bench-contact`` writes runs/contact/contact.json and prints the tables of docs/theory/contact.md;
``python -m benchmarks.contact runs/contact grip`` only measures that part anew.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import grasp, grip, pressing, self_contact
from benchmarks.markdown import markdown_table
from gdfe_ros.scene.loader import scene_from_text
from gdfe_ros.simulation import Simulation

SLIDER = """
name: slider
mesh: {bar: {size: [0.1, 0.1, 0.04], cells: [5, 5, 2]}}
materials: {soft: {law: neo_hookean, young: 2.0e5, poisson: 0.45, density: 1000}}
regions: [{material: soft}]
handles: {}
obstacles: {floor: {plane: [0, 0, 1], at: [0, 0, -0.02], fixed: true}}
dynamics: {scheme: bdf2, step: 0.005, damping: {viscosity: 500}}
"""
SLOPE, GRAVITY = math.radians(30.0), 9.81
FRICTIONS = (0.1, 0.3, 0.57, 0.7, 1.0)
SETTLED, STUCK = 5.0, 60.0
"""Between which times [s] what sticks is watched."""


def slide(friction: float) -> dict[str, Any]:
    """Let a slab go on a slope; return how it accelerates [m/s^2] once it has settled and, where it sticks, its drift.

    The drift [m/s] is that of the vertex that moves most, from `SETTLED` to `STUCK`; every step is solved.
    """
    gravity = [GRAVITY * math.sin(SLOPE), 0.0, -GRAVITY * math.cos(SLOPE)]
    overrides = {"obstacles.floor.friction": friction, "loads": {"weight": {"gravity": gravity}}, "solver.skip": []}
    simulation, path, iterations = Simulation(scene_from_text(SLIDER, overrides=overrides)), [], 0
    for _ in range(400):
        result = simulation.step()
        iterations += result.iterations
        path.append(float(result.positions[:, 0].mean()))
    late = np.arange(200, 400) * 0.005
    fit = np.polyfit(late, path[200:], 2)
    wanted = max(0.0, GRAVITY * (math.sin(SLOPE) - friction * math.cos(SLOPE)))
    row = {"friction": friction, "acceleration": float(2.0 * fit[0]), "wanted": wanted, "iterations": iterations / 400}
    if wanted:
        return {**row, "drift": None}
    for until in (SETTLED, STUCK):
        before = simulation.positions
        while simulation.time < until - 1e-6:
            result = simulation.step()
            assert result.converged, result.message
    moved = np.linalg.norm(simulation.positions - before, axis=1).max()
    return {**row, "drift": float(moved) / (STUCK - SETTLED)}


def all_tables(report: Mapping[str, Any]) -> dict[str, str]:
    """Return the tables of a report by name."""
    slopes = [
        [f"{row['friction']:g}", f"{row['wanted']:.4f}", f"{row['acceleration']:.4f}", f"{row['iterations']:.1f}",
         "slides" if row["drift"] is None else f"{1e9 * row['drift']:.2g}"]
        for row in report["slope"]
    ]  # fmt: skip
    return {
        **grip.all_tables(report),
        **grasp.all_tables(report),
        **pressing.all_tables(report),
        **self_contact.all_tables(report),
        "slope": markdown_table(
            ("friction", "theory [m/s^2]", "here [m/s^2]", "iterations a step", "drift over 60 s [nm/s]"), slopes),
    }  # fmt: skip


MEASURES: dict[str, Callable[[], dict[str, Any]]] = {
    "cube": pressing.press_cubes,
    "ball": pressing.press_balls,
    "calculix": pressing.press_by_calculix,
    "slope": lambda: {"slope": [slide(friction) for friction in FRICTIONS]},
    "self": self_contact.measure,
    "grip": grip.measure,
    "grasp": grasp.measure,
}


def main(out: Path, names: Sequence[str]) -> None:
    """Measure what is named, or all; keep, and print all that is kept."""
    kept = out / "contact.json"
    report = json.loads(kept.read_text()) if names and kept.exists() else {}
    for name in names or MEASURES:
        report |= MEASURES[name]()
    out.mkdir(parents=True, exist_ok=True)
    kept.write_text(json.dumps(report, indent=1))
    print("\n\n".join(all_tables(report).values()))


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "runs/contact"), sys.argv[2:])
