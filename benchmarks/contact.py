# SPDX-License-Identifier: Apache-2.0
"""Contact beside finite elements of others and theory: a cube on a ball, a ball between plates, a slab on a slope.

``make bench-contact`` writes runs/contact/contact.json and prints the tables of docs/theory/contact.md;
``python -m benchmarks.contact runs/contact grip`` only measures that part anew.
"""

from __future__ import annotations

import json
import math
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import brentq

from benchmarks import grasp, grip, self_contact
from benchmarks.markdown import markdown_table
from gdfe_ros.command import Command
from gdfe_ros.constraints import Pose
from gdfe_ros.mesh import HexMesh
from gdfe_ros.mesh.generators import bar
from gdfe_ros.scene.loader import scene_from_text
from gdfe_ros.simulation import Simulation

REFERENCE = Path(__file__).parents[1] / "test" / "data" / "reference" / "contact_block_on_ball.npz"
QUADRATIC = {0.006: 30.3, 0.008: 45.1, 0.01: 64.4, 0.012: 84.8, 0.014: 106.7, 0.016: 128.9, 0.018: 153.0, 0.02: 178.8}
"""Force [N] on the cube over the ball's move [m], quadratic elements on 16^3 cells, by the makers of the reference."""
CUBE = """
name: cube
mesh: {bar: {size: [0.1, 0.1, 0.1], cells: [16, 16, 16]}}
materials: {soft: {law: neo_hookean, young: 2.0e5, poisson: 0.45, density: 1000}}
regions: [{material: soft}]
handles: {top: {where: {face: z+}, fixed: true}}
obstacles: {ball: {sphere: {radius: 0.04}, at: [0.05, 0, -0.09]}}
solver: {tolerance: 1.0e-5}
"""
BALL = """
name: ball
mesh: {bar: {size: [2, 2, 2], cells: [16, 16, 16]}}
materials: {soft: {law: linear, young: 1.0e5, poisson: 0.3}}
regions: [{material: soft}]
handles: {centre: {where: {sphere: {center: [1, 0, 0], radius: 0.01}}, fixed: true}}
obstacles:
  top: {plane: [0, 0, -1], at: [0, 0, 0.05]}
  bottom: {plane: [0, 0, 1], at: [0, 0, -0.05]}
"""
RADIUS, YOUNG, POISSON = 0.05, 1.0e5, 0.3
"""Of the ball [m], [Pa]."""
GRADING = 1.3
"""Its cells are smaller about the poles: those in the middle of a face have a width as their distance to this power."""
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


def press_cube(cells: int, gaps: str) -> list[dict[str, Any]]:
    """Press a cube of ``cells``^3 cells onto a ball; return move [m], force [N], work and time of each step."""
    overrides = {"mesh.bar.cells": [cells] * 3, "obstacles.ball.gaps": gaps}
    simulation, rows = Simulation(scene_from_text(CUBE, overrides=overrides)), []
    simulation.warm_up()
    with np.load(REFERENCE) as reference:
        moves = np.round(reference["moves"], 6).tolist()
    for move in moves:
        began = time.process_time()
        result = simulation.step(Command(handles={"ball": Pose((0.0, 0.0, move))}))
        assert result.converged, result.message
        rows.append(
            {
                "move": move,
                "force": float(result.reactions["ball"][2]),
                "deepest": float(-result.contacts["ball"].gaps.min(initial=0.0)),
                "iterations": result.iterations,
                "seconds": time.process_time() - began,
            }
        )
    return rows


def ball_between_plates(*, cells: int, approaches: Sequence[float]) -> dict[float, float]:
    """Return the force [N] of each of two plates that approach a ball's centre by so much [m]."""
    scene = scene_from_text(BALL)
    cube = bar([2.0, 2.0, 2.0], [cells] * 3)
    even = cube.vertices - [1.0, 0.0, 0.0]
    x, y, z = (np.sign(even) * np.abs(even) ** GRADING).T
    round_ones = [a * np.sqrt(1 - b * b / 2 - c * c / 2 + b * b * c * c / 3) for a, b, c in
                  ((x, y, z), (y, z, x), (z, x, y))]  # fmt: skip
    mesh = HexMesh(RADIUS * np.stack(round_ones, axis=1), cube.cells)
    middle = np.flatnonzero(np.linalg.norm(mesh.vertices, axis=1) < 1e-9).astype(np.int32)
    handles = [replace(handle, vertices=middle) if handle.name == "centre" else handle for handle in scene.handles]
    made = replace(scene, mesh=mesh, cell_material=np.zeros(mesh.n_cells, np.int32), handles=tuple(handles))
    simulation, forces = Simulation(made), {}
    for approach in approaches:
        plates = {"top": Pose((0.0, 0.0, -approach)), "bottom": Pose((0.0, 0.0, approach))}
        result = simulation.step(Command(handles=plates))
        assert result.converged, result.message
        forces[approach] = float(result.reactions["bottom"][2])
    return forces


