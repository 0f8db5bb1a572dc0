# SPDX-License-Identifier: Apache-2.0
"""Frictionless contact compared with other solvers: a cube on a rigid ball, a ball between rigid plates."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from benchmarks.cases import LogNeoHooke
from benchmarks.markdown import markdown_table
from benchmarks.peers import ccx_contact
from gdfe_ros.command import Command
from gdfe_ros.constraints import Pose
from gdfe_ros.mesh import HexMesh
from gdfe_ros.mesh.generators import bar
from gdfe_ros.scene.loader import scene_from_text
from gdfe_ros.simulation import Simulation

REFERENCE = Path(__file__).parents[1] / "test" / "data" / "reference" / "contact_block_on_ball.npz"
QUADRATIC = {0.006: 30.3, 0.008: 45.1, 0.01: 64.4, 0.012: 84.8, 0.014: 106.7, 0.016: 128.9, 0.018: 153.0, 0.02: 178.8}
"""Dict from displacement of the ball [m] to the force on the cube [N]. The authors of the reference computed the forces
with quadratic elements on 16^3 cells.
"""
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
handles:
  centre: {where: {sphere: {center: [1, 0, 0], radius: 0.01}}, fixed: true}
  east: {where: {sphere: {center: [2, 0, 0], radius: 0.01}}, free: [x, y]}
  north: {where: {sphere: {center: [1, 1, 0], radius: 0.01}}, free: [x, y]}
obstacles:
  top: {plane: [0, 0, -1], at: [0, 0, 0.05]}
  bottom: {plane: [0, 0, 1], at: [0, 0, -0.05]}
"""
RADIUS, YOUNG, POISSON = 0.05, 1.0e5, 0.3
"""Radius [m], Young's modulus [Pa] and Poisson's ratio of the ball."""
APPROACHES = tuple(share * RADIUS for share in (0.02, 0.04, 0.06, 0.08, 0.1))
"""Displacements of each plate towards the ball's centre [m]."""
QUADRATIC_CELLS, AROUND = 12, 16
"""Numbers of CalculiX' cells along the cube's edges, and along an eighth of the ball's circumference."""
_MOVES = (0.002, 0.004, *QUADRATIC)
GRADING = 1.3
"""Exponent of the grading of the ball's mesh: lattice coordinates are raised to this power, so that cells near the
poles are smaller.
"""


def press_cube(cells: int, gaps: str, *, moves: int | None = None) -> list[dict[str, Any]]:
    """Press a ball into a cube of ``cells``^3 cells; return force [N], depth [m], iterations and time [s] of each step.

    ``moves`` is the number of steps; None means all steps.
    """
    overrides = {"mesh.bar.cells": [cells] * 3, "obstacles.ball.gaps": gaps}
    simulation, rows = Simulation(scene_from_text(CUBE, overrides=overrides)), []
    simulation.warm_up()
    with np.load(REFERENCE) as reference:
        all_moves = np.round(reference["moves"], 6).tolist()
    for move in all_moves[:moves]:
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


def ball_between_plates(*, cells: int, approaches: Sequence[float], law: str = "linear") -> dict[float, float]:
    """Return dict from approach of each of two plates towards a ball's centre [m] to their force [N].

    The centre is fixed, and two points of the equator stay in the plane of the equator. Without these two points the
    ball, whose surface has facets, would rotate until a flatter part is in contact.
    """
    scene = scene_from_text(BALL, overrides={"materials.soft.law": law})
    cube = bar([2.0, 2.0, 2.0], [cells] * 3)
    even = cube.vertices - [1.0, 0.0, 0.0]
    x, y, z = (np.sign(even) * np.abs(even) ** GRADING).T
    round_ones = [a * np.sqrt(1 - b * b / 2 - c * c / 2 + b * b * c * c / 3) for a, b, c in
                  ((x, y, z), (y, z, x), (z, x, y))]  # fmt: skip
    mesh = HexMesh(RADIUS * np.stack(round_ones, axis=1), cube.cells)
    places = {"centre": (0.0, 0.0, 0.0), "east": (RADIUS, 0.0, 0.0), "north": (0.0, RADIUS, 0.0)}
    handles = [
        replace(handle, vertices=_vertex_at(mesh, places[handle.name])) if handle.name in places else handle
        for handle in scene.handles
    ]
    made = replace(scene, mesh=mesh, cell_material=np.zeros(mesh.n_cells, np.int32), handles=tuple(handles))
    simulation, forces = Simulation(made), {}
    for approach in approaches:
        plates = {"top": Pose((0.0, 0.0, -approach)), "bottom": Pose((0.0, 0.0, approach))}
        result = simulation.step(Command(handles=plates))
        assert result.converged, result.message
        forces[approach] = float(result.reactions["bottom"][2])
    return forces


def _vertex_at(mesh: HexMesh, place: tuple[float, float, float]) -> NDArray[np.int32]:
    """Return the vertex (1,) at the position ``place`` [m]."""
    return np.flatnonzero(np.linalg.norm(mesh.vertices - place, axis=1) < 1e-9).astype(np.int32)


