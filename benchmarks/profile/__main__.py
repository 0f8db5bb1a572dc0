# SPDX-License-Identifier: Apache-2.0
"""Prints the times of a step's phases, and the kernels' times relative to the machine's limits: ``make profile``."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from benchmarks.markdown import markdown_table
from benchmarks.profile.machine import Machine, fastest
from benchmarks.profile.operations import bar_of, counts
from benchmarks.profile.phases import (
    ARCS,
    ENERGIES,
    EVALUATIONS,
    LOOP,
    REST,
    ROTATIONS,
    SOLVES,
    STABILITY,
    TANGENTS,
    UPDATES,
    Phases,
)
from gdfe_ros.scene import load_scene
from gdfe_ros.simulation import Simulation
from gdfe_ros.solver.elements.barrier import NONE
from gdfe_ros.solver.elements.blocks import GEOMETRY_ROWS
from gdfe_ros.solver.elements.response import evaluate
from gdfe_ros.solver.matrix.constant_matrix import ConstantMatrix, assemble
from gdfe_ros.steppers import scene_body

PHASES = (EVALUATIONS, SOLVES, ROTATIONS, ARCS, LOOP, TANGENTS, STABILITY, UPDATES, ENERGIES, REST)
NUMBER = 8
"""Size of a number [B]."""
ELEMENT = 8 * 4 + (24 + GEOMETRY_ROWS + 5) * NUMBER + (24 + 1) * NUMBER
"""Data of an element [B] that an evaluation reads (corners, geometry, moduli, pressure) and writes (forces, energy)."""


@dataclass(frozen=True)
class Play:
    """A scene's program in ``steps`` steps; None means the number in the scene's settings, a cold solve."""

    scene: str
    steps: int | None
    overrides: dict[str, Any] = field(default_factory=dict)


PLAYS = {
    "bend5, streamed": Play("bend5", 200),
    "bend5, cold": Play("bend5", None),
    "twist90, streamed": Play("twist90", 90),
    "tendon_finger": Play("tendon_finger", 150),
    "bend5 10x1x1, streamed": Play("bend5", 400, {"mesh.bar.cells": [10, 1, 1]}),
}


def phase_table() -> str:
    """Return the table with the time of each phase per step, for each of `PLAYS`."""
    rows = []
    for name, play in PLAYS.items():
        phases = Phases.played(Simulation(load_scene(play.scene, overrides=play.overrides)), play.steps)
        whole, steps = sum(phases.seconds.values()), phases.calls[REST]
        cells = [
            f"{1e3 * phases.seconds[phase] / steps:.2f} ({100.0 * phases.seconds[phase] / whole:.0f} %)"
            if phases.seconds[phase]
            else "-"
            for phase in PHASES
        ]
        rows.append((name, f"{1e3 * whole / steps:.2f}", *cells))
    return markdown_table(("play", "a step [ms]", *PHASES), rows)


def element_table(machine: Machine) -> str:
    """Return the table with the time of an evaluation per element, and the least time that the machine allows."""
    rows = []
    for law, operations in counts().items():
        body = bar_of(law, (50, 5, 5))
        count, positions = len(body.material), 1.02 * body.rest + 0.05 * np.sin(body.rest[:, ::-1])
        force, energy = np.zeros((count, 8, 3)), np.zeros(count)
        given = body.shape, body.blocks, body.material, np.zeros(count), np.ones(count), body.table, NONE
        taken = fastest(lambda given=given, x=positions, f=force, e=energy: evaluate(x, *given, f, e, None)) / count
        arithmetic, traffic = operations / machine.peak, ELEMENT / machine.bandwidth
        cells = (f"{1e9 * value:.0f}" for value in (taken, arithmetic, traffic))
        rows.append((law, *cells, f"{operations:.0f}"))
    heads = ("law", "an element [ns]", "its operations at the peak [ns]", "its bytes from memory [ns]", "operations")
    return markdown_table(heads, rows)


def solve_table(machine: Machine) -> str:
    """Return the table with the time of a solve with each matrix, and the memory traffic of its factor."""
    rows = []
    for scene in ("bend5", "tendon_finger", "pneunet"):
        body = scene_body(load_scene(scene), np.zeros(3))
        count = len(body.material)
        assembled = assemble(body.shape, np.ones(count), np.ones(count), len(body.rest))
        matrix, free = ConstantMatrix(assembled, body.rest, body.unknowns), body.unknowns.free
        right, out = np.ones((len(free), 3)), np.empty((len(free), 3))
        taken = fastest(lambda matrix=matrix, right=right, out=out: matrix.solve(right, out))
        factor = int(matrix.coupling.inverse.value_start[-1])
        rows.append(_solve_row(scene, "constant", len(free), factor, taken, 2 * factor * NUMBER / machine.bandwidth))
        level = Simulation(load_scene(scene)).stepper.equilibrium.minimiser.level
        gradient, step, values = *np.ones((2, 3 * body.unknowns.rows)), level.kept.values
        taken = fastest(lambda level=level, given=(gradient, step): level.solve(*given))
        least = 2 * values.nbytes / machine.bandwidth
        rows.append(_solve_row(scene, "tangent", len(free), len(values), taken, least))
    heads = ("scene", "matrix", "free vertices", "entries of a factor", "a solve [us]", "its bytes [us]")
    return markdown_table(heads, rows)


def _solve_row(scene: str, matrix: str, free: int, entries: int, *seconds: float) -> tuple[str, ...]:
    return scene, matrix, str(free), str(entries), *(f"{1e6 * value:.0f}" for value in seconds)


def main() -> None:
    """Run the measurements and print the tables."""
    machine = Machine.measured()
    print(f"One core: {machine.peak / 1e9:.1f} GFlop/s, {machine.bandwidth / 1e9:.1f} GB/s\n")
    for table in (phase_table(), element_table(machine), solve_table(machine)):
        print(f"{table}\n")


if __name__ == "__main__":
    main()
