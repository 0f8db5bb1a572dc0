# SPDX-License-Identifier: Apache-2.0
"""True errors of stocky bars after one far step from rest: ``python -m benchmarks.torture.far_steps [SEED...]``.

Each seed gives forty random bars, 1.5 to 9 times as long as thick. Some sag under up to ten times their weight, the
others are held at both ends, bent and turned. The true error is the distance from the same step at a tolerance of 1e-8.
If that step ends in another equilibrium, more than `ELSEWHERE` of the size away, the two are not compared.
"""

from __future__ import annotations

import sys

import numpy as np

from benchmarks.torture.honesty import TOLERANCES, error_of
from gdfe_ros.constraints import Pose
from gdfe_ros.scene import scene_from_text
from gdfe_ros.simulation import Command, Simulation
from gdfe_ros.solver.result import StepResult

BARS = 40
"""Number of bars of a seed."""
TRUTH = 1e-8
ELSEWHERE = 0.03
"""Distance of another equilibrium, divided by the body's size."""
TEXT = """
name: far
mesh: {{bar: {{size: [{length}, 0.01, 0.01], cells: {cells}}}}}
materials: {{rubber: {{law: neo_hookean, young: 1.0e5, poisson: {poisson}, density: 1000}}}}
regions: [{{material: rubber}}]
handles: {{base: {{where: {{face: x-}}, fixed: true}}{tip}}}
{loads}
solver: {{tolerance: {tolerance}}}
"""
TIP = ", tip: {where: {face: x+}}"


def _played(words: dict[str, object], command: Command, tolerance: float) -> StepResult:
    return Simulation(scene_from_text(TEXT.format(**words, tolerance=tolerance))).step(command)


def errors(seed: int) -> list[float]:
    """Return the errors of the converged steps of a seed's bars, divided by the tolerances."""
    random, found = np.random.default_rng(seed), []
    for _ in range(BARS):
        ratio, across = random.uniform(1.5, 9.0), int(random.integers(2, 4))
        along = max(2, round(ratio * across * random.uniform(0.6, 1.0)))
        words = {"length": 0.01 * ratio, "cells": [along, across, across], "poisson": random.choice([0.3, 0.45, 0.49])}
        turn, shift = np.radians(random.uniform(-90, 90, 3)), 0.01 * ratio * random.uniform(-0.25, 0.25, 3)
        gravity, sags = 10.0 ** random.uniform(0.0, 2.0), random.random() < 0.4
        loads = f"loads: {{weight: {{gravity: [0, 0, -{gravity}]}}}}" if sags else ""
        words |= {"tip": "" if sags else TIP, "loads": loads}
        pose = Pose(tuple(shift.tolist()), tuple(turn.tolist()))
        command = Command(loads={"weight": 1.0}) if sags else Command(handles={"tip": pose})
        true = _played(words, command, TRUTH)
        for tolerance in TOLERANCES:
            result = _played(words, command, tolerance)
            error = error_of(result, true, 0.01 * ratio)
            if result.converged and true.converged and error < ELSEWHERE:
                found.append(error / tolerance)
    return found


def main() -> None:
    """Print the number of steps, how many end farther away than the tolerance, and the largest errors."""
    seeds = [int(text) for text in sys.argv[1:]] or [1, 2]
    found = np.sort([error for seed in seeds for error in errors(seed)])
    print(f"{len(found)} converged steps, {np.count_nonzero(found > 1.0)} of them beyond the tolerance;", end=" ")
    print("largest errors, divided by the tolerance:", ", ".join(f"{error:.2f}" for error in found[-5:]))


if __name__ == "__main__":
    main()
