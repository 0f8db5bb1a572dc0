# SPDX-License-Identifier: Apache-2.0
"""Our solver in the benchmark, run like any peer: scenes of config/scenes with several meshes and tolerances."""

from __future__ import annotations

from functools import lru_cache
from time import perf_counter
from typing import Any

import numba
import numpy as np

from benchmarks.cases import Case
from benchmarks.peers.peer import Array, PeerError, PeerSolution, Variant
from gdfe_ros import __version__
from gdfe_ros.scene import Scene, load_scene
from gdfe_ros.simulation import Command, Simulation


def available() -> str | None:
    """Return None, because this package is always available."""
    return None


def solve(case: Case, variant: Variant, points: Array) -> PeerSolution:
    """Build and solve a scene; kernels are compiled before, on a smaller mesh. See `Peer.solve`.

    Raises:
        PeerError: a step did not converge.
    """
    _compile(case.name.value, variant.element)
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
        "solver.policy": variant.element,
        "solver.tolerance": variant.options["tolerance"],
        "solver.threads": numba.config.NUMBA_NUM_THREADS,
    }
    return load_scene(name, overrides=overrides)


@lru_cache
def _compile(name: str, policy: str) -> None:
    """Compile the kernels of both solution methods: the explicit inverse of small meshes, and the factor."""
    for cells in ((10, 1, 1), (20, 5, 4)):
        variant = Variant(label="", element=policy, cells=cells, options={"tolerance": 1e-4})
        list(Simulation(scene_of(name, variant)).play(2))
