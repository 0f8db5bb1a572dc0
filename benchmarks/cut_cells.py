# SPDX-License-Identifier: Apache-2.0
"""Bending stiffness of a voxel cylinder, divided by E I: with whole cubes and with cut cells.

``python -m benchmarks.cut_cells [--out FILE]`` prints the table of docs/theory/cut_cells.md.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
import trimesh

from benchmarks.markdown import markdown_table
from benchmarks.report import options, write_report
from gdfe_ros.command import Command
from gdfe_ros.constraints import Pose
from gdfe_ros.mesh.packing import pack_mesh
from gdfe_ros.mesh.voxels import CutCubes, fill_surface
from gdfe_ros.scene import scene_from_text
from gdfe_ros.simulation import Simulation

RADIUS, LENGTH, YOUNG, POISSON = 0.01, 0.06, 1e5, 0.3
SECTIONS = 360
"""Number of sides of the prism that replaces the cylinder; its second moment is 2e-4 below that of the circle."""
ANGLE = 1e-3
"""Rotation of each end [rad]; it is small, so that linear theory is valid."""
MIDDLE = 0.25
"""Middle fraction of the length over which the curvature is measured, away from the clamped ends."""
HELD = 0.95
"""Fraction of half the length beyond which vertices belong to the rotated ends."""
FINENESS = (4, 6, 8, 12)
"""Numbers of cells over the diameter."""
KINDS = ("whole", "cut")
DIRECTIONS = (0.0, 30.0)
"""Angles of the cylinder's axis in the grid, from x towards y [degrees]."""


def cylinder(direction: float) -> trimesh.Trimesh:
    """Return the surface of the cylinder with its centre at the origin and its axis in the x-y plane."""
    body = trimesh.creation.cylinder(RADIUS, LENGTH, sections=SECTIONS)
    body.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [0, 1, 0]))
    return body.apply_transform(trimesh.transformations.rotation_matrix(np.radians(direction), [0, 0, 1]))


def bending_stiffness(fineness: int, cells: str, direction: float) -> dict[str, float]:
    """Rotate both ends of the cylinder so that it bends without shear, and return its bending stiffness.

    Args:
        fineness: number of cells over the diameter.
        cells: treatment of the cubes that the surface cuts, one of `KINDS`.
        direction: angle of the axis in the grid [degrees].

    Returns:
        ``stiffness``: moment / (curvature in the middle * E I of the circle); ``count`` of cells; ``iterations``.
    """
    cell, angle = 2.0 * RADIUS / fineness, np.radians(direction)
    axis, across = np.array([np.cos(angle), np.sin(angle), 0.0]), np.array([-np.sin(angle), np.cos(angle), 0.0])
    body = cylinder(direction)
    mesh = fill_surface(body.vertices, body.faces, cell=cell, cells=CutCubes(cells))
    along = mesh.vertices @ axis
    ends = [np.flatnonzero(sign * along > HELD * LENGTH / 2.0).tolist() for sign in (-1.0, 1.0)]
    scene = {
        "name": "cylinder",
        "mesh": {"embedded": pack_mesh(mesh)},
        "materials": {"soft": {"law": "linear", "young": YOUNG, "poisson": POISSON}},
        "regions": [{"material": "soft"}],
        "handles": {name: {"where": {"vertices": end}} for name, end in zip(("left", "right"), ends, strict=True)},
        "solver": {"tolerance": 1e-8, "max_iterations": 20000},
    }
    simulation = Simulation(scene_from_text(json.dumps(scene)))
    turned = {"left": Pose(rotation=tuple(ANGLE * across)), "right": Pose(rotation=tuple(-ANGLE * across))}
    result = simulation.step(Command(handles=turned))
    rest = mesh.vertices
    side, height = rest @ across, rest[:, 2]
    chosen = (np.abs(along) < MIDDLE * LENGTH / 2.0 + 0.5 * cell) & (np.hypot(side, height) < RADIUS)
    moved = ((result.positions - rest) @ axis)[chosen]
    terms = np.stack([np.ones_like(along), along, height, along * height], axis=1)[chosen]
    curvature = np.linalg.lstsq(terms / terms.max(axis=0), moved, rcond=None)[0][3] / terms[:, 3].max()
    moment = 0.5 * float((result.reactions["right"][3:] - result.reactions["left"][3:]) @ across)
    return {
        "stiffness": float(moment / curvature / (YOUNG * np.pi / 4.0 * RADIUS**4)),
        "count": mesh.n_cells,
        "iterations": result.iterations,
        "converged": result.converged,
    }


def all_tables(report: Mapping[str, Any]) -> dict[str, str]:
    """Return dict from name to table of a report."""
    rows = []
    for direction in DIRECTIONS:
        whole, cut = (report[f"{kind} {direction:g}"] for kind in KINDS)
        for fineness, a, b in zip(FINENESS, whole, cut, strict=True):
            errors = (f"{a['stiffness'] - 1.0:+.2%}", f"{b['stiffness'] - 1.0:+.3%}")
            rows.append([f"{direction:g}", f"{fineness}", *errors, f"{a['count']} / {b['count']}",
                         f"{a['iterations']} / {b['iterations']}"])  # fmt: skip
    heads = (
        "angle of the axis [degrees]", "cells across the diameter", "error, whole cubes", "error, cut cells",
        "number of cells", "iterations",
    )  # fmt: skip
    return {"cut_cells": markdown_table(heads, rows)}


def probe() -> dict[str, float]:
    """Return the figures of the coarsest cylinder of each kind whose axis is oblique to the grid."""
    found: dict[str, float] = {}
    for kind in KINDS:
        row = bending_stiffness(FINENESS[0], kind, DIRECTIONS[-1])
        found |= {f"{kind}: {name}": row[name] for name in ("count", "iterations")}
        found[f"{kind}: error"] = row["stiffness"] - 1.0
    return found


def main() -> None:
    """Run the measurement, write the report and print the table."""
    words = "Bending stiffness of a cylinder cut from voxels."
    given = options("benchmarks.cut_cells", words, "cut_cells").parse_args()
    report = {
        f"{kind} {direction:g}": [bending_stiffness(fineness, kind, direction) for fineness in FINENESS]
        for kind in KINDS
        for direction in DIRECTIONS
    }
    write_report(given.out, report, probe())
    print("\n\n".join(all_tables(report).values()))


if __name__ == "__main__":
    main()
