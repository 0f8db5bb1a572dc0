# SPDX-License-Identifier: Apache-2.0
"""Contact compared with other solvers and theory: a cube on a ball, a ball between plates, a slab on a slope, grips.

``make bench-contact`` writes a report into runs/bench and prints the tables of docs/theory/contact_measured.md.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from benchmarks import force_grip, grasp, grip, pressing, self_contact
from benchmarks.markdown import markdown_table
from benchmarks.replay import first_steps
from benchmarks.report import options, write_report
from gdfe_ros.scene.loader import load_scene, scene_from_text
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
SLID = 20
"""Number of steps of the slab in the probe."""
SETTLED, STUCK = 5.0, 60.0
"""Start and end [s] of the interval in which the drift of a sticking slab is measured."""


def slide(friction: float) -> dict[str, Any]:
    """Release a slab on a slope; return its acceleration [m/s^2] from 1 s to 2 s and, if it sticks, its drift [m/s].

    The drift is the largest displacement of a vertex from `SETTLED` to `STUCK`, divided by the duration of this
    interval. No solve is skipped.
    """
    simulation, path, iterations = _slab(friction), [], 0
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


def _slab(friction: float) -> Simulation:
    gravity = [GRAVITY * math.sin(SLOPE), 0.0, -GRAVITY * math.cos(SLOPE)]
    overrides = {"obstacles.floor.friction": friction, "loads": {"weight": {"gravity": gravity}}, "solver.skip": []}
    return Simulation(scene_from_text(SLIDER, overrides=overrides))


def all_tables(report: Mapping[str, Any]) -> dict[str, str]:
    """Return dict from name to table of a report."""
    slopes = [
        [f"{row['friction']:g}", f"{row['wanted']:.4f}", f"{row['acceleration']:.4f}", f"{row['iterations']:.1f}",
         "slides" if row["drift"] is None else f"{1e9 * row['drift']:.2g}"]
        for row in report["slope"]
    ]  # fmt: skip
    return {
        **grip.all_tables(report),
        **(force_grip.all_tables(report) if "force_grip" in report else {}),
        **grasp.all_tables(report),
        **pressing.all_tables(report),
        **self_contact.all_tables(report),
        "slope": markdown_table(
            ("friction", "acceleration by theory [m/s^2]", "by gdfe_ros [m/s^2]", "iterations per step",
             "drift, 5 to 60 s [nm/s]"),
            slopes),
    }  # fmt: skip


MEASURES: dict[str, Callable[[], dict[str, Any]]] = {
    "cube": pressing.press_cubes,
    "ball": pressing.press_balls,
    "calculix": pressing.press_by_calculix,
    "slope": lambda: {"slope": [slide(friction) for friction in FRICTIONS]},
    "self": self_contact.measure,
    "grip": grip.measure,
    "force_grip": force_grip.measure,
    "grasp": grasp.measure,
}


def probe() -> dict[str, float]:
    """Return the figures of pressed blocks, released slabs, first steps of the coarse cube and of the scene `grasp`."""
    found: dict[str, float] = {}
    for cells in self_contact.CELLS[:1]:
        row = self_contact.press_blocks(*cells)
        found |= {f"blocks of {cells} cells: {name}": row[name] for name in ("force", "iterations")}
    for friction in (FRICTIONS[0], FRICTIONS[-1]):
        slab = _slab(friction)
        for _ in range(SLID):
            slab.step()
        moved = float((slab.positions - slab.mesh.vertices)[:, 0].mean())
        found[f"slab with friction {friction:g}: moved down the slope [m]"] = moved
    pressed = pressing.press_cube(8, "faces", moves=2)
    found["cube on a ball: force [N]"] = sum(row["force"] for row in pressed)
    return found | first_steps("grasp", Simulation(load_scene("grasp")), None)


def main() -> None:
    """Run the measurement, write the report and print the tables."""
    parser = options("benchmarks.contact", "Contact beside others and theory.", "contact")
    parser.add_argument("part", nargs="*", help=f"only print these, as they are: {', '.join(MEASURES)}")
    given = parser.parse_args()
    if unknown := set(given.part) - set(MEASURES):
        parser.error(f"no part {', '.join(sorted(unknown))}; there are {', '.join(MEASURES)}")
    report: dict[str, Any] = {}
    for name in given.part or MEASURES:
        report |= MEASURES[name]()
    if given.part:
        print(json.dumps(report, indent=1))
        return
    write_report(given.out, report, probe())
    print("\n\n".join(all_tables(report).values()))


if __name__ == "__main__":
    main()
