# SPDX-License-Identifier: Apache-2.0
"""Contact of a body with itself: stacked blocks with different cells, and a finger whose notches close."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.markdown import markdown_table
from gdfe_ros.actuators.load import corner_areas
from gdfe_ros.command import Command
from gdfe_ros.constraints import Pose
from gdfe_ros.constraints.obstacle import NAME, SelfContact
from gdfe_ros.mesh import HexMesh
from gdfe_ros.mesh.generators import bar
from gdfe_ros.scene.loader import load_scene, scene_from_text
from gdfe_ros.simulation import Simulation
from gdfe_ros.solver.result import StepResult

STACK = """
name: stack
mesh: {bar: {size: [0.05, 0.05, 0.1], cells: [2, 2, 2]}}
materials: {soft: {law: neo_hookean, young: 2.0e5, poisson: 0.0, density: 1000}}
regions: [{material: soft}]
handles: {low: {where: {face: z-}, fixed: true}, high: {where: {face: z+}}}
self_contact: {}
solver: {tolerance: 1.0e-5}
"""
GAP, PRESSED = 2e-4, 0.0052
"""Initial gap between the blocks of a stack, and downward displacement of the upper block [m]."""
TENSIONS = (3.0, 6.0, 9.0, 12.0, 15.0)
"""Tensions of the finger's flexor [N]."""
CELLS = ((4, 4), (4, 3), (2, 5))
"""Pairs of numbers of cells along the edges of the lower and of the upper block."""


def stack(low: int, high: int, *, friction: float = 0.0) -> Simulation:
    """Return a simulation of two stacked cubes of 50 mm, with ``low`` and ``high`` cells along their edges."""
    scene = scene_from_text(STACK)
    below, above = bar([0.05] * 3, [low] * 3), bar([0.05] * 3, [high] * 3)
    lift = np.array([0.0, 0.0, 0.025 + 0.5 * GAP])
    vertices = np.concatenate([below.vertices - lift, above.vertices + lift])
    mesh = HexMesh(vertices, np.concatenate([below.cells, above.cells + below.n_vertices]))
    ends = {"low": vertices[:, 2].min(), "high": vertices[:, 2].max()}
    handles = [
        replace(handle, vertices=np.flatnonzero(np.isclose(vertices[:, 2], ends[handle.name])).astype(np.int32))
        for handle in scene.handles
    ]
    parts = {"mesh": mesh, "cell_material": np.zeros(mesh.n_cells, np.int32), "handles": tuple(handles)}
    return Simulation(replace(scene, **parts, self_contact=SelfContact(quads=mesh.surface(), friction=friction)))


def pressures(simulation: Simulation, result: StepResult) -> list[np.ndarray]:
    """Return the pressures [Pa] at the vertices of the lower block's top and of the upper block's bottom."""
    rest, quads, touch = simulation.mesh.vertices, simulation.mesh.surface(), result.contacts[NAME]
    forces, found = np.zeros_like(rest), []
    forces[touch.vertices] = touch.forces
    for side in (-1.0, 1.0):
        own = quads[np.isclose(rest[quads][:, :, 2], 0.5 * side * GAP).all(axis=1)]
        areas = np.bincount(own.ravel(), corner_areas(rest, own).ravel(), len(rest))
        found.append(side * forces[areas > 0.0, 2] / areas[areas > 0.0])
    return found


def press_blocks(low: int, high: int) -> dict[str, Any]:
    """Press one block onto another; return the force [N] and the largest relative deviation from the mean pressure."""
    simulation = stack(low, high)
    result = simulation.step(Command(handles={"high": Pose((0.0, 0.0, -PRESSED))}))
    assert result.converged, result.message
    spread = max(float(np.abs(own / own.mean() - 1.0).max()) for own in pressures(simulation, result))
    return {
        "cells": [low, high],
        "force": float(-result.reactions["high"][2]),
        "spread": spread,
        "rest": float(np.abs(result.contacts[NAME].forces.sum(axis=0)).max()),
        "iterations": result.iterations,
    }


def close_notches(tensions: Sequence[float] = TENSIONS) -> list[dict[str, float]]:
    """Pull the finger's tendon; return tip position, normal force, penetration depth, iterations, time of each step."""
    simulation, rows = Simulation(load_scene("tendon_finger", overrides={"self_contact": {}})), []
    simulation.warm_up()
    for tension in tensions:
        began = time.process_time()
        result = simulation.step(Command(actuators={"flexor": tension}))
        assert result.converged, result.message
        touch = result.contacts[NAME]
        rows.append(
            {
                "tension": tension,
                "tip": float(simulation.probe_positions()["tip"][0]),
                "press": float(0.5 * touch.presses.sum()),
                "deepest": float(-touch.gaps.min(initial=0.0)),
                "iterations": result.iterations,
                "seconds": time.process_time() - began,
            }
        )
    return rows


def measure() -> dict[str, Any]:
    """Return the data of the tables."""
    return {"blocks": [press_blocks(*cells) for cells in CELLS], "notches": close_notches()}


def all_tables(report: Mapping[str, Any]) -> dict[str, str]:
    """Return dict from name to table of a report."""
    blocks = [
        [
            f"{row['cells'][0]}^3 / {row['cells'][1]}^3",
            f"{row['force']:.3f}",
            f"{100.0 * row['spread']:.2g}",
            f"{row['rest']:.1g}",
            f"{row['iterations']}",
        ]
        for row in report["blocks"]
    ]
    notches = [
        [
            f"{row['tension']:g}",
            f"{1e3 * row['tip']:.2f}",
            f"{row['press']:.2f}",
            f"{1e6 * row['deepest']:.2g}",
            f"{row['iterations']}",
        ]
        for row in report["notches"]
    ]
    columns = (
        "cells of the lower / upper block", "force [N]", "pressure: deviation from its mean [%]",
        "sum of all contact forces [N]", "iterations",
    )  # fmt: skip
    across = ("tension [N]", "tip x [mm]", "contact force [N]", "deepest penetration [um]", "iterations")
    return {"blocks": markdown_table(columns, blocks), "notches": markdown_table(across, notches)}
