# SPDX-License-Identifier: Apache-2.0
"""Teleport of free soft bodies, which keep their present shape, and the check that their new places are free."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gdfe_ros.constraints import Pose
from gdfe_ros.constraints.overlap_depths import TOUCHING, inside_surface, place_now
from gdfe_ros.constraints.rigid_body import RigidBody
from gdfe_ros.errors import OverlapError
from gdfe_ros.mesh.cells.tetrahedra import flat_quads
from gdfe_ros.mesh.mesh import MeshPart
from gdfe_ros.mesh.overlap import find_overlap
from gdfe_ros.mesh.touching import outline
from gdfe_ros.scene.building.soft_bodies import parts_of
from gdfe_ros.scene.scene import Scene
from gdfe_ros.solver.vectors import Array


def vertices_of_soft(scene: Scene, names: Collection[str]) -> NDArray[np.int32]:
    """Return the vertices of soft bodies."""
    return np.concatenate([_vertices(scene.mesh.parts[name]) for name in names])


def put_soft(scene: Scene, positions: Array, places: Mapping[str, Pose]) -> Array:
    """Return positions (n, 3) [m] in which soft bodies are moved rigidly.

    The pose of a deformed body is that of the rigid motion that brings its undeformed shape closest to the present
    shape, in the mean square. This pose becomes the wanted pose, and the deformation moves with it.

    Args:
        scene: the scene.
        positions: present positions (n, 3) [m], in the world.
        places: dict from soft body to its wanted pose relative to its rest pose.
    """
    moved = positions.copy()
    for name, pose in places.items():
        part = scene.mesh.parts[name]
        vertices = _vertices(part)
        origin, axes = fit_rigidly(part.mesh.vertices, positions[vertices])
        turn = Rotation.from_rotvec(pose.rotation).as_matrix() @ part.rotation @ axes.T
        moved[vertices] = part.at + np.asarray(pose.translation) + (positions[vertices] - origin) @ turn.T
    return moved


def fit_rigidly(rest: Array, now: Array) -> tuple[Array, Array]:
    """Return origin (3,) [m] and axes (3, 3) of the frame in which ``rest`` (k, 3) [m] is closest to ``now`` (k, 3)."""
    start, end = rest.mean(axis=0), now.mean(axis=0)
    left, _, right = np.linalg.svd((rest - start).T @ (now - end))
    proper = np.diag([1.0, 1.0, np.sign(np.linalg.det(left @ right))])
    axes = right.T @ proper @ left.T
    return end - axes @ start, axes


def require_soft_free(scene: Scene, poses: Mapping[str, Pose], positions: Array, names: Collection[str]) -> None:
    """Raise OverlapError if a soft body in ``names`` is inside of an obstacle, a rigid body or another soft body.

    ``positions`` (n, 3) [m] has the vertices of soft and rigid bodies, and ``poses`` the poses of obstacles.
    """
    parts = {
        name: replace(part.mesh, vertices=positions[_vertices(part)]) for name, part in parts_of(scene.mesh).items()
    }
    placed = place_now(scene.handles, poses, positions)
    for name in names:
        # Of this body only: a rigid body that rests elsewhere may press into another surface.
        surface = outline(flat_quads(parts[name].surface()), parts[name].touching, parts[name].vertices)
        for one in placed:
            depth = -float(one.measure_points(parts[name].vertices)[0].min())
            if depth > TOUCHING * scene.mesh.parts[name].mesh.size:
                text = f"soft body {name!r} is {depth:.3g} m inside of {one.thing.noun} {one.thing.name!r}"
                raise OverlapError(f"{text}; remedy: put it where it is free")
            if isinstance(one.thing, RigidBody) and (text := inside_surface(one, *surface)):
                raise OverlapError(text)
        for other, mesh in parts.items():
            if other != name and (found := find_overlap(mesh, parts[name])) is not None:
                text = f"soft body {name!r} is {found.depth:.3g} m or more inside of {other!r}"
                raise OverlapError(f"{text}; remedy: put it where it is free")


def _vertices(part: MeshPart) -> NDArray[np.int32]:
    return np.arange(part.first_vertex, part.first_vertex + part.mesh.n_vertices, dtype=np.int32)
