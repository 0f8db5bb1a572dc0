# SPDX-License-Identifier: Apache-2.0
"""Rigid bodies that move freely: objects to push, grasp and lift."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gdfe_ros.actuators.embedding import Embedding
from gdfe_ros.actuators.load import AttachedMass
from gdfe_ros.constraints.form import Sphere
from gdfe_ros.constraints.handle import Axis, Handle
from gdfe_ros.constraints.obstacle import Obstacle
from gdfe_ros.constraints.pose import Pose

SIGNS = np.array([[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]])
"""Signs of four corners of a box; no two of these corners are connected by an edge."""


@dataclass(frozen=True, eq=False, kw_only=True)
class RigidBody(Obstacle):
    """An obstacle that moves freely under forces.

    Four vertices represent it, each with a quarter of its mass. They are corners of a box around its centre of mass.
    The half edges of the box are the radii of gyration along its axes. The four vertices determine the mass, the
    moments of inertia and the position of every point of the body.

    Attributes:
        vertices: (4,) int32 ids of the four vertices, which follow the vertices of the mesh.
        fixed: true, because the body accepts no commands.
        free, turning: all axes, because no motion is constrained.
        mass: mass of the body [kg].
    """

    fixed: bool = True
    noun: ClassVar[str] = "body"
    section: ClassVar[str] = "bodies"
    free: tuple[Axis, ...] = tuple(Axis)
    turning: tuple[Axis, ...] = tuple(Axis)
    mass: float

    def __post_init__(self) -> None:
        """Skip the check of handles: a rigid body accepts no commands, and all its axes are free."""

    @property
    def gyration(self) -> NDArray[np.float64]:
        """Radii of gyration (3,) [m]: half edges of the box whose corners are the vertices."""
        return np.sqrt(self.form.moments)

    @property
    def signs(self) -> NDArray[np.float64]:
        """Factors s_a (4, 3) [1/m] that give the body's rotation R = sum_a x_a s_a^T from its vertices x_a."""
        return SIGNS / (4.0 * self.gyration)

    @property
    def places(self) -> NDArray[np.float64]:
        """Positions of the vertices in the rest pose, (4, 3) [m]."""
        origin, axes = self.frame(Pose())
        return origin + (SIGNS * self.gyration) @ axes.T

    @property
    def attached(self) -> AttachedMass:
        """The body's mass, attached to its vertices."""
        return AttachedMass(name=self.name, points=Embedding.of_vertices(self.vertices), mass=self.mass)

    def renumber(self, first: int) -> RigidBody:
        """Return the body with the vertex ids ``first`` .. ``first`` + 3."""
        return replace(self, vertices=np.arange(first, first + 4, dtype=np.int32))

    def find_frame(self, positions: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the origin (3,) [m] and the rotation (3, 3) of the body's frame.

        ``positions`` (n, 3) [m] has all vertices of the body and its rigid bodies.
        """
        own = positions[self.vertices]
        return own.mean(axis=0), own.T @ self.signs

    def pose(self, commanded: Pose, positions: NDArray[np.float64]) -> Pose:
        """Return the body's pose relative to its rest pose; ``positions`` (n, 3) [m] are those of all vertices."""
        origin, axes = self.find_frame(positions)
        turned = Rotation.from_matrix(axes) * Rotation.from_rotvec(self.turn).inv()
        return Pose(tuple(origin - self.origin), tuple(turned.as_rotvec()))


def rigid_among(handles: Iterable[Handle]) -> tuple[RigidBody, ...]:
    """Return the rigid bodies among handles, in their order."""
    return tuple(each for each in handles if isinstance(each, RigidBody))


def rigid_pairs(touched: Sequence[Obstacle]) -> Iterator[tuple[RigidBody, Obstacle]]:
    """Yield pairs (rigid body, obstacle or other rigid body); points of the first are tested against the second.

    The points of a body are not tested against a rigid ball: the test of the ball's centre against the body finds the
    contact exactly. Of two rigid balls, the centre of the first ball is tested against the second ball.
    """
    for i, rigid in enumerate(touched):
        for j, thing in enumerate(touched):
            ball = isinstance(thing, RigidBody) and isinstance(thing.form, Sphere)
            if isinstance(rigid, RigidBody) and i != j and not (ball and (j < i or not isinstance(rigid.form, Sphere))):
                yield rigid, thing
