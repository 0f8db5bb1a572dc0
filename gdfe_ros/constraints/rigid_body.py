# SPDX-License-Identifier: Apache-2.0
"""Rigid bodies that move freely: what is pushed, grasped and lifted."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gdfe_ros.actuators.embedding import Embedding
from gdfe_ros.actuators.load import AttachedMass
from gdfe_ros.constraints.handle import Axis
from gdfe_ros.constraints.obstacle import Obstacle
from gdfe_ros.constraints.pose import Pose

SIGNS = np.array([[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]])
"""Of the four corners of a box, of which no two share an edge."""


@dataclass(frozen=True, eq=False, kw_only=True)
class RigidBody(Obstacle):
    """An obstacle that nothing moves but forces.

    It is four vertices, a quarter of its mass each, at corners of a box about its centre of mass whose half edges are
    its radii of gyration along its axes: mass, moments of inertia and every point of it follow from theirs.

    Attributes:
        vertices: (4,) int32 that are it, behind those of the mesh.
        fixed: it takes no commands.
        free, turning: all axes.
        mass: [kg].
    """

    fixed: bool = True
    noun: ClassVar[str] = "body"
    section: ClassVar[str] = "bodies"
    free: tuple[Axis, ...] = tuple(Axis)
    turning: tuple[Axis, ...] = tuple(Axis)
    mass: float

    def __post_init__(self) -> None:
        """Allow what other handles may not be: it takes no commands, and all its axes are free."""

    @property
    def gyration(self) -> NDArray[np.float64]:
        """Half edges (3,) [m] of the box whose corners its vertices are."""
        return np.sqrt(self.form.moments)

    @property
    def signs(self) -> NDArray[np.float64]:
        """s_a (4, 3) [1/m]: R = sum_a x_a s_a^T is its rotation."""
        return SIGNS / (4.0 * self.gyration)

    @property
    def places(self) -> NDArray[np.float64]:
        """Where its vertices are at rest (4, 3) [m]."""
        origin, axes = self.frame(Pose())
        return origin + (SIGNS * self.gyration) @ axes.T

    @property
    def attached(self) -> AttachedMass:
        """Its mass, on its vertices."""
        return AttachedMass(name=self.name, points=Embedding.of_vertices(self.vertices), mass=self.mass)

    def numbered(self, first: int) -> RigidBody:
        """Return the body with its vertices from number ``first`` on."""
        return replace(self, vertices=np.arange(first, first + 4, dtype=np.int32))

    def found(self, positions: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return origin (3,) [m] and rotation (3, 3) of its frame for vertices at ``positions`` (n, 3) [m]."""
        own = positions[self.vertices]
        return own.mean(axis=0), own.T @ self.signs

    def pose(self, commanded: Pose, positions: NDArray[np.float64]) -> Pose:
        """Return where it is, relative to rest, for vertices at ``positions`` (n, 3) [m]."""
        origin, axes = self.found(positions)
        turned = Rotation.from_matrix(axes) * Rotation.from_rotvec(self.turn).inv()
        return Pose(tuple(origin - self.origin), tuple(turned.as_rotvec()))
