# SPDX-License-Identifier: Apache-2.0
"""A robot with a pressure chamber, compared with FElupe on the same mesh, at pressures of the robot's whole program.

``python -m benchmarks.chamber [--out FILE]`` runs both (a few minutes), writes ``bending_tube_felupe.npz`` into
runs/chamber, and prints the table of docs/benchmark.md.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.chamber_reference import solve_chamber
from benchmarks.markdown import markdown_table
from benchmarks.report import options, write_report
from gdfe_ros.scene import Scene, load_scene
from gdfe_ros.simulation import Command, Simulation

SCENE, ACTUATOR, PROBE = "bending_tube", "air", "tip"
REFERENCE = Path("runs", "chamber", f"{SCENE}_felupe.npz")
PRESSURES = np.arange(1, 12) * 1e3
"""Compared pressures, up to the largest pressure of the program [Pa]."""
PACE = 27
"""Number of steps from one pressure to the next: about the rate of the program with 100 steps per second."""
ACROSS = ("tip", "tip_top")
"""Two probes; the angle is measured from the line between them."""


@dataclasses.dataclass(frozen=True)
class Followed:
    """Tip positions (k, 3) [m] and angles (k,) [degrees] at k pressures; total iterations and processor time [s]."""

    tip: NDArray[np.float64]
    angle: NDArray[np.float64]
    iterations: int
    seconds: float


def follow(scene: Scene, pressures: Sequence[float], *, tolerance: float | None = None, pace: int = PACE) -> Followed:
    """Solve for ascending pressures [Pa], in ``pace`` steps each, by default with the tolerance of the scene."""
    tolerance = scene.solver.tolerance if tolerance is None else tolerance
    simulation = Simulation(scene, settings=dataclasses.replace(scene.solver, tolerance=tolerance))
    simulation.warm_up()
    started, tips, angles, last, iterations = time.process_time(), [], [], 0.0, 0
    for pressure in pressures:
        for value in np.linspace(last, pressure, pace + 1)[1:]:
            result = simulation.step(Command(actuators={ACTUATOR: float(value)}), dt=1.0)
            iterations += result.iterations
            if not result.converged:
                raise RuntimeError(f"{scene.name} at {value:g} Pa: {result.message}")
        last = float(pressure)
        probes = simulation.probe_positions()
        across = probes[ACROSS[1]] - probes[ACROSS[0]]
        tips.append(probes[PROBE])
        angles.append(np.degrees(np.arctan2(across[0], across[2])))
    return Followed(np.array(tips), np.array(angles), iterations, time.process_time() - started)


def deviation(scene: Scene, tip: NDArray[np.float64], exact: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the distances (k,) of tips from the exact tips (k, 3) [m], divided by the exact tip displacements."""
    rest = scene.probes[PROBE].at(scene.mesh.vertices)[0]
    return np.linalg.norm(tip - exact, axis=1) / np.linalg.norm(exact - rest, axis=1)


def chamber_table(report: dict[str, Any]) -> str:
    """Return the comparison as a Markdown table."""
    rows = [
        (f"{pressure / 1e3:g}", f"{angle:.1f}", _millimetres(exact), _millimetres(tip), f"{100 * error:.2f}")
        for pressure, angle, exact, tip, error in zip(
            *(report[key] for key in ("pressure", "angle", "felupe", "tip", "error")), strict=True
        )
    ]
    rows.append(("time of all", "", f"{report['felupe_seconds']:.0f} s", f"{report['seconds']:.2f} s", ""))
    head = "pressure [kPa]", "angle [degrees]", "FElupe, H20: tip x, z [mm]", "gdfe_ros: tip x, z [mm]"
    return markdown_table((*head, "difference [% of tip displacement]"), rows)


def probe() -> dict[str, float]:
    """Return angle and iterations at the first pressure."""
    found = follow(load_scene(SCENE), PRESSURES[:1])
    return {"angle [degrees]": float(found.angle[0]), "iterations": found.iterations}


def main() -> None:
    """Run both solvers, write the report and print the table."""
    given = options("benchmarks.chamber", "A chamber robot beside FElupe.", "chamber").parse_args()
    from pypardiso import spsolve

    scene = load_scene(SCENE)
    ours = follow(scene, PRESSURES)
    chamber = next(actuator for actuator in scene.actuators if actuator.name == ACTUATOR)
    started = time.process_time()
    exact = solve_chamber(scene, chamber, PROBE, PRESSURES, solver=spsolve)
    seconds = time.process_time() - started
    report = {
        "cells": scene.mesh.n_cells,
        "pressure": PRESSURES.tolist(),
        "angle": ours.angle.tolist(),
        "felupe": exact.tolist(),
        "tip": ours.tip.tolist(),
        "error": deviation(scene, ours.tip, exact).tolist(),
        "felupe_seconds": seconds,
        "seconds": ours.seconds,
    }
    write_report(given.out, report, probe())
    REFERENCE.parent.mkdir(parents=True, exist_ok=True)
    np.savez(REFERENCE, pressure=PRESSURES, tip=exact)
    print(chamber_table(report))


def _millimetres(point: Sequence[float]) -> str:
    return f"{1e3 * point[0]:.2f}, {1e3 * point[2]:.2f}"


if __name__ == "__main__":
    main()
