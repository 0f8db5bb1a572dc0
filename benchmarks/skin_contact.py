# SPDX-License-Identifier: Apache-2.0
"""Voxel balls on plates and on each other, by skins or by faces of cells: ``python -m benchmarks.skin_contact``."""

from __future__ import annotations

from collections.abc import Callable
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
(docs/theory/contact_measured.md).
"""
GAP = 1e-5
"""Gap [m] between two balls before they are pressed on each other."""
CORE = 0.4
"""Radius of the held core of a ball that is pressed on another one, divided by the ball's radius."""
CORED = """
name: balls
meshes:
{meshes}
materials: {{soft: {{law: neo_hookean, young: 1.0e5, poisson: 0.3}}}}
regions: [{{material: soft}}]
handles:
{handles}
obstacles: {{floor: {{plane: [0, 0, 1], at: [0, 0, -{radius}]}}}}
"""
KINDS = {"skin": ("cut", "skin: {file: ball.stl}"), "staircase": ("whole", "")}
COUNTS = (8, 12, 16)


def press_ball(cells_across: int, kind: str, detail: int = 5) -> dict[float, float]:
    """Return dict from approach of each plate, divided by the radius, to the force on the lower plate [N]."""
    cells, skin = KINDS[kind]
    cell = 2.0 * RADIUS / cells_across
    text = BALL.format(cell=cell, cells=cells, skin=skin, radius=RADIUS, near=0.9 * cell)
    return _forces(text, lambda way: {"top": Pose((0.0, 0.0, -way)), "bottom": Pose((0.0, 0.0, way))}, "bottom", detail)


def _forces(text: str, moved: Callable[[float], dict[str, Pose]], name: str, detail: int = 5) -> dict[float, float]:
    """Return dict from approach, divided by the radius, to the vertical force [N] at the handle or obstacle ``name``.

    ``text`` is a scene with balls from ``ball.stl``. ``moved`` returns the poses for an approach [m].
    """
    with TemporaryDirectory() as folder:
        trimesh.creation.icosphere(detail, RADIUS).export(Path(folder) / "ball.stl")
        (Path(folder) / "ball.yaml").write_text(text)
        simulation, forces = Simulation(load_scene(Path(folder) / "ball.yaml")), {}
    for share in CALCULIX:
        result = simulation.step(Command(handles=moved(share * RADIUS)))
        if not result.converged:
            raise RuntimeError(result.message)
        forces[share] = abs(float(result.reactions[name][2]))
    return forces


def press_on_plate(cells_across: int) -> dict[float, float]:
    """Return dict from approach, divided by the radius, to the force [N] of a ball with a held core on a plate."""
    return _forces(_cored(cells_across, upper=0.0), lambda way: {"upper": Pose((0.0, 0.0, -way))}, "upper")


def press_on_ball(cells_across: int) -> dict[float, float]:
    """Return dict from half the approach of two equal balls, divided by the radius, to the force [N] between them.

    Both balls have held cores. The lower ball touches nothing but the upper one, whose cells are turned by 30 degrees.
    """
    text = _cored(cells_across, lower=1.2 * RADIUS, upper=3.2 * RADIUS + GAP) + "self_contact: {}\n"
    return _forces(text, lambda way: {"upper": Pose((0.0, 0.0, -2.0 * way - GAP))}, "upper")


def _cored(cells_across: int, **heights: float) -> str:
    """Return a scene of balls with held cores above a floor, from the name of each ball and its height [m]."""
    cell = 2.0 * RADIUS / cells_across
    place = "at: [0, 0, %s], rotation_deg: [0, 0, %s]"
    body = f"{{voxels: {{surface: ball.stl, cell: {cell}, cells: cut}}, skin: {{file: ball.stl}}, {place}}}"
    core = "{where: {mesh: %s, sphere: {center: [0, 0, 0], radius: " + f"{CORE * RADIUS}" + "}}}"
    return CORED.format(
        meshes="\n".join(f"  {name}: {body % (height, 30.0 * (name == 'upper'))}" for name, height in heights.items()),
        handles="\n".join(f"  {name}: {core % name}" for name in heights),
        radius=RADIUS,
    )


def main() -> None:
    """Print the tables of docs/contact.md."""
    rows = []
    for count in COUNTS:
        found = {kind: press_ball(count, kind) for kind in KINDS}
        errors = [f"{found[kind][share] / CALCULIX[share] - 1.0:+.1%}" for kind in KINDS for share in CALCULIX]
        rows.append([str(count), *errors])
    heads = ["cells over the diameter", *(f"{kind}, {share:g} R" for kind in KINDS for share in CALCULIX)]
    print(markdown_table(heads, rows))
    rows = []
    for count in COUNTS:
        pairs = zip(press_on_plate(count).items(), press_on_ball(count).values(), strict=True)
        rows.append([str(count), *(text for (_, plate), ball in pairs for text in _compared(plate, ball))])
    heads = [f"{text}, {share:g} R" for share in CALCULIX for text in ("plate [N]", "ball [N]", "difference")]
    print(markdown_table(["cells over the diameter", *heads], rows))


def _compared(plate: float, ball: float) -> tuple[str, str, str]:
    return f"{plate:.2f}", f"{ball:.2f}", f"{ball / plate - 1.0:+.1%}"


if __name__ == "__main__":
    main()
