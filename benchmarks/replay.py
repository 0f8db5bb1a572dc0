# SPDX-License-Identifier: Apache-2.0
"""Figures of a few steps for a probe: sums over steps, which rounding does not move by a tenth."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import islice

import numpy as np

from gdfe_ros.simulation import Simulation
from gdfe_ros.solver.result import StepResult

ITERATIONS = ": iterations"
"""Ends the name of a count of iterations."""
STEPS = 5
"""Of a program that are replayed."""


def figures(name: str, results: Iterable[StepResult], simulation: Simulation) -> dict[str, float]:
    """Make steps; return the sum of their iterations and the mean displacement [m] at their end.

    Args:
        name: begins the figures' names.
        results: makes the steps as it is iterated over.
        simulation: makes them.
    """
    iterations = sum(result.iterations for result in results)
    moved = np.linalg.norm(simulation.positions - simulation.mesh.vertices, axis=1).mean()
    return {f"{name}{ITERATIONS}": iterations, f"{name}: moved [m]": float(moved)}


def first_steps(name: str, simulation: Simulation, steps: int | None, *, count: int = STEPS) -> dict[str, float]:
    """Play the first ``count`` of so many steps of a program; return `figures`."""
    return figures(name, islice(simulation.play(steps), count), simulation)


def summed(found: Mapping[str, float]) -> dict[str, float]:
    """Return figures with one sum of all iterations; those of a few steps of one body hinge on rounding."""
    kept = {name: value for name, value in found.items() if not name.endswith(ITERATIONS)}
    return kept | {"iterations of all": sum(value for name, value in found.items() if name not in kept)}
