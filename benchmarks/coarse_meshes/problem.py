# SPDX-License-Identifier: Apache-2.0
"""A small deformation of a linear elastic body: constraints, forces and the measured quantity."""

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
    """Vertices that are moved like a rigid body.

    Attributes:
        vertices: sorted ids of the vertices (k,).
        pose: small prescribed motion.
        free: axes along which the vertices slide without a force.
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
    """Solution of a `Problem`.

    Attributes:
        displacement: displacements (n, 3) [m] of all vertices.
        reactions: dict from a name in ``held`` to the wrench (6,) on the body: force [N], then moment [N m] about the
            mean of the held vertices.
    """

    displacement: Array
    reactions: Mapping[str, Array]


@dataclass(frozen=True, kw_only=True)
class Problem:
    """Input of every solver: body, constraints, forces and the measured quantity.

    Attributes:
        mesh: mesh of the body.
        poisson: Poisson's ratio.
        held: dict from name to held vertices.
        forces: dead forces on the vertices (n, 3) [N]; None if there are none.
        measure: function from a solution to the measured quantity divided by its exact value.
    """

    mesh: HexMesh
    poisson: float
    held: Mapping[str, Held]
    measure: Callable[[Found], float]
    forces: Array | None = None

    def prescribed(self) -> tuple[NDArray[np.int64], Array]:
        """Return the prescribed degrees of freedom 3 v + axis (k,), sorted, and their displacements (k,) [m]."""
        given = {}
        for held in self.held.values():
            for vertex, moved in zip(held.vertices, held.displacement(self.mesh.vertices), strict=True):
                given |= {3 * int(vertex) + axis: moved[axis] for axis in Axis if axis not in held.free}
        return np.array(sorted(given)), np.array([given[key] for key in sorted(given)])

    def found(self, displacement: Array, forces: Array) -> Found:
        """Return the solution with displacements (n, 3) [m] and with the reactions from nodal forces (n, 3) [N]."""
        reactions = {}
        for name, held in self.held.items():
            own = self.mesh.vertices[held.vertices]
            pull = forces[held.vertices]
            reactions[name] = np.concatenate([pull.sum(axis=0), np.cross(own - own.mean(axis=0), pull).sum(axis=0)])
        return Found(displacement=displacement, reactions=reactions)