def hertz(approach: float) -> float:
    """Return the force [N] at which a half space of the ball's curvature gives way by so much [m]."""
    return 4.0 / 3.0 * YOUNG / (1.0 - POISSON**2) * math.sqrt(RADIUS) * approach**1.5


def tatara(approach: float) -> float:
    """Return the same of a ball, whose other side is pressed, too (Tatara 1991, first order)."""

    def too_far(force: float) -> float:
        contact = (0.75 * (1.0 - POISSON**2) * force * RADIUS / YOUNG) ** (1.0 / 3.0)
        local = 0.75 * (1.0 - POISSON**2) * force / (YOUNG * contact)
        far = math.hypot(contact, 2.0 * RADIUS)
        back = 2.0 * (1.0 + POISSON) * RADIUS**2 / far**3 + (1.0 - POISSON**2) / far
        return local - back * force / (math.pi * YOUNG) - approach

    return brentq(too_far, 1e-9, 10.0 * hertz(approach))


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
    with np.load(REFERENCE) as reference:
        same = dict(zip(np.round(reference["moves"], 6).tolist(), reference["force_16"].tolist(), strict=True))
    vertices, faces, coarse = (report["cube"][name] for name in ("16 vertices", "16 faces", "8 faces"))
    pressed = [
        [f"{1e3 * row['move']:g}", f"{same[row['move']]:.2f}", f"{row['force']:.2f}", f"{QUADRATIC[row['move']]:.1f}",
         f"{fine['force']:.2f}", f"{rough['force']:.2f}", f"{row['iterations']} / {fine['iterations']}"]
        for row, fine, rough in zip(vertices, faces, coarse, strict=True) if row["move"] in QUADRATIC
    ]  # fmt: skip
    balls = [
        [f"{row['approach'] / RADIUS:g}", f"{row['hertz']:.3f}", f"{row['tatara']:.3f}", f"{row['force']:.3f}"]
        for row in report["ball"]
    ]
    slopes = [
        [f"{row['friction']:g}", f"{row['wanted']:.4f}", f"{row['acceleration']:.4f}", f"{row['iterations']:.1f}",
         "slides" if row["drift"] is None else f"{1e9 * row['drift']:.2g}"]
        for row in report["slope"]
    ]  # fmt: skip
    return {
        **grip.all_tables(report),
        **grasp.all_tables(report),
        "pressing": markdown_table(
            ("move [mm]", "same cells, other code", "gaps: vertices", "quadratic", "gaps: faces", "on 8^3 cells",
             "iterations"), pressed),
        **self_contact.all_tables(report),
        "plates": markdown_table(("approach over radius", "Hertz [N]", "Tatara [N]", "here [N]"), balls),
        "slope": markdown_table(
            ("friction", "theory [m/s^2]", "here [m/s^2]", "iterations a step", "drift over 60 s [nm/s]"), slopes),
    }  # fmt: skip


def press_cubes() -> dict[str, Any]:
    """Press the cube with other cells and gaps."""
    kinds = ((16, "vertices"), (16, "faces"), (8, "faces"))
    return {"cube": {f"{cells} {gaps}": press_cube(cells, gaps) for cells, gaps in kinds}}


def press_balls() -> dict[str, Any]:
    """Press the ball, with what theory says beside it."""
    found = ball_between_plates(cells=20, approaches=[share * RADIUS for share in (0.02, 0.04, 0.06, 0.08, 0.1)])
    rows = [{"approach": by, "force": force, "hertz": hertz(by), "tatara": tatara(by)} for by, force in found.items()]
    return {"ball": rows}


MEASURES: dict[str, Callable[[], dict[str, Any]]] = {
    "cube": press_cubes,
    "ball": press_balls,
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
