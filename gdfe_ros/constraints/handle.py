# SPDX-License-Identifier: Apache-2.0
"""A handle: vertices that are fixed, move together as a rigid body, or each slide along axes of the world."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gdfe_ros.constraints.pose import Pose


class Axis(IntEnum):
    """A world axis (REP-103)."""

    X = 0
    Y = 1
    Z = 2


@dataclass(frozen=True)
class Handle:
    """Vertices that a commanded pose moves as a rigid body.

    Attributes:
        name: name, unique in the scene; part of topic names.
        vertices: sorted vertex ids (k,) int32.
        fixed: whether the handle stays at its rest pose and accepts no commands.
        free: world axes along which the handle slides without a force; its displacement along them is an unknown.
        turning: world axes, through the handle's centre, about which it rotates freely. The rotation vector's
            components along these axes are unknowns, for which the energy is minimal. With one or three free axes the
            moment about them is zero.
        slide: (k, 3) bool, the axes along which each vertex slides by itself, as on rollers; None: the vertices move
            together.
        bears: for rollers that share vertices with others: vertices (b,), and the axes (b, 3) bool along which this
            handle takes their forces; None: all forces on ``vertices``.
        carrier: name of the arm that moves the handle; empty if the handle accepts commands.
        noun: name of this kind of item in messages.
        section: section of this kind of item in scene files and topic names.
    """

    noun: ClassVar[str] = "handle"
    section: ClassVar[str] = "handles"
    name: str
    vertices: NDArray[np.int32]
    fixed: bool = False
    free: tuple[Axis, ...] = ()
    turning: tuple[Axis, ...] = ()
    slide: NDArray[np.bool_] | None = None
    bears: tuple[NDArray[np.int32], NDArray[np.bool_]] | None = None
    carrier: str = ""

    def __post_init__(self) -> None:
        if self.fixed and self.loose and self.slide is None:
            raise ValueError(f"handle {self.name!r} is fixed and has free axes; drop one of the two")

    @property
    def loose(self) -> bool:
        """Whether the handle or its vertices slide or rotate freely, so that the solver computes part of the pose."""
        return bool(self.free or self.turning)

    @property
    def pieces(self) -> tuple[Handle, ...]:
        """The parts that move as rigid bodies: the handle itself, or none if its vertices are on rollers."""
        return (self,) if self.slide is None else ()

    def seen_from(self, origin: NDArray[np.float64]) -> Handle:
        """Return this handle for positions relative to ``origin`` (3,) [m]: handles do not depend on the origin."""
        return self

    def centre(self, vertices: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the mean position (3,) [m] of the handle's vertices; ``vertices`` (n, 3) are all vertices."""
        return vertices[self.vertices].mean(axis=0)

    def error(self, target: Pose, rest: NDArray[np.float64], positions: NDArray[np.float64]) -> float:
        """Return the largest deviation [m] of the handle's vertices from its target, along axes that are not free.

        For a handle that rotates freely, it is the deviation of the centre. ``rest`` and ``positions`` (n, 3) [m] are
        the body's vertices, undeformed and now.
        """
        before, now = rest[self.vertices], positions[self.vertices]
        centre = before.mean(axis=0)
        wanted = Rotation.from_rotvec(target.rotation).apply(before - centre) + centre + target.translation
        error = np.abs((now - wanted).mean(axis=0) if self.turning else now - wanted)
        free = np.isin(list(Axis), self.free) if self.slide is None else self.slide
        return float(np.where(free, 0.0, error).max(initial=0.0))
