# SPDX-License-Identifier: Apache-2.0
"""Contact compared with other solvers: a ball pressed into a cube beside CalculiX, a held box beside MuJoCo.

``make bench-contact`` writes a report into runs/bench and prints the tables of docs/theory/contact_measured.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from benchmarks.cases import LogNeoHooke
from benchmarks.markdown import markdown_table
from benchmarks.peers import ccx_contact, mujoco_grip
from benchmarks.peers.grip_case import SQUEEZE, STEP, WEIGHT
from benchmarks.peers.peer import attempt
from benchmarks.report import KEPT, run_script
from benchmarks.scenes import read_scene
from gdfe_ros.command import Command
from gdfe_ros.constraints import Pose
from gdfe_ros.scene.loader import scene_from_text
from gdfe_ros.simulation import Simulation

REFERENCE = KEPT / "reference" / "contact_block_on_ball.npz"
QUADRATIC = {0.006: 30.3, 0.008: 45.1, 0.01: 64.4, 0.012: 84.8, 0.014: 106.7, 0.016: 128.9, 0.018: 153.0, 0.02: 178.8}
"""Dict from displacement of the ball [m] to the force on the cube [N]. The authors of the reference computed the forces
with quadratic elements on 16^3 cells.
"""
CUBE = read_scene("pressed_cube.yaml")
KINDS = ((16, "vertices"), (16, "faces"), (8, "faces"))
"""Numbers of cells along an edge of the cube, and the scene's `gaps` of the ball."""
QUADRATIC_CELLS = 12
"""Number of CalculiX' cells along the cube's edges."""
MOVES = (0.002, 0.004, *QUADRATIC)
"""Successive displacements of CalculiX' ball [m]."""
GRIP = read_scene("grip.yaml")
"""Scene of the grip. No solve is skipped."""
HELD = {1.02: 60.0, 0.98: 1.0}
"""Dict from friction, divided by the least friction that holds the box, to the duration of the hold [s]."""
PEER_DEMANDS, PEER_HELD = (1.02, 2.0, 10.0, 46.0), 1.0
"""Frictions in MuJoCo, divided by the least friction that holds the box, and duration of the hold [s]. In MuJoCo the
box falls at 1.02, and creeps at larger values.
"""


def press_cube(cells: int, gaps: str, *, moves: int | None = None) -> list[dict[str, Any]]:
    """Press a ball into a cube of ``cells``^3 cells; return displacement [m], force [N] and iterations of each step.

    ``moves`` is the number of steps; None means all steps.
    """
    overrides = {"mesh.bar.cells": [cells] * 3, "obstacles.ball.gaps": gaps}
    simulation, rows = Simulation(scene_from_text(CUBE, overrides=overrides)), []
    with np.load(REFERENCE) as reference:
        all_moves = np.round(reference["moves"], 6).tolist()
    for move in all_moves[:moves]:
        result = simulation.step(Command(handles={"ball": Pose((0.0, 0.0, move))}))
        assert result.converged, result.message
        rows.append({"move": move, "force": float(result.reactions["ball"][2]), "iterations": result.iterations})
    return rows


def press_by_calculix() -> dict[str, Any]:
    """Return CalculiX' forces [N] on the cube, or the reason why it cannot be run."""
    reason = ccx_contact.available()
    if reason is not None:
        return {"missing": f"CalculiX: {reason}"}
    return {"cube": ccx_contact.press_cube(LogNeoHooke(young=2.0e5, poisson=0.45), QUADRATIC_CELLS, MOVES)}


def grip(friction: float, *, seconds: float) -> dict[str, float]:
    """Squeeze a box between two soft pads, apply its weight, and hold it for some ``seconds``.

    Returns:
        ``press``: normal force of a pad [N]; ``sunk``: descent of the box until the hold starts [m]; ``drift``: descent
        during the hold [m].
    """
    simulation = Simulation(scene_from_text(GRIP, overrides={"bodies.part.friction": friction}))
    simulation.step(Command(loads={"weight": 0.0}))
    for share in np.linspace(0.0, 1.0, 60):
        way = share * SQUEEZE
        simulation.step(Command(handles={"left": Pose((way, 0.0, 0.0)), "right": Pose((-way, 0.0, 0.0))}))
    for factor in [0.0] * 40 + np.linspace(0.0, 1.0, 160).tolist() + [1.0] * 60:
        result = simulation.step(Command(loads={"weight": float(factor)}))
    press, sunk = float(result.contacts["part"].presses.sum()) / 2.0, simulation.handle_pose("part").translation[2]
    for _ in range(round(seconds / STEP)):
        simulation.step()
    return {"press": press, "sunk": -sunk, "drift": sunk - simulation.handle_pose("part").translation[2]}


