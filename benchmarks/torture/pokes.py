# SPDX-License-Identifier: Apache-2.0
"""Group 10, random contacts: objects pressed into a coarse body, edges across edges, meshes into each other."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.scenes import read_scene
from benchmarks.torture.bodies import Driver, distance
from benchmarks.torture.case import Case, Finding, Group
from benchmarks.torture.touches import BOUND, FRICTIONS, UP, released
from gdfe_ros.constraints import Pose
from gdfe_ros.scene.loader import scene_from_text
from gdfe_ros.solver.contact.self_contact.own_contact import DEEPEST
from gdfe_ros.solver.settings import Policy

POKES, PRESSES = 84, 42
"""Number of pokes of each object with each friction, about a thousand in total; and number of presses of two meshes."""
COARSE = read_scene("poked_bar.yaml")
BLOCKS = read_scene("two_blocks.yaml")
ABOVE, HEIGHT = 0.2, 0.025
"""Initial height of an object above the body's middle, and height of the body's upper face [m]."""
DEEP = 0.012
"""Largest depth of a poke [m]: half a cell."""
RETURNS = 4
"""Number of steps within which separated meshes must be undeformed again."""
FORMS: dict[str, tuple[dict[str, Any], float]] = {
    "spheres": ({"sphere": {"radius": 0.015}}, 0.015),
    "boxes": ({"box": {"size": [0.03, 0.03, 0.03]}}, 0.015),
    "capsules": ({"capsule": {"radius": 0.008, "length": 0.04}}, 0.008),
}
"""Dict from name to an object and its extent from the centre [m]."""
Spot = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Centre of an object that just touches the body [m], direction of its motion, and rotation vector [rad]."""


def _anywhere(reach: float, random: np.random.Generator) -> Spot:
    """Return a random contact on one of the free faces, with a random rotation."""
    side = int(random.integers(5))
    way = np.array([[0, 0, -1], [0, 0, 1], [0, -1, 0], [0, 1, 0], [-1, 0, 0]], dtype=float)[side]
    spot = random.uniform([-0.02, -0.025, -0.025], [0.05, 0.025, 0.025])
    spot = np.where(way != 0.0, -way * [0.05, 0.025, 0.025], spot)
    return spot - reach * way, way, random.uniform(-1.5, 1.5, 3)


def _edge_across_edge(reach: float, random: np.random.Generator) -> Spot:
    """Return a contact in which an edge of a box crosses one of the body's two upper edges almost perpendicularly."""
    side = random.choice([-1.0, 1.0])
    way = np.array([0.0, -side, -1.0]) / np.sqrt(2.0)
    spot = np.array([random.uniform(-0.03, 0.045), side * 0.025, HEIGHT])
    # An edge of the box lies along (0, 1, -side): turned by 45 degrees about x, then about the direction of motion.
    edge = np.array([0.0, side, -1.0]) / np.sqrt(2.0)
    face = (np.array([1.0, 0.0, 0.0]) - way) / np.sqrt(2.0)
    faces = np.column_stack([face, edge, np.cross(face, edge)])
    turn = Rotation.from_matrix(faces).as_rotvec() + random.uniform(-0.1, 0.1, 3)
    return spot - np.sqrt(2.0) * reach * way, way, turn


def _poked(form: dict[str, Any], reach: float, friction: float, pokes: int, where: Callable[..., Spot]) -> Finding:
    """Press an object into the body in one step, then drag it sideways or remove it; repeat this ``pokes`` times."""
    thing = {**form, "at": [0.0, 0.0, ABOVE], "friction": friction}
    driver = Driver(scene_from_text(COARSE, overrides={"obstacles": {"thing": thing}}))
    random = np.random.default_rng(3)
    for _ in range(pokes):
        middle, way, turn = where(reach, random)
        place = middle + random.uniform(0.0, DEEP) * way - [0.0, 0.0, ABOVE]
        driver.step(Pose(tuple(place), tuple(turn)), name="thing")
        if random.random() < 0.5:
            drag = np.cross(way, random.normal(size=3))
            driver.step(Pose(tuple(place + 0.01 * drag / np.linalg.norm(drag)), tuple(turn)), name="thing")
        else:
            driver.step(UP, name="thing")
    return released(driver)


def _pressed(friction: float, presses: int) -> Finding:
    """Move a coarse block by more than a cell into another and rotate it, in single steps; finally separate them."""
    driver = Driver(scene_from_text(BLOCKS, overrides={"self_contact": {"friction": friction}}))
    simulation, random, depth = driver.simulation, np.random.default_rng(3), 0.0
    inside = simulation.stepper.actuation.contacts[-1].penetration
    for _ in range(presses):
        place = random.uniform([-0.02, -0.02, -0.06], [0.02, 0.02, 0.0])
        result = driver.step(Pose(tuple(place), tuple(random.uniform(-0.4, 0.4, 3))), name="high")
        found = inside.depths(simulation.state.positions, 0.0)[0].max() / simulation.mesh.size
        depth = max(depth, float(found)) if result.converged else depth
    for height in np.linspace(0.1, 0.0, RETURNS):
        result = driver.step(Pose((0.0, 0.0, height)), name="high")
    error = distance(result.positions, simulation.mesh.vertices, simulation.mesh.size)
    said = tuple(dict.fromkeys(each.message for each in driver.results if each.message))
    flaws = (f"settled {depth:.2g} of its size inside of another mesh",) if depth > DEEPEST else ()
    return Finding(tuple(driver.results), error, driver.rise, said, flaws)


def cases(pokes: int = POKES) -> list[Case]:
    """Return the cases of random contacts, with ``pokes`` pokes each, and half this number of presses of two meshes."""
    case = partial(Case, group=Group.CONTACT, policy=Policy.ENERGY, law="neo-hookean", bound=BOUND)
    found = []
    for friction in FRICTIONS:
        more = f", coarse, friction {friction:g}"
        for name, (form, reach) in FORMS.items():
            found.append(case(name=name + more, run=partial(_poked, form, reach, friction, pokes, _anywhere)))
        run = partial(_poked, *FORMS["boxes"], friction, pokes, _edge_across_edge)
        found.append(case(name=f"edges across edges{more}", run=run))
        presses = max(1, pokes * PRESSES // POKES)
        found.append(replace(case(name=f"mesh into mesh{more}", run=partial(_pressed, friction, presses)), bound=1e-3))
    return found