def hertz(approach: float) -> float:
    """Return Hertz's force [N] for a half space with the ball's curvature that is indented by ``approach`` [m]."""
    return 4.0 / 3.0 * YOUNG / (1.0 - POISSON**2) * math.sqrt(RADIUS) * approach**1.5


def tatara(approach: float) -> float:
    """Return the force [N] on a ball that is compressed by ``approach`` [m] from both sides (Tatara 1991, order 1)."""

    def too_far(force: float) -> float:
        contact = (0.75 * (1.0 - POISSON**2) * force * RADIUS / YOUNG) ** (1.0 / 3.0)
        local = 0.75 * (1.0 - POISSON**2) * force / (YOUNG * contact)
        far = math.hypot(contact, 2.0 * RADIUS)
        back = 2.0 * (1.0 + POISSON) * RADIUS**2 / far**3 + (1.0 - POISSON**2) / far
        return local - back * force / (math.pi * YOUNG) - approach

    return brentq(too_far, 1e-9, 10.0 * hertz(approach))


def press_cubes() -> dict[str, Any]:
    """Return the results for the cube with several numbers of cells and kinds of gaps."""
    kinds = ((16, "vertices"), (16, "faces"), (8, "faces"))
    return {"cube": {f"{cells} {gaps}": press_cube(cells, gaps) for cells, gaps in kinds}}


def press_balls() -> dict[str, Any]:
    """Return the forces on the ball for two material laws, and the forces according to Hertz and Tatara [N]."""
    found, rubber = (ball_between_plates(cells=20, approaches=APPROACHES, law=law) for law in ("linear", "neo_hookean"))
    return {
        "ball": [
            {"approach": by, "force": found[by], "rubber": rubber[by], "hertz": hertz(by), "tatara": tatara(by)}
            for by in APPROACHES
        ]
    }


def press_by_calculix() -> dict[str, Any]:
    """Return CalculiX' forces [N] for cube and ball, or the reason why it cannot be run."""
    reason = ccx_contact.available()
    if reason is not None:
        return {"calculix": {"missing": f"CalculiX: {reason}"}}
    cube, ball = LogNeoHooke(young=2.0e5, poisson=0.45), LogNeoHooke(young=YOUNG, poisson=POISSON)
    forces = ccx_contact.press_cube(cube, QUADRATIC_CELLS, _MOVES)
    small, large = (ccx_contact.press_ball(ball, RADIUS, AROUND, APPROACHES, large=large) for large in (False, True))
    return {"calculix": {"cube": forces, "small": small, "large": large}}


def all_tables(report: Mapping[str, Any]) -> dict[str, str]:
    """Return dict from name to table of a report."""
    with np.load(REFERENCE) as reference:
        same = dict(zip(np.round(reference["moves"], 6).tolist(), reference["force_16"].tolist(), strict=True))
    peer, below = report["calculix"], [report["calculix"]["missing"]] if "missing" in report["calculix"] else []
    other = dict(zip(_MOVES, peer.get("cube", ()), strict=False))
    vertices, faces, coarse = (report["cube"][name] for name in ("16 vertices", "16 faces", "8 faces"))
    pressed = [
        [f"{1e3 * row['move']:g}", f"{same[row['move']]:.2f}", f"{row['force']:.2f}", f"{QUADRATIC[row['move']]:.1f}",
         _newtons(other.get(row["move"])), f"{fine['force']:.2f}", f"{rough['force']:.2f}",
         f"{row['iterations']} / {fine['iterations']}"]
        for row, fine, rough in zip(vertices, faces, coarse, strict=True) if row["move"] in QUADRATIC
    ]  # fmt: skip
    balls = [
        [f"{row['approach'] / RADIUS:g}", _newtons(row["hertz"]), _newtons(row["tatara"]), _newtons(small),
         _newtons(large), _newtons(row["rubber"]), _newtons(row["force"])]
        for row, small, large in zip_longest(report["ball"], peer.get("small", ()), peer.get("large", ()))
    ]  # fmt: skip
    cube_heads = (
        "move of the ball [mm]", "same cells, other code", "gaps: vertices", "quadratic cells",
        f"CalculiX, {QUADRATIC_CELLS}^3 cells", "gaps: faces", "gaps: faces, 8^3 cells", "iterations",
    )  # fmt: skip
    ball_heads = (
        "approach / radius", "Hertz", "Tatara", "CalculiX, small displacements", "CalculiX, neo-Hookean",
        "gdfe_ros, neo-Hookean", "gdfe_ros, linear",
    )  # fmt: skip
    tables = {"pressing": markdown_table(cube_heads, pressed), "plates": markdown_table(ball_heads, balls)}
    return {name: "\n\n".join([table, *below]) for name, table in tables.items()}


def _newtons(force: float | None) -> str:
    return "-" if force is None else f"{force:.2f}" if force > 20.0 else f"{force:.3f}"
