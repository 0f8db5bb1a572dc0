# SPDX-License-Identifier: Apache-2.0
"""A small deformation of a linear body: what is held and how, what acts on it, and what is measured."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.constraints import Axis, Pose
from gdfe_ros.mesh import HexMesh

Array = NDArray[np.float64]
YOUNG = 1e5
"""Young's modulus of every body [Pa]."""


@dataclass(frozen=True, kw_only=True)
class Held:
    """Vertices that are moved as one rigid piece.

    Attributes:
        vertices: (k,) sorted ids.
        pose: where they are moved; small.
        free: axes along which they slide without a force.
    """

    vertices: NDArray[np.int32]
    pose: Pose = field(default_factory=Pose)
    free: tuple[Axis, ...] = ()

    def displacement(self, rest: Array) -> Array:
        """Return the linearised displacement (k, 3) [m] of the held vertices."""
        own = rest[self.vertices]
        return np.add(self.pose.translation, np.cross(self.pose.rotation, own - own.mean(axis=0)))


@dataclass(frozen=True, kw_only=True)
class Found:
    """A solution.

    Attributes:
        displacement: (n, 3) [m] of all vertices.
        reactions: (6,) by name of what is held: force [N] that it exerts on the body, then moment [N m] about the mean
            of its vertices.
    """

    displacement: Array
    reactions: Mapping[str, Array]


@dataclass(frozen=True, kw_only=True)
class Problem:
    """What every code is given.

    Attributes:
        mesh: the body.
        poisson: Poisson's ratio.
        held: by name.
        forces: (n, 3) dead forces on the vertices [N]; None for none.
        measure: what a solution shows, over what it should.
    """

    mesh: HexMesh
    poisson: float
    held: Mapping[str, Held]
    measure: Callable[[Found], float]
    forces: Array | None = None

    def prescribed(self) -> tuple[NDArray[np.int64], Array]:
        """Return the degrees of freedom 3 v + axis (k,) that are given, sorted, and their displacements (k,) [m]."""
        given = {}
        for held in self.held.values():
            for vertex, moved in zip(held.vertices, held.displacement(self.mesh.vertices), strict=True):
                given |= {3 * int(vertex) + axis: moved[axis] for axis in Axis if axis not in held.free}
        return np.array(sorted(given)), np.array([given[key] for key in sorted(given)])

    def found(self, displacement: Array, forces: Array) -> Found:
        """Return a solution from displacements (n, 3) [m] and from all nodal forces (n, 3) [N] on what is held."""
        reactions = {}
        for name, held in self.held.items():
            own = self.mesh.vertices[held.vertices]
            pull = forces[held.vertices]
            reactions[name] = np.concatenate([pull.sum(axis=0), np.cross(own - own.mean(axis=0), pull).sum(axis=0)])
        return Found(displacement=displacement, reactions=reactions)
