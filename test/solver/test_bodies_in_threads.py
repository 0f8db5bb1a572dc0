# SPDX-License-Identifier: Apache-2.0
"""Equal bodies in several threads."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np

from gdfe_ros import Simulation
from gdfe_ros.scene import scene_from_text
from gdfe_ros.scene.scene import Scene
from gdfe_ros.simulation import Command

SCENE = """
name: one_of_many
mesh: {bar: {size: [0.4, 0.1, 0.1], cells: [16, 4, 4]}}
materials: {soft: {law: neo_hookean, young: 1.0e5, poisson: 0.45, density: 300}}
regions: [{material: soft}]
handles: {base: {where: {face: x-}, fixed: true}}
loads: {weight: {gravity: [0, 0, -9.81]}}
"""


def scene(**overrides: object) -> Scene:
    """Return a bar that hangs under its weight; keyword arguments override scene keys, ``__`` stands for a dot."""
    return scene_from_text(SCENE, overrides={key.replace("__", "."): value for key, value in overrides.items()})


def test_bodies_in_threads_are_right() -> None:
    """Four equal bodies with different weights in four threads have the same bits as alone."""
    factors = [0.5, 1.0, 1.5, 2.0]

    def play(weight: float) -> np.ndarray:
        simulation = Simulation(scene())
        steps = [simulation.step(Command(loads={"weight": weight * share})) for share in (0.5, 1.0)]
        return steps[-1].positions

    alone = [play(weight) for weight in factors]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(play, factors))
    for one, other in zip(alone, together, strict=True):
        assert np.array_equal(one, other)
