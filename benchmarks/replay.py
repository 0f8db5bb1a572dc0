# SPDX-License-Identifier: Apache-2.0
"""Figures of a few steps for a probe: sums over steps, which rounding changes by less than a tenth."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import islice

import numpy as np

from gdfe_ros.results.step_result import StepResult
from gdfe_ros.simulation import Simulation

ITERATIONS = ": iterations"
"""Suffix of the name of a number of iterations."""
STEPS = 5
"""Number of steps of a program that are repeated."""


def figures(name: str, results: Iterable[StepResult], simulation: Simulation) -> dict[str, float]:
    """Make steps; return the sum of their iterations and the final mean displacement [m].

    Args:
        name: first part of the figures' names.
        results: iterator whose iteration makes the steps.
        simulation: simulation that makes the steps.
    """
    iterations = sum(result.iterations for result in results)
    moved = np.linalg.norm(simulation.positions - simulation.mesh.vertices, axis=1).mean()
    return {f"{name}{ITERATIONS}": iterations, f"{name}: moved [m]": float(moved)}


def first_steps(name: str, simulation: Simulation, steps: int | None, *, count: int = STEPS) -> dict[str, float]:
    """Play the first ``count`` steps of a program that has ``steps`` steps; return `figures`."""
    return figures(name, islice(simulation.play(steps), count), simulation)


def summed(found: Mapping[str, float]) -> dict[str, float]:
    """Return figures with the sum of all iterations instead of those of each body, which depend on rounding."""
    kept = {name: value for name, value in found.items() if not name.endswith(ITERATIONS)}
    return kept | {"iterations of all": sum(value for name, value in found.items() if name not in kept)}
