# SPDX-License-Identifier: Apache-2.0
"""Balls that are pressed on plates and on each other, as cells that follow the ball and as voxels with a skin."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.optimize import brentq

from gdfe_ros import Command, Pose, Simulation, load_scene
from gdfe_ros.mesh import HexMesh
from gdfe_ros.mesh.generators import bar
from gdfe_ros.scene.loader import scene_from_text
from test.written import advance

ROUND = """
name: ball
mesh: {bar: {size: [2, 2, 2], cells: [16, 16, 16]}}
materials: {soft: {law: linear, young: 1.0e5, poisson: 0.3}}
regions: [{material: soft}]
handles:
  centre: {where: {sphere: {center: [1, 0, 0], radius: 0.01}}, fixed: true}
  east: {where: {sphere: {center: [2, 0, 0], radius: 0.01}}, free: [x, y]}
  north: {where: {sphere: {center: [1, 1, 0], radius: 0.01}}, free: [x, y]}
obstacles:
  top: {plane: [0, 0, -1], at: [0, 0, 0.05]}
  bottom: {plane: [0, 0, 1], at: [0, 0, -0.05]}
"""
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
RADIUS, YOUNG, POISSON = 0.05, 1.0e5, 0.3
"""Radius [m], Young's modulus [Pa] and Poisson's ratio of the ball."""
CALCULIX = {0.06: 6.027, 0.1: 13.586}
"""Dict from approach of each plate, divided by the radius, to CalculiX' force [N] on a neo-Hookean ball. Its
model was axisymmetric, with 16 quadratic cells along an eighth of the circumference.
"""
GRADING = 1.3
"""Exponent of the grading of the ball's mesh: lattice coordinates are raised to this power, so that cells near the
poles are smaller.
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


def ball_between_plates(*, cells: int, approaches: Sequence[float], law: str = "linear") -> dict[float, float]:
    """Return dict from approach of each of two plates towards a ball's centre [m] to their force [N].

    The centre is fixed, and two points of the equator stay in the plane of the equator. Without these two points the
    ball, whose surface has facets, would rotate until a flatter part is in contact.
    """
    scene = scene_from_text(ROUND, overrides={"materials.soft.law": law})
    cube = bar([2.0, 2.0, 2.0], [cells] * 3)
    even = cube.vertices - [1.0, 0.0, 0.0]
    x, y, z = (np.sign(even) * np.abs(even) ** GRADING).T
    round_ones = [a * np.sqrt(1 - b * b / 2 - c * c / 2 + b * b * c * c / 3) for a, b, c in
                  ((x, y, z), (y, z, x), (z, x, y))]  # fmt: skip
    mesh = HexMesh(RADIUS * np.stack(round_ones, axis=1), cube.cells)
    places = {"centre": (0.0, 0.0, 0.0), "east": (RADIUS, 0.0, 0.0), "north": (0.0, RADIUS, 0.0)}
    handles = [
        replace(handle, vertices=_vertex_at(mesh, places[handle.name])) if handle.name in places else handle
        for handle in scene.handles
    ]
    made = replace(scene, mesh=mesh, cell_material=np.zeros(mesh.n_cells, np.int32), handles=tuple(handles))
    simulation, forces = Simulation(made), {}
    for approach in approaches:
        plates = {"top": Pose((0.0, 0.0, -approach)), "bottom": Pose((0.0, 0.0, approach))}
        result = advance(simulation, Command(handles=plates))
        forces[approach] = float(result.reactions["bottom"][2])
    return forces


def _vertex_at(mesh: HexMesh, place: tuple[float, float, float]) -> NDArray[np.int32]:
    """Return the vertex (1,) at the position ``place`` [m]."""
    return np.flatnonzero(np.linalg.norm(mesh.vertices - place, axis=1) < 1e-9).astype(np.int32)


def hertz(approach: float) -> float:
    """Return Hertz's force [N] for a half space with the ball's curvature that is indented by ``approach`` [m]."""
    return 4.0 / 3.0 * YOUNG / (1.0 - POISSON**2) * math.sqrt(RADIUS) * approach**1.5


def tatara(approach: float) -> float:
    """Return the force [N] on a ball that is compressed by ``approach`` [m] from both sides (Tatara 1991, order 1)."""

    def too_far(force: float) -> float:
        contact = (0.75 * (1.0 - POISSON**2) * force * RADIUS / YOUNG) ** (1.0 / 3.0)
        local = 0.75 * (1.0 - POISSON**2) * force / (YOUNG * contact)
        far = math.hypot(contact, 2.0 * RADIUS)
        back = 2.0 * (1.0 + POISSON) * RADIUS**2 / far**3 + (1.0 - POISSON**2) / far
        return local - back * force / (math.pi * YOUNG) - approach

    return brentq(too_far, 1e-9, 10.0 * hertz(approach))


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
