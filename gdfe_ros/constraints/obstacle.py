# SPDX-License-Identifier: Apache-2.0
"""Rigid obstacles, which have no vertices and act by contact: commanded ones, links of arms, and the mesh itself."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import lru_cache
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gdfe_ros.constraints.form import Form
from gdfe_ros.constraints.handle import Handle
from gdfe_ros.constraints.pose import Pose

_Vector = tuple[float, float, float]


class ContactPoints(str, Enum):
    """Definition of the contact gap of a vertex: the mean gap of the faces around it, or the gap at the vertex."""

    FACES = "faces"
    VERTICES = "vertices"


@dataclass(frozen=True, eq=False, kw_only=True)
class Obstacle(Handle):
    """A rigid shape that the body cannot penetrate.

    The reaction of an obstacle is its force on the body, as for a handle. Its moment is about the origin of its frame.

    Attributes:
        vertices: empty, because an obstacle has no vertices.
        form: shape in the obstacle's frame.
        origin: origin of the obstacle's frame in the rest pose [m].
        turn: rotation vector of the obstacle's frame in the rest pose [rad].
        friction: Coulomb's coefficient of friction.
        restitution: ratio of the normal speeds of a point after and before an impact, between 0 and 1.
        points: definition of contact gaps.
    """

    noun: ClassVar[str] = "obstacle"
    section: ClassVar[str] = "obstacles"
    vertices: NDArray[np.int32] = field(default_factory=lambda: np.zeros(0, dtype=np.int32))
    form: Form
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    turn: tuple[float, float, float] = (0.0, 0.0, 0.0)
    friction: float = 0.0
    restitution: float = 0.0
    points: ContactPoints = ContactPoints.FACES

    def seen_from(self, origin: NDArray[np.float64]) -> Obstacle:
        """Return the obstacle for positions relative to ``origin`` (3,) [m]."""
        return replace(self, origin=tuple(np.subtract(self.origin, origin).tolist()))

    def centre(self, vertices: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the origin (3,) [m] of the obstacle's frame in the rest pose; ``vertices`` are not used."""
        return np.array(self.origin)

    def error(self, target: Pose, rest: NDArray[np.float64], positions: NDArray[np.float64]) -> float:
        """Return 0 [m]: an obstacle is always at its target, and a rigid body has no target."""
        return 0.0

    def pose(self, commanded: Pose, positions: NDArray[np.float64]) -> Pose:
        """Return the commanded pose, which is the obstacle's pose relative to its rest pose."""
        return commanded

    def frame(self, pose: Pose) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the origin (3,) [m] and the rotation (3, 3) of the obstacle's frame at ``pose``; both read-only."""
        return _frame(self.origin, self.turn, pose.translation, pose.rotation)


@lru_cache(maxsize=1024)
def _frame(origin: _Vector, turn: _Vector, shift: _Vector, rotation: _Vector) -> tuple[NDArray, NDArray]:
    """Return origin and rotation of a frame; cached, because each contact needs them several times."""
    axes = (Rotation.from_rotvec(rotation) * Rotation.from_rotvec(turn)).as_matrix()
    place = np.add(origin, shift)
    place.flags.writeable = axes.flags.writeable = False
    return place, axes


@dataclass(frozen=True, eq=False, kw_only=True)
class ArmLink(Obstacle):
    """A convex piece of an arm's link: an obstacle that only the arm's joints move.

    Attributes:
        fixed: true, because the piece accepts no commands of its own.
        arm: name of the arm.
        link: name of the link.
    """

    noun: ClassVar[str] = "link"
    section: ClassVar[str] = "links"
    fixed: bool = True
    arm: str
    link: str


NAME = "(self)"
"""Name of self-contact in `StepResult.contacts`; no item of a scene can have this name."""


@dataclass(frozen=True, eq=False, kw_only=True)
class SelfContact:
    """Contact of a mesh with itself: of its parts with each other, and of each part with itself.

    Attributes:
        quads: (q, 4) int32 vertex ids of the boundary faces in contact; triangles repeat their last corner.
        triangles: (t, 3) int32 triangles of skins: ids of their contact points. A skin touches in place of cell faces.
        friction: Coulomb's coefficient of friction.
        restitution: ratio of the normal speeds of a point after and before an impact, between 0 and 1.
        parts: dict from the name of each mesh of an assembly to the index of its first vertex; empty for a single mesh.
        origin: (3,) [m] point to which the solver's positions are relative.
    """

    quads: NDArray[np.int32]
    triangles: NDArray[np.int32] = field(default_factory=lambda: np.zeros((0, 3), np.int32))
    friction: float = 0.0
    restitution: float = 0.0
    parts: Mapping[str, int] = field(default_factory=dict)
    origin: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))

    def seen_from(self, origin: NDArray[np.float64]) -> SelfContact:
        """Return this definition for positions relative to ``origin`` (3,) [m]."""
        return replace(self, origin=origin)

    def owner(self, vertex: int) -> str:
        """Return a text that names the mesh to which a vertex belongs, for messages."""
        names = [name for name, first in self.parts.items() if first <= vertex]
        return f"mesh {names[-1]!r}" if names else "the body"
