# SPDX-License-Identifier: Apache-2.0
"""CAD to picture: ``python -m docs.scripts.skin_picture`` makes a tube as STL, bends it in a scene, and draws it."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import trimesh

from gdfe_ros import Command, Pose, Simulation, load_scene
from gdfe_ros.analysis.picture import draw_body

IMAGE = Path(__file__).resolve().parents[1] / "images" / "skin.png"
LENGTH, OUTER, INNER = 0.10, 0.010, 0.006
"""Length, outer radius and inner radius of the tube [m]."""
ANGLE, STEPS = np.radians(70.0), 5
"""Bending angle of the tube's axis [rad], and number of steps."""
SCENE = """
name: silicone_tube
mesh: {voxels: {surface: tube.stl, cell: 0.0025, cells: cut}}
skin: {file: tube.stl}
materials: {silicone: {law: neo_hookean, young: 1.2e5, poisson: 0.45}}
regions: [{material: silicone}]
handles: {base: {where: {face: x-}, fixed: true}, end: {where: {face: x+}}}
"""


def main() -> None:
    """Write the surface and the scene, bend the tube along an arc, and draw its skin."""
    tube = trimesh.creation.annulus(INNER, OUTER, LENGTH, sections=96)
    tube.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [0, 1, 0]))
    with TemporaryDirectory() as folder:
        tube.export(Path(folder) / "tube.stl")
        (Path(folder) / "tube.yaml").write_text(SCENE)
        simulation = Simulation(load_scene(Path(folder) / "tube.yaml"))
    for angle in np.linspace(0.0, ANGLE, STEPS + 1)[1:]:
        radius = LENGTH / angle
        there = np.array([radius * np.sin(angle) - LENGTH, 0.0, radius * (1.0 - np.cos(angle))])
        result = simulation.step(Command(handles={"end": Pose(tuple(there), (0.0, -float(angle), 0.0))}))
        if not result.converged:
            raise RuntimeError(result.message)
    strain = simulation.fields().eps_eq
    title = (
        f"silicone_tube: {simulation.mesh.n_cells} cut cells, skin of {len(simulation.mesh.outside.faces)} triangles"
    )
    draw_body(IMAGE, simulation.mesh, result.positions, strain, title=title, label="equivalent strain")
    print(f"written: {IMAGE} ({result.iterations} iterations in the last step)")


if __name__ == "__main__":
    main()