def measure_grips() -> dict[str, Any]:
    """Return the rows of the grip's table, and messages if MuJoCo is missing or a run of it fails."""
    least = WEIGHT / (2.0 * grip(0.02, seconds=0.0)["press"])
    rows = [
        {"solver": "gdfe_ros", "demand": demand, "held": held, **grip(demand * least, seconds=held)}
        for demand, held in HELD.items()
    ]

    def measure_peer(demand: float) -> dict[str, Any]:
        found = mujoco_grip.simulate(demand, seconds=PEER_HELD)
        return {"solver": "MuJoCo", "demand": demand, "held": PEER_HELD, **found}

    others, missing = attempt("MuJoCo", mujoco_grip, PEER_DEMANDS, measure_peer)
    return {"grip": rows + others, "grip_missing": missing}


def measure() -> dict[str, Any]:
    """Return the data of both tables."""
    cube = {f"{cells} {gaps}": press_cube(cells, gaps) for cells, gaps in KINDS}
    return {"cube": cube, "calculix": press_by_calculix(), **measure_grips()}


def all_tables(report: Mapping[str, Any]) -> dict[str, str]:
    """Return dict from name to table of a report."""
    rows = [
        [row["solver"], f"{row['demand']:g}", _length(row["sunk"]), f"{row['held']:g}", _length(row["drift"])]
        for row in report["grip"]
    ]
    heads = (
        "solver", "friction / smallest possible", "sinking while loaded [um]", "duration of the hold [s]", "drift [um]",
    )  # fmt: skip
    gripped = "\n\n".join([markdown_table(heads, rows), *report["grip_missing"]])
    return {"pressing": pressing_table(report), "grip": gripped}


def pressing_table(report: Mapping[str, Any]) -> str:
    """Return the table of the forces on the cube."""
    with np.load(REFERENCE) as reference:
        same = dict(zip(np.round(reference["moves"], 6).tolist(), reference["force_16"].tolist(), strict=True))
    peer = report["calculix"]
    other = dict(zip(MOVES, peer.get("cube", ()), strict=False))
    rows = [
        [f"{1e3 * row['move']:g}", f"{same[row['move']]:.2f}", f"{row['force']:.2f}", f"{QUADRATIC[row['move']]:.1f}",
         f"{other[row['move']]:.2f}" if other else "-", f"{fine['force']:.2f}", f"{rough['force']:.2f}",
         f"{row['iterations']} / {fine['iterations']}"]
        for row, fine, rough in zip(*(report["cube"][f"{cells} {gaps}"] for cells, gaps in KINDS), strict=True)
        if row["move"] in QUADRATIC
    ]  # fmt: skip
    heads = (
        "move of the ball [mm]", "same cells, other code", "gaps: vertices", "quadratic cells",
        f"CalculiX, {QUADRATIC_CELLS}^3 cells", "gaps: faces", "gaps: faces, 8^3 cells", "iterations",
    )  # fmt: skip
    return "\n\n".join([markdown_table(heads, rows), *filter(None, [peer.get("missing")])])


def _length(metres: float) -> str:
    """Return a length in micrometres as text, or ``falls`` for a length of at least the width of a pad."""
    return f"{1e6 * metres:.3g}" if abs(metres) < 0.03 else "falls"


def probe() -> dict[str, float]:
    """Return force and iterations of the first displacements of the ball into a coarse cube."""
    rows = press_cube(8, "faces", moves=2)
    names = {"force": "cube on a ball: force [N]", "iterations": "cube on a ball: iterations"}
    return {name: sum(row[key] for row in rows) for key, name in names.items()}


if __name__ == "__main__":
    run_script(
        "benchmarks.contact",
        "Contact beside others.",
        "contact",
        measure=measure,
        tables=all_tables,
        probe=probe,
    )
