# SPDX-License-Identifier: Apache-2.0
"""Group 4: the results must not depend on units, position, orientation and order of the vertices."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.torture.bodies import BAR, LAWS, Driver, distance, face, laws_for, make_scene
from benchmarks.torture.case import Case, Finding, Group
from gdfe_ros.constraints import Handle, Pose
from gdfe_ros.materials import Curve, CurveData, Linear, Material, Ogden
from gdfe_ros.mesh import HexMesh
from gdfe_ros.solver.settings import Policy

TOLERANCE = 1e-11
BOUND = 1e-9
LENGTH = 0.4
POSE = Pose(translation=(0.02, 0.01, 0.06), rotation=(0.5, 0.0, 0.0))
LENGTHS = (1e-4, 1e-2, 1e1, 1e3)
MODULI = (1e-5, 1e-2, 1e4)
"""Factors on the modulus of 1e5 Pa: from 1 Pa to 1e9 Pa."""


def harder(material: Material, factor: float) -> Material:
    """Return the same law with every modulus multiplied by a factor."""
    if isinstance(material, Linear):
        return replace(material, young=material.young * factor)
    if isinstance(material, Ogden):
        return replace(material, mu=tuple(value * factor for value in material.mu))
    assert isinstance(material, Curve)
    data = material.data
    coefficients = tuple(value * factor for value in data.coefficients)
    stress = tuple(value * factor for value in data.stress)
    return replace(material, data=CurveData(coefficients, data.strain, stress, data.strain_max))


def _scaled(law: str, policy: Policy, length: float, modulus: float) -> Finding:
    """Return the error of positions and energy after a change of the units of length and modulus."""
    usual = Driver(make_scene(BAR, LAWS[law], policy=policy, tolerance=TOLERANCE)).step(POSE)
    mesh = HexMesh(BAR.vertices * length, BAR.cells)
    driver = Driver(make_scene(mesh, harder(LAWS[law], modulus), policy=policy, tolerance=TOLERANCE))
    result = driver.step(Pose(tuple(np.multiply(length, POSE.translation)), POSE.rotation))
    error = distance(result.positions / length, usual.positions, LENGTH)
    energy = abs(result.energy / (modulus * length**3) / usual.energy - 1.0)
    return Finding(tuple(driver.results), max(error, energy), driver.rise)


def _moved(law: str, policy: Policy, turn: Rotation, shift: tuple[float, float, float]) -> Finding:
    """Return the error of shape and energy after a rigid motion of the whole scene."""
    usual = Driver(make_scene(BAR, LAWS[law], policy=policy, tolerance=TOLERANCE)).step(POSE)
    mesh = HexMesh(turn.apply(BAR.vertices) + shift, BAR.cells)
    handles = [Handle("base", face(BAR, "x-"), fixed=True), Handle("tip", face(BAR, "x+"))]
    driver = Driver(make_scene(mesh, LAWS[law], policy=policy, tolerance=TOLERANCE, handles=handles))
    pose = Pose(tuple(turn.apply(POSE.translation)), tuple(turn.apply(POSE.rotation)))
    result = driver.step(pose)
    error = distance(turn.inv().apply(result.positions - shift), usual.positions, LENGTH)
    energy = abs(result.energy / usual.energy - 1.0)
    return Finding(tuple(driver.results), max(error, energy), driver.rise)


def _permuted(law: str, policy: Policy) -> Finding:
    """Return the error of positions after a random permutation of vertices and cells."""
    usual = Driver(make_scene(BAR, LAWS[law], policy=policy, tolerance=TOLERANCE)).step(POSE)
    random = np.random.default_rng(4)
    order, cells = random.permutation(BAR.n_vertices), random.permutation(BAR.n_cells)
    place = np.argsort(order).astype(np.int32)
    mesh = HexMesh(BAR.vertices[order], place[BAR.cells[cells]])
    driver = Driver(make_scene(mesh, LAWS[law], policy=policy, tolerance=TOLERANCE))
    result = driver.step(POSE)
    error = distance(result.positions, usual.positions[order], LENGTH)
    return Finding(tuple(driver.results), error, driver.rise)


def _turned(axis: tuple[float, float, float], degrees: float) -> Rotation:
    return Rotation.from_rotvec(np.deg2rad(degrees) * np.asarray(axis) / np.linalg.norm(axis))


def cases() -> list[Case]:
    """Return the cases of the group with other units, positions and orders."""
    case = partial(Case, group=Group.SCALES, bound=BOUND)
    found = []
    for policy in Policy:
        first, *others = laws_for(policy)
        for law in (first, *others):
            grid = [(1e-4, 1e4), (1e3, 1e-5)] if law != first else [(a, b) for a in LENGTHS for b in MODULI]
            for length, modulus in grid:
                run = partial(_scaled, law, policy, length, modulus)
                name = f"{length:g} times as long, {modulus:g} times as hard"
                found.append(case(name=name, policy=policy, law=law, run=run))
            none = (0.0, 0.0, 0.0)
            turns = {
                "rest pose turned by 37 degrees": (_turned((1.0, 2.0, 3.0), 37.0), none),
                "rest pose turned by 180 degrees": (_turned((0.0, 1.0, 1.0), 180.0), none),
                "rest pose 1000 m away": (Rotation.identity(), (1e3, -1e3, 1e3)),
            }
            for name, (turn, shift) in turns.items():
                run = partial(_moved, law, policy, turn, shift)
                found.append(case(name=name, policy=policy, law=law, run=run))
            found.append(case(name="vertices permuted", policy=policy, law=law, run=partial(_permuted, law, policy)))
    return found
