# SPDX-License-Identifier: Apache-2.0
"""Our solver in the benchmark, run like any peer: scenes of config/scenes with several meshes and tolerances."""

from __future__ import annotations

from functools import lru_cache
from time import perf_counter
from typing import Any

import numba
import numpy as np

from benchmarks.cases import Case, CaseName
from benchmarks.peers.peer import Array, PeerError, PeerSolution, Variant
from gdfe_ros import __version__
from gdfe_ros.scene import Scene, load_scene
from gdfe_ros.simulation import Command, Simulation
from gdfe_ros.solver.settings import Policy

PAPER_TOLERANCE = {CaseName.BEND5: 1e-4, CaseName.TWIST90: 1e-5, CaseName.TENSILE: 1e-4, CaseName.TWIST90_UNIFORM: 1e-4}
"""Dict from scene to tolerance: the largest value of the form 1, 2 or 5 x 10^-k whose error on the paper's mesh meets
the limit of issue 3.
"""
_FRONT = {
    CaseName.BEND5: ((10, 1, 1), (20, 1, 1), (25, 2, 2), (30, 3, 3), (40, 4, 4)),
    CaseName.TWIST90: ((12, 3, 3), (16, 4, 4)),
    CaseName.TENSILE: ((12, 3, 3), (16, 4, 4), (30, 8, 8)),
    CaseName.TWIST90_UNIFORM: ((12, 3, 3), (16, 4, 4)),
}
_TOLERANCES = (1e-3, 1e-4)
_STREAM = {CaseName.BEND5: (200, 2e-4), CaseName.TWIST90: (100, 1e-4), CaseName.TWIST90_UNIFORM: (100, 1e-4)}
"""Dict from scene to the number of steps of a stream (1 mm or 0.9 degrees each), and the tolerance: the largest value
of the form 1, 2 or 5 x 10^-k whose error along the path is below 0.1 %.
"""


def available() -> str | None:
    """Return None, because this package is always available."""
    return None


def variants(case: Case) -> tuple[Variant, ...]:
    """Return the variants: the paper's mesh with both policies, other meshes and tolerances, and a stream."""
    runs = [_variant(case.cells, Policy.ENERGY, tolerance) for tolerance in {*_TOLERANCES, PAPER_TOLERANCE[case.name]}]
    runs += [_variant(cells, Policy.ENERGY, tolerance) for cells in _FRONT[case.name] for tolerance in _TOLERANCES]
    if case.name is not CaseName.TWIST90_UNIFORM:
        runs.append(_variant(case.cells, Policy.RELATIVE, 1e-4, steps=20))
    if case.name in _STREAM:
        steps, tolerance = _STREAM[case.name]
        meshes = (*_FRONT[case.name], case.cells)
        runs += [_variant(cells, Policy.ENERGY, tolerance, steps=steps, stream=True) for cells in meshes]
    return tuple(runs)


def _variant(
    cells: tuple[int, int, int], policy: Policy, tolerance: float, *, steps: int = 1, stream: bool = False
) -> Variant:
    label = f"{policy.value} {'x'.join(map(str, cells))} {tolerance:g}"
    return Variant(
        label=f"{label}, {steps} steps" if stream else label,
        element=policy.value,
        cells=cells,
        steps=steps,
        options={"policy": policy.value, "tolerance": tolerance, "stream": stream},
    )


def solve(case: Case, variant: Variant, points: Array) -> PeerSolution:
    """Build and solve a scene; kernels are compiled before, on a smaller mesh. See `Peer.solve`.

    Raises:
        PeerError: a step did not converge.
    """
    _compile(case.name.value, str(variant.options["policy"]))
    start = perf_counter()
    scene = scene_of(case.name.value, variant)
    simulation = Simulation(scene)
    built = perf_counter()
    iterations = _play(simulation, variant.steps)
    solved = perf_counter()
    if not simulation.result.converged:
        raise PeerError(f"gdfe {case.name.value} {variant.label}: {simulation.result.message}")
    settings: dict[str, Any] = {
        "version": __version__,
        "tolerance": variant.options["tolerance"],
        "iterations": iterations,
    }
    displacement = simulation.positions - scene.mesh.vertices
    return PeerSolution(
        displacement=case.grid(variant.cells).evaluate(displacement, points),
        reaction=simulation.result.reactions["tip"],
        time_setup=built - start,
        time_solve=solved - built,
        settings=settings,
    )


def _play(simulation: Simulation, steps: int) -> int:
    """Play the program in equal steps; return the sum of their iterations."""
    program = simulation.scene.program
    moments = np.linspace(0.0, program.duration, steps + 1)[1:]
    return sum(simulation.step(Command(handles=program.handle_poses(moment))).iterations for moment in moments)


def scene_of(name: str, variant: Variant) -> Scene:
    """Return the scene ``name`` with the mesh and the settings of a variant."""
    overrides = {
        "mesh.bar.cells": list(variant.cells),
        "solver.policy": variant.options["policy"],
        "solver.tolerance": variant.options["tolerance"],
        "solver.threads": numba.config.NUMBA_NUM_THREADS,
    }
    return load_scene(name, overrides=overrides)


@lru_cache
def _compile(name: str, policy: str) -> None:
    """Compile the kernels of both solution methods: the explicit inverse of small meshes, and the factor."""
    for cells in ((10, 1, 1), (20, 5, 4)):
        list(Simulation(scene_of(name, _variant(cells, Policy(policy), 1e-4))).play(2))
