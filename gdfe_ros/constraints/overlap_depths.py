# SPDX-License-Identifier: Apache-2.0
"""Checks that a rigid body does not penetrate other bodies or obstacles at the start or after a teleport."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.constraints import Handle, Pose
from gdfe_ros.constraints.distances import form_numbers, measure
from gdfe_ros.constraints.form import Form
from gdfe_ros.constraints.obstacle import Obstacle
from gdfe_ros.constraints.rigid_body import RigidBody
from gdfe_ros.mesh.surfaces.shells import inside

TOUCHING = 1e-3
"""Penetration depth, divided by the rigid body's diagonal, up to which bodies count as touching, not as overlapping."""
POINTS, ROUNDS, CLOSER = 9, 14, 0.4
"""Search grid for the deepest point: number of points along an edge, number of refinements, and factor by which each
refinement shrinks the grid.
"""
MOST_SHIFTS = 20
"""Largest number of shifts that move a body out of another one; one shift is enough, except where edges cross."""
SKIN = 0.98
"""Factor by which a rigid body is shrunk before its surface points are tested for being inside of the soft body."""


@dataclass(frozen=True, eq=False)
class Placed:
    """A rigid body or an obstacle with its pose.

    Attributes:
        thing: the obstacle or rigid body.
        origin: (3,) [m] origin of the thing's frame.
        axes: (3, 3) rotation of the thing's frame.
    """

    thing: Obstacle
    origin: NDArray[np.float64]
    axes: NDArray[np.float64]

    @classmethod
    def now(cls, thing: Obstacle, poses: Mapping[str, Pose], positions: NDArray[np.float64]) -> Placed:
        """Return an obstacle at its commanded pose, or a rigid body at the pose of its vertices (n, 3) [m]."""
        rigid = isinstance(thing, RigidBody)
        return cls(thing, *(thing.find_frame(positions) if rigid else thing.frame(poses[thing.name])))

    @property
    def half(self) -> NDArray[np.float64]:
        """Half edges (3,) [m] of the box around a rigid body."""
        return np.array(self.thing.form.half)

    def world(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the world coordinates (k, 3) [m] of points (k, 3) [m] that are given in the thing's frame."""
        return self.origin + places @ self.axes.T

    def measure_points(self, points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return signed distances (k,) [m] of points (k, 3) [m] to the thing, negative inside, and normals (k, 3)."""
        form: Form = self.thing.form
        return measure(points, np.append(self.axes, self.origin), form_numbers(form), form.kind)


def place_at_rest(handles: Sequence[Handle]) -> list[Placed]:
    """Return obstacles and rigid bodies at their rest poses."""
    return [Placed(each, *each.frame(Pose())) for each in handles if isinstance(each, Obstacle)]


def place_now(handles: Sequence[Handle], poses: Mapping[str, Pose], positions: NDArray[np.float64]) -> list[Placed]:
    """Return obstacles at their commanded poses, and rigid bodies at the poses of their vertices (n, 3) [m]."""
    return [Placed.now(each, poses, positions) for each in handles if isinstance(each, Obstacle)]


def overlaps(placed: Sequence[Placed], names: Collection[str] | None = None) -> Iterator[str]:
    """Yield a sentence with partner, depth and remedy for each penetration of a rigid body in ``names`` (None: all)."""
    for i, one in enumerate(placed):
        if not isinstance(one.thing, RigidBody) or (names is not None and one.thing.name not in names):
            continue
        for j, other in enumerate(placed):
            both = isinstance(other.thing, RigidBody) and (names is None or other.thing.name in names)
            if j == i or (both and j < i):
                continue
            shift = _way_out(one, other)
            depth = float(np.linalg.norm(shift))
            if depth > TOUCHING * _diagonal(one):
                out = ", ".join(f"{value:.3g}" for value in np.round(shift, 9) + 0.0)
                text = f"body {one.thing.name!r} is {depth:.3g} m inside of {other.thing.noun} {other.thing.name!r}"
                unit = "; lengths are in metres" if depth > 1.0 else ""
                yield f"{text}; remedy: shift it by [{out}] m, or put it where it is free{unit}"


def inside_surface(one: Placed, points: NDArray[np.float64], quads: NDArray[np.int32]) -> str:
    """Return a sentence about a rigid body that penetrates the soft body or lies inside of it; empty if it does not.

    Args:
        one: the rigid body.
        points: (n, 3) [m] vertices of the soft body.
        quads: (q, 4) faces of its surface.
    """
    depth = -float(one.measure_points(points[np.unique(quads)])[0].min(initial=0.0))
    triangles = quads[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
    if depth > TOUCHING * _diagonal(one):
        where = f"{depth:.3g} m inside of the soft body"
    elif inside(one.world(SKIN * np.vstack([one.thing.form.skin, np.zeros(3)])), points, triangles).any():
        where = "inside of the soft body, between vertices of its surface"
    else:
        return ""
    return f"body {one.thing.name!r} is {where}; remedy: put it where it is free, and let it be pushed from there"


def _diagonal(one: Placed) -> float:
    return 2.0 * float(np.linalg.norm(one.half))


def _way_out(one: Placed, other: Placed) -> NDArray[np.float64]:
    """Return the shift (3,) [m] that moves a rigid body out of another body or obstacle."""
    shift = np.zeros(3)
    for _ in range(MOST_SHIFTS):
        depth, direction = _depth(replace(one, origin=one.origin + shift), other)
        if depth <= 0.1 * TOUCHING * _diagonal(one):
            break
        shift += depth * direction
    return shift


def _depth(one: Placed, other: Placed) -> tuple[float, NDArray[np.float64]]:
    """Return the penetration depth [m] of a rigid body in another body or obstacle, and the direction (3,) out of it.

    The sum of both signed distances has a minimum over all points; the depth is the negative of this minimum. For
    convex shapes the sum is convex, so a grid that contracts around its least value finds the minimum.
    """
    middle, half = np.zeros(3), one.half
    line = np.linspace(-1.0, 1.0, POINTS)
    grid = np.stack(np.meshgrid(line, line, line, indexing="ij"), axis=-1).reshape(-1, 3)
    least, direction = np.inf, np.zeros(3)
    for _ in range(ROUNDS):
        places = np.clip(middle + grid * half, -one.half, one.half)
        points = one.world(places)
        away, normals = other.measure_points(points)
        sums = away + one.measure_points(points)[0]
        deepest = int(np.argmin(sums))
        if sums[deepest] < least:
            least, direction, middle = float(sums[deepest]), normals[deepest], places[deepest]
        half = CLOSER * half
    return max(0.0, -least), direction
