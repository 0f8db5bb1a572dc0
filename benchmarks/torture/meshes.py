# SPDX-License-Identifier: Apache-2.0
"""Group 5: meshes of bad elements, in parts, and without free vertices. Defects are refused in test/mesh."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from benchmarks.torture.bodies import BAR, Driver, make_scene
from benchmarks.torture.case import Case, Finding, Group
from gdfe_ros.constraints import Handle, Pose
from gdfe_ros.materials import Linear
from gdfe_ros.mesh import HexMesh, bar
from gdfe_ros.mesh.generators import grid
from gdfe_ros.results.step_result import StepResult
from gdfe_ros.solver.settings import Policy

POSE = Pose(translation=(0.02, 0.0, 0.05))
PULL = Pose(translation=(0.02, 0.0, 0.0))
MATERIAL = Linear(young=1e5, poisson=0.3)
ALONG, ACROSS = np.linspace(0.0, 0.4, 9), np.linspace(-0.05, 0.05, 3)


def _solve(mesh: HexMesh, policy: Policy, pose: Pose) -> tuple[Driver, StepResult]:
    driver = Driver(make_scene(mesh, MATERIAL, policy=policy))
    return driver, driver.step(pose)


def _compare(made: Callable[[], HexMesh], usual: HexMesh, pose: Pose, policy: Policy) -> Finding:
    """Compare with a good mesh of the body: return the error of common vertices and, for ``energy``, of the energy.

    The policy ``relative`` weights an element by its volume, independent of its shape, and minimises no energy.
    """
    mesh = made()
    driver, result = _solve(mesh, policy, pose)
    expected = _solve(usual, policy, pose)[1]
    usual_vertices = usual.vertices * (mesh.bounds[1] - mesh.bounds[0]) / (usual.bounds[1] - usual.bounds[0])
    apart = np.linalg.norm(mesh.vertices[:, None] - usual_vertices, axis=2)
    mine, theirs = np.nonzero(apart < 1e-9)
    moved = result.positions[mine] - mesh.vertices[mine] - expected.positions[theirs] + usual.vertices[theirs]
    error = float(np.abs(moved[:, :2]).max() if mesh.size != usual.size else np.abs(moved).max()) / mesh.size
    if policy is Policy.ENERGY:
        thinner = (usual.bounds[1] - usual.bounds[0])[2] / (mesh.bounds[1] - mesh.bounds[0])[2]
        error = max(error, abs(result.energy * thinner / expected.energy - 1.0))
    return Finding(tuple(driver.results), error, driver.rise)


def _inner(mesh: HexMesh) -> NDArray[np.bool_]:
    inside = np.ones(mesh.n_vertices, dtype=bool)
    inside[mesh.surface()] = False
    return inside


def _distorted() -> HexMesh:
    vertices, inside = BAR.vertices.copy(), _inner(BAR)
    vertices[inside] += np.random.default_rng(6).uniform(-0.015, 0.015, (inside.sum(), 3))
    return HexMesh(vertices, BAR.cells)


def _skewed() -> HexMesh:
    """Return a bar whose cross-sections are inclined by 45 degrees in the middle."""
    vertices = BAR.vertices.copy()
    vertices[:, 0] += vertices[:, 2] * np.sin(np.pi * BAR.vertices[:, 0] / 0.4)
    return HexMesh(vertices, BAR.cells)


def _graded(axis: int) -> HexMesh:
    """Return a bar with a thin layer of 1/1000 of an edge between two planes normal to an axis."""
    planes = [ALONG, ACROSS, ACROSS]
    middle = planes[axis][len(planes[axis]) // 2]
    planes[axis] = np.insert(planes[axis], len(planes[axis]) // 2 + 1, middle + 5e-5)
    return grid(*planes)


def _flat() -> HexMesh:
    return bar([0.4, 0.1, 5e-5], [8, 2, 1])


def _two_bars() -> HexMesh:
    shifted = BAR.vertices + np.array([0.0, 0.3, 0.0])
    return HexMesh(np.concatenate([BAR.vertices, shifted]), np.concatenate([BAR.cells, BAR.cells + BAR.n_vertices]))


def _parts(policy: Policy) -> Finding:
    """Return the energy error of two separate bars in one mesh, compared with a single bar."""
    mesh = _two_bars()
    driver, result = _solve(mesh, policy, PULL)
    expected = _solve(BAR, policy, PULL)[1]
    return Finding(tuple(driver.results), abs(result.energy / expected.energy / 2.0 - 1.0), driver.rise)


def _all_held(policy: Policy) -> Finding:
    """Return the error of a bar without free vertices: two rigid halves and a sheared layer between them."""
    left = np.flatnonzero(BAR.vertices[:, 0] < 0.19).astype(np.int32)
    right = np.setdiff1d(np.arange(BAR.n_vertices), left).astype(np.int32)
    handles = [Handle("base", left, fixed=True), Handle("tip", right)]
    driver = Driver(make_scene(BAR, MATERIAL, policy=policy, handles=handles))
    result = driver.step(POSE)
    gap = np.abs(result.positions[right] - BAR.vertices[right] - POSE.translation).max()
    return Finding(tuple(driver.results), float(gap), driver.rise)


def cases() -> list[Case]:
    """Return the cases of the group with bad meshes."""
    found = []
    thick = bar([0.4, 0.1, 5e-4], [8, 2, 1])
    for policy in Policy:
        case = partial(Case, group=Group.MESHES, policy=policy, law="linear")
        shapes = {
            "distorted by a third of an edge": (_distorted, BAR, POSE, 0.05),
            "skewed by 45 degrees": (_skewed, BAR, POSE, 0.1),
            "a sliver of 1 to 1000 across": (partial(_graded, 0), BAR, POSE, 0.1),
            "a sliver of 1 to 1000 along": (partial(_graded, 2), BAR, POSE, 0.05),
            "all elements 1 to 1000": (_flat, thick, PULL, 0.01),
        }
        for name, (made, usual, pose, bound) in shapes.items():
            found.append(case(name=name, run=partial(_compare, made, usual, pose, policy), bound=bound))
        found.append(case(name="parts that touch nowhere", run=partial(_parts, policy), bound=1e-4))
        found.append(case(name="everything a handle", run=partial(_all_held, policy), bound=1e-12))
    return found
