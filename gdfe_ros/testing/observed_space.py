# SPDX-License-Identifier: Apache-2.0
"""Bounds of the default observation of an environment."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from gymnasium.spaces import Box

from gdfe_ros.actuators import Actuator, Cable, Chamber, Grip, Mode
from gdfe_ros.errors import GdfeError
from gdfe_ros.scene import Scene
from gdfe_ros.scene.builder import find_unheld
from gdfe_ros.simulation import Simulation


def settle(simulation: Simulation) -> None:
    """Bring a simulation from its initial state to the equilibrium of its initial commands; the time stays 0.

    With dynamics, the equilibrium is that of the scene without dynamics, and velocities are the initial ones. A scene
    with rigid bodies, or with a piece that no handle holds, has no equilibrium without dynamics, and stays in its
    initial state.

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
    """Return whether handles hold each piece of a scene without rigid bodies: it has equilibria without dynamics."""
    holding = [handle for handle in scene.handles if handle.section == "handles"]
    return not scene.rigid_bodies and not any(find_unheld(scene.mesh, holding))


NEAR, FAR = 2.0, 10.0
"""Largest distance of a probe from the undeformed body's bounding box over the body's extent: held, and not held."""
FASTEST = 1e3
"""Largest acceleration [m/s^2] of a rigid body that a grip holds, with its weight."""
PRESSURE = 10.0
"""Largest pressure in a chamber with a commanded volume, divided by the stiffest material's initial modulus."""


def default_space(scene: Scene, *, goal: bool) -> Box:
    """Return the space of probe positions [m], commands, efforts [N] or [Pa] and, if there is one, the goal [m].

    Positions lie within `NEAR` or `FAR` extents of the undeformed body; a command within the actuator's range. The
    effort of an actuator whose effort is commanded lies within this range. Else the tension of a cable is below the
    stiffest material's initial modulus times the squared extent of the body, and a pressure below `PRESSURE` times the
    modulus.
    """
    mesh = scene.mesh
    reach = (NEAR if is_held(scene) else FAR) * mesh.extent
    low, high = mesh.bounds[0] - reach, mesh.bounds[1] + reach
    efforts = [_efforts(scene, actuator) for actuator in scene.actuators]
    places = len(scene.probes)
    lows = [*[low] * places, [item.low for item in scene.actuators], [least for least, _ in efforts]]
    highs = [*[high] * places, [item.high for item in scene.actuators], [most for _, most in efforts]]
    if goal:
        lows, highs = [*lows, low], [*highs, high]
    return Box(np.concatenate(lows), np.concatenate(highs), dtype=np.float64)


def _efforts(scene: Scene, actuator: Actuator) -> tuple[float, float]:
    """Return the least and the largest effort of an actuator in an observation."""
    if actuator.mode in (Mode.TENSION, Mode.PRESSURE):
        return min(actuator.low, 0.0), max(actuator.high, 0.0)
    stiffest = max(material.young0 for material in scene.materials.values())
    if isinstance(actuator, Cable):
        return 0.0, stiffest * scene.mesh.extent**2
    if isinstance(actuator, Grip):
        carried = sum(body.mass for body in scene.rigid_bodies)
        return 0.0, stiffest * scene.mesh.extent**2 + FASTEST * carried
    most = PRESSURE * stiffest if isinstance(actuator, Chamber) else 1.0
    return -most, most
