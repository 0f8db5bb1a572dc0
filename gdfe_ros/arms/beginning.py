# SPDX-License-Identifier: Apache-2.0
"""Check that no link of an arm is initially inside the soft body, an obstacle or a rigid body."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.arms.arm import Arm
from gdfe_ros.constraints import Handle, Pose
from gdfe_ros.constraints.arm_link import ArmLink
from gdfe_ros.constraints.form import Box, Capsule, Cylinder, Plane, Sphere, TriangleMesh
from gdfe_ros.constraints.obstacle import Obstacle
from gdfe_ros.mesh import HexMesh

TOUCHING = 1e-3
"""Largest penetration depth [m] that counts as contact, not as inside; the meshes of links are not exact."""


def begins_inside(arm: Arm, handles: Sequence[Handle], mesh: HexMesh) -> Iterator[str]:
    """Yield a message with a remedy for each link with contact that is initially inside the body or an obstacle.

    Immovable links are only checked against the soft body, because they may be mounted in an obstacle such as a table.
    """
    if not arm.links:
        return
    from gdfe_ros.solver.contact.overlap import Placed  # loads numba

    def placed(thing: Obstacle) -> Placed:
        return Placed(thing, *thing.frame(Pose()))

    robot = arm.dynamics.description
    surface = mesh.vertices[np.unique(mesh.surface())]
    mounted = robot.rigid_with(robot.root)
    remedy = "remedy: another `start`, another place of the arm (`at`), or leave the link out of `links`"
    things = [placed(item) for item in handles if isinstance(item, Obstacle) and not isinstance(item, ArmLink)]
    for piece in map(placed, arm.links):
        depth = -float(piece.seen_from(surface)[0].min(initial=0.0))
        if depth > TOUCHING:
            yield f"link {piece.thing.link!r} begins {depth:.3g} m inside of the soft body; {remedy}"
        for other in things if piece.thing.link not in mounted else ():
            depth = max(_depth(piece, other), _depth(other, piece))
            if depth > TOUCHING:
                where = f"{other.thing.noun} {other.thing.name!r}"
                yield f"link {piece.thing.link!r} begins {depth:.3g} m inside of {where}; {remedy}"


def _depth(one: object, other: object) -> float:
    """Return the largest depth [m] of surface points of ``one`` obstacle inside the ``other``; 0 if none is inside."""
    points = _points(one.thing)
    if not len(points):
        return 0.0
    return -float(other.seen_from(one.world(points))[0].min(initial=0.0))


def _points(thing: Obstacle) -> NDArray[np.float64]:
    """Return points (k, 3) [m] of an obstacle's surface in the obstacle's frame; no points (0, 3) for a plane."""
    match thing.form:
        case Box() | Cylinder():
            return thing.form.skin
        case Sphere(radius):
            return radius * _directions()
        case Capsule(radius, length):
            ends = np.array([0.0, 0.0, 0.5 * length])
            return np.concatenate([radius * _directions() + end for end in (ends, -ends)])
        case TriangleMesh(solid):
            return np.concatenate([solid.vertices, solid.vertices[solid.triangles].mean(axis=1)])
        case Plane():
            return np.zeros((0, 3))


def _directions() -> NDArray[np.float64]:
    """Return unit vectors (k, 3) evenly spread over a sphere, by the golden angle."""
    count = 64
    z = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    turn = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(count)
    across = np.sqrt(1.0 - z**2)
    return np.column_stack([across * np.cos(turn), across * np.sin(turn), z])
