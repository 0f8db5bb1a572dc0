# SPDX-License-Identifier: Apache-2.0
"""A voxel ball between plates, with contact of its skin or its cells' faces: ``python -m benchmarks.skin_contact``."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import trimesh

from benchmarks.markdown import markdown_table
from benchmarks.pressing import RADIUS
from gdfe_ros import Command, Pose, Simulation, load_scene

BALL = """
name: ball
mesh: {{voxels: {{surface: ball.stl, cell: {cell}, cells: {cells}}}}}
{skin}
materials: {{soft: {{law: neo_hookean, young: 1.0e5, poisson: 0.3}}}}
regions: [{{material: soft}}]
handles:
  centre: {{where: {{sphere: {{center: [0, 0, 0], radius: 0.001}}}}, fixed: true}}
  front: {{where: {{sphere: {{center: [{radius}, 0, 0], radius: {near}}}}}, free: [x]}}
  back: {{where: {{sphere: {{center: [-{radius}, 0, 0], radius: {near}}}}}, free: [x]}}
  left: {{where: {{sphere: {{center: [0, {radius}, 0], radius: {near}}}}}, free: [y]}}
  right: {{where: {{sphere: {{center: [0, -{radius}, 0], radius: {near}}}}}, free: [y]}}
obstacles:
  top: {{plane: [0, 0, -1], at: [0, 0, {radius}]}}
  bottom: {{plane: [0, 0, 1], at: [0, 0, -{radius}]}}
"""
CALCULIX = {0.06: 6.027, 0.1: 13.586}
"""Dict from approach of each plate, divided by the radius, to CalculiX' force [N] with the neo-Hookean law
(docs/theory/contact.md).
"""
KINDS = {"skin": ("cut", "skin: {file: ball.stl}"), "staircase": ("whole", "")}
COUNTS = (8, 12, 16)


def press_ball(cells_across: int, kind: str, detail: int = 5) -> dict[float, float]:
    """Return dict from approach of each plate, divided by the radius, to the force on the lower plate [N]."""
    cells, skin = KINDS[kind]
    cell = 2.0 * RADIUS / cells_across
    text = BALL.format(cell=cell, cells=cells, skin=skin, radius=RADIUS, near=0.9 * cell)
    with TemporaryDirectory() as folder:
        trimesh.creation.icosphere(detail, RADIUS).export(Path(folder) / "ball.stl")
        (Path(folder) / "ball.yaml").write_text(text)
        simulation, forces = Simulation(load_scene(Path(folder) / "ball.yaml")), {}
    for share in CALCULIX:
        way = share * RADIUS
        plates = {"top": Pose((0.0, 0.0, -way)), "bottom": Pose((0.0, 0.0, way))}
        result = simulation.step(Command(handles=plates))
        if not result.converged:
            raise RuntimeError(result.message)
        forces[share] = float(result.reactions["bottom"][2])
    return forces


def main() -> None:
    """Print the table of docs/contact.md."""
    rows = []
    for count in COUNTS:
        found = {kind: press_ball(count, kind) for kind in KINDS}
        errors = [f"{found[kind][share] / CALCULIX[share] - 1.0:+.1%}" for kind in KINDS for share in CALCULIX]
        rows.append([str(count), *errors])
    heads = ["cells over the diameter", *(f"{kind}, {share:g} R" for kind in KINDS for share in CALCULIX)]
    print(markdown_table(heads, rows))


if __name__ == "__main__":
    main()
