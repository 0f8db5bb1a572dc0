# SPDX-License-Identifier: Apache-2.0
"""Two stacked cubes that touch each other, and the pressures between them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gdfe_ros.actuators.load import corner_areas
from gdfe_ros.constraints.obstacle import NAME, SelfContact
from gdfe_ros.mesh import HexMesh
from gdfe_ros.mesh.generators import bar
from gdfe_ros.results.step_result import StepResult
from gdfe_ros.scene.loader import scene_from_text
from gdfe_ros.simulation import Simulation

STACK = """
name: stack
mesh: {bar: {size: [0.05, 0.05, 0.1], cells: [2, 2, 2]}}
materials: {soft: {law: neo_hookean, young: 2.0e5, poisson: 0.0, density: 1000}}
regions: [{material: soft}]
handles: {low: {where: {face: z-}, fixed: true}, high: {where: {face: z+}}}
self_contact: {}
solver: {tolerance: 1.0e-5}
"""
GAP, PRESSED = 2e-4, 0.0052
"""Initial gap between the blocks of a stack, and downward displacement of the upper block [m]."""


def stack(low: int, high: int, *, friction: float = 0.0) -> Simulation:
    """Return a simulation of two stacked cubes of 50 mm, with ``low`` and ``high`` cells along their edges."""
    scene = scene_from_text(STACK)
    below, above = bar([0.05] * 3, [low] * 3), bar([0.05] * 3, [high] * 3)
    lift = np.array([0.0, 0.0, 0.025 + 0.5 * GAP])
    vertices = np.concatenate([below.vertices - lift, above.vertices + lift])
    mesh = HexMesh(vertices, np.concatenate([below.cells, above.cells + below.n_vertices]))
    ends = {"low": vertices[:, 2].min(), "high": vertices[:, 2].max()}
    handles = [
        replace(handle, vertices=np.flatnonzero(np.isclose(vertices[:, 2], ends[handle.name])).astype(np.int32))
        for handle in scene.handles
    ]
    parts = {"mesh": mesh, "cell_material": np.zeros(mesh.n_cells, np.int32), "handles": tuple(handles)}
    return Simulation(replace(scene, **parts, self_contact=SelfContact(quads=mesh.surface(), friction=friction)))


def pressures(simulation: Simulation, result: StepResult) -> list[np.ndarray]:
    """Return the pressures [Pa] at the vertices of the lower block's top and of the upper block's bottom."""
    rest, quads, touch = simulation.mesh.vertices, simulation.mesh.surface(), result.contacts[NAME]
    forces, found = np.zeros_like(rest), []
    forces[touch.vertices] = touch.forces
    for side in (-1.0, 1.0):
        own = quads[np.isclose(rest[quads][:, :, 2], 0.5 * side * GAP).all(axis=1)]
        areas = np.bincount(own.ravel(), corner_areas(rest, own).ravel(), len(rest))
        found.append(side * forces[areas > 0.0, 2] / areas[areas > 0.0])
    return found
