# SPDX-License-Identifier: Apache-2.0
"""Beginning of an episode: the equilibrium of the initial commands."""

from __future__ import annotations

from dataclasses import replace

from gdfe_ros.errors import GdfeError
from gdfe_ros.scene import Scene
from gdfe_ros.simulation import Simulation


def settle(simulation: Simulation) -> None:
    """Bring a simulation from its initial state to the equilibrium of its initial commands; the time stays 0.

    With dynamics, the equilibrium is that of the scene without dynamics, and velocities are the initial ones. A scene
    with rigid bodies, or without handles, has no equilibrium without dynamics, and stays in its initial state.

    Raises:
        GdfeError: the equilibrium was not found.
    """
    scene = simulation.scene
    if scene.dynamics is None:
        result = simulation.step(dt=0.0)
    elif is_held(scene):
        still = Simulation(replace(scene, dynamics=None))
        result = still.step(dt=0.0)
        simulation.set_positions(still.positions)
    else:
        return
    if not result.converged:
        text = f"scene {scene.name!r}: its equilibrium under the initial commands was not found: {result.message}"
        raise GdfeError(f"{text}; remedy: smaller loads, or `gdfe solve` to see what happens")


def is_held(scene: Scene) -> bool:
    """Return whether handles hold a scene without rigid bodies, so that it has equilibria without dynamics."""
    return any(handle.section == "handles" for handle in scene.handles) and not scene.rigid_bodies
