# SPDX-License-Identifier: Apache-2.0
"""A rigid box that two soft pads hold with just enough and with slightly too little friction, compared with MuJoCo."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from benchmarks.markdown import markdown_table
from benchmarks.peers import mujoco_grip
from benchmarks.peers.grip_case import SQUEEZE, STEP, WEIGHT
from benchmarks.peers.peer import PeerError
from gdfe_ros.command import Command
from gdfe_ros.constraints import Pose
from gdfe_ros.scene.loader import scene_from_text
from gdfe_ros.simulation import Simulation

GRIP = """
name: grip
mesh: {bar: {size: [0.10, 0.03, 0.03], cells: [20, 3, 3], cut: [{box: {x: [0.0375, 0.0625]}}]}}
materials: {soft: {law: neo_hookean, young: 2.0e5, poisson: 0.45, density: 1000}}
regions: [{material: soft}]
handles: {left: {where: {face: x-}}, right: {where: {face: x+}}}
loads: {weight: {gravity: [0, 0, -9.81]}}
bodies: {part: {box: {size: [0.02, 0.05, 0.05]}, density: 640, at: [0.05, 0, 0]}}
dynamics: {scheme: bdf2, step: 0.005, damping: {viscosity: 300}}
solver: {skip: []}
"""
"""Scene of the grip. No solve is skipped."""
HELD = {1.02: 60.0, 0.98: 1.0}
"""Dict from friction, divided by the least friction that holds the box, to the duration of the hold [s]."""
PEER_DEMANDS, PEER_HELD = (1.02, 2.0, 10.0, 46.0), 1.0
"""Frictions in MuJoCo, divided by the least friction that holds the box, and duration of the hold [s]. In MuJoCo the
box falls at 1.02, and creeps at larger values.
"""


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


def measure() -> dict[str, Any]:
    """Return the rows of the table, and messages if MuJoCo is missing or a run of it fails."""
    least = WEIGHT / (2.0 * grip(0.02, seconds=0.0)["press"])
    rows = [
        {"solver": "gdfe_ros", "demand": demand, "held": held, **grip(demand * least, seconds=held)}
        for demand, held in HELD.items()
    ]
    reason = mujoco_grip.available()
    if reason:
        return {"grip": rows, "grip_missing": [f"MuJoCo: {reason}"]}
    missing: list[str] = []
    for demand in PEER_DEMANDS:
        try:
            found = mujoco_grip.simulate(demand, seconds=PEER_HELD)
        except PeerError as error:
            missing.append(str(error))
            continue
        rows.append({"solver": "MuJoCo", "demand": demand, "held": PEER_HELD, **found})
    return {"grip": rows, "grip_missing": missing}


def all_tables(report: Mapping[str, Any]) -> dict[str, str]:
    """Return dict from name to the table of a report."""
    rows = [
        [row["solver"], f"{row['demand']:g}", _length(row["sunk"]), f"{row['held']:g}", _length(row["drift"])]
        for row in report["grip"]
    ]
    heads = (
        "solver",
        "friction / smallest possible",
        "sinking while loaded [um]",
        "duration of the hold [s]",
        "drift [um]",
    )
    return {"grip": "\n\n".join([markdown_table(heads, rows), *report["grip_missing"]])}


def _length(metres: float) -> str:
    """Return a length in micrometres as text, or ``falls`` for a length of at least the width of a pad."""
    return f"{1e6 * metres:.3g}" if abs(metres) < 0.03 else "falls"
