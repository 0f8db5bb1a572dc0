# SPDX-License-Identifier: Apache-2.0
"""Rigid obstacles: a pose moves them like a handle, but they hold no vertices and act by contact."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import Enum
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gdfe_ros.constraints.form import Form
from gdfe_ros.constraints.handle import Handle
from gdfe_ros.constraints.pose import Pose


def _no_vertices() -> NDArray[np.int32]:
    return np.zeros(0, dtype=np.int32)


class ContactPoints(str, Enum):
    """Evaluation of gaps: mean over the faces around each vertex, or at the vertex alone."""

    FACES = "faces"
    VERTICES = "vertices"


@dataclass(frozen=True, eq=False, kw_only=True)
class Obstacle(Handle):
    """A rigid shape that the body cannot enter.

    Its reaction is its force on the body, as for a handle; the moment is about the origin of its frame.

    Attributes:
        vertices: none.
        form: its shape.
        origin: origin of its frame in the rest pose [m].
        turn: rotation vector of its frame in the rest pose [rad].
        friction: Coulomb's coefficient.
        points: evaluation of gaps.
    """

    noun: ClassVar[str] = "obstacle"
    section: ClassVar[str] = "obstacles"
    vertices: NDArray[np.int32] = field(default_factory=_no_vertices)
    form: Form
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    turn: tuple[float, float, float] = (0.0, 0.0, 0.0)
    friction: float = 0.0
    points: ContactPoints = ContactPoints.FACES

    def seen_from(self, origin: NDArray[np.float64]) -> Obstacle:
        """Return the obstacle relative to ``origin`` (3,) [m]."""
        return replace(self, origin=tuple(np.subtract(self.origin, origin).tolist()))

    def centre(self, vertices: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the origin (3,) [m] of its frame in the rest pose; ``vertices`` are not used."""
        return np.array(self.origin)

    def pose(self, commanded: Pose, positions: NDArray[np.float64]) -> Pose:
        """Return the commanded pose, which is the obstacle's pose relative to its rest pose."""
        return commanded

    def frame(self, pose: Pose) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return origin (3,) [m] and rotation (3, 3) of its frame at ``pose``."""
        turned = Rotation.from_rotvec(pose.rotation) * Rotation.from_rotvec(self.turn)
        return np.add(self.origin, pose.translation), turned.as_matrix()
