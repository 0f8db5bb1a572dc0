# SPDX-License-Identifier: Apache-2.0
"""Remarks on meshes that are too coarse for their contacts, chambers or walls, with measured errors."""

from __future__ import annotations

import numpy as np

from gdfe_ros.actuators import Chamber
from gdfe_ros.actuators.load import corner_areas
from gdfe_ros.constraints.form import Sphere
from gdfe_ros.constraints.obstacle import Obstacle
from gdfe_ros.mesh import TetMesh
from gdfe_ros.mesh.faces import enclosed_volume
from gdfe_ros.mesh.walls import flat_walls
from gdfe_ros.scene.scene import Scene

LEAST_CELLS = 3.0
"""Smallest ratio of a ball's radius to the size of the cells. With this ratio, and at an indentation of a tenth of the
radius, the error of the contact force is at most 8 %.
"""
ROUNDING = 1e-9
"""Relative tolerance of the comparison of radius and cell size, for rounding errors."""
THICKEST_CELL = 0.35
"""Largest ratio of the thickness of a wall cell to the radius of a round cavity; above it the volume error exceeds 5 %.
"""
ROUND = 1.1
"""A cavity counts as round if its area is at most this multiple of the area of a ball with the same volume; a cube has
1.24.
"""


def coarse_contacts(scene: Scene) -> list[str]:
    """Return remarks on balls whose radius is too small compared with the size of the body's boundary faces."""
    balls = [handle for handle in scene.handles if isinstance(handle, Obstacle) and isinstance(handle.form, Sphere)]
    if not balls:
        return []
    cell = float(np.sqrt(np.median(corner_areas(scene.mesh.vertices, scene.mesh.boundary.quads).sum(axis=1))))
    return [
        f"{ball.section} {ball.name!r}: its radius {ball.form.radius:.3g} m is only {ball.form.radius / cell:.2g} "
        f"times the size of the cells that it can touch ({cell:.3g} m). Measured for a ball pressed in by a tenth "
        "of its radius: with a radius of 3 cells the force was right within 8 %; with 2 cells it was 48 % too "
        "small to 17 % too large, depending on the position between the cells; with 1 cell it fell to zero; "
        f"remedy: cells of at most a third of the radius, {ball.form.radius / LEAST_CELLS:.2g} m"
        for ball in balls
        if ball.form.radius < (1.0 - ROUNDING) * LEAST_CELLS * cell
    ]


def coarse_cavities(scene: Scene) -> list[str]:
    """Return remarks on round chambers whose wall has too few cells through its thickness."""
    found = []
    for chamber in scene.actuators:
        if not isinstance(chamber, Chamber) or chamber.points is not None or scene.mesh.nodes != 8:
            continue
        vertices = scene.mesh.vertices
        volume = abs(enclosed_volume(vertices, chamber.quads))
        area = float(corner_areas(vertices, chamber.quads).sum())
        radius = 3.0 * volume / area
        if area > ROUND * (36.0 * np.pi * volume**2) ** (1.0 / 3.0):
            continue
        thick = _depth(scene, chamber) / radius
        if thick > THICKEST_CELL:
            found.append(
                f"actuators {chamber.name!r}: the cells around it are {thick:.2g} of its radius thick, which makes "
                "it too stiff. Compared with Lame's solution, a ball under pressure opened 6 % too little with "
                f"cells of 0.43 of the radius, 9 % with 0.5 and 24 % with 1; remedy: {int(np.ceil(thick / 0.25))} "
                "times as many cells across the wall"
            )
    return found


def coarse_walls(scene: Scene) -> list[str]:
    """Return remarks on walls of tetrahedra whose cells are too long for the thickness of the wall."""
    mesh = scene.mesh
    return [f"mesh: {text}" for text in flat_walls(mesh)] if isinstance(mesh, TetMesh) else []


def _depth(scene: Scene, chamber: Chamber) -> float:
    """Return the mean thickness [m] of the cells with a face in a chamber, from this face to the opposite face."""
    inner = np.isin(scene.mesh.cells, chamber.quads)
    behind = inner.sum(axis=1) == 4
    corners, near = scene.mesh.vertices[scene.mesh.cells[behind]], inner[behind, :, None]
    through = 0.25 * (np.where(near, 0.0, corners) - np.where(near, corners, 0.0)).sum(axis=1)
    return float(np.linalg.norm(through, axis=1).mean())
