# SPDX-License-Identifier: Apache-2.0
"""A handle: vertices that are held, or move together as one rigid piece."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray


class Axis(IntEnum):
    """A world axis (REP-103)."""

    X = 0
    Y = 1
    Z = 2


@dataclass(frozen=True)
class Handle:
    """Vertices moved rigidly by a commanded pose.

    Attributes:
        name: unique in the scene; part of topic names.
        vertices: sorted vertex ids (k,) int32.
        fixed: the handle stays at its rest pose and accepts no commands.
        free: world axes along which the handle slides unloaded; its position there is an unknown.
        turning: world axes, through the handle's centre, about which it rotates freely. The rotation vector's
            components along these axes are unknowns. With one or three free axes no moment remains; with two the energy
            is minimal.
        carrier: name of the arm that moves it; empty if it takes commands of its own.
        noun: its name in messages.
        section: its section in scene files and topic names.
    """

    noun: ClassVar[str] = "handle"
    section: ClassVar[str] = "handles"
    name: str
    vertices: NDArray[np.int32]
    fixed: bool = False
    free: tuple[Axis, ...] = ()
    turning: tuple[Axis, ...] = ()
    carrier: str = ""

    def __post_init__(self) -> None:
        if self.fixed and (self.free or self.turning):
            raise ValueError(f"handle {self.name!r} is fixed and has free axes; drop one of the two")

    def seen_from(self, origin: NDArray[np.float64]) -> Handle:
        """Return this handle for positions relative to ``origin`` (3,) [m]: handles do not depend on the origin."""
        return self

    def centre(self, vertices: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the mean (3,) [m] of the handle's vertices out of all ``vertices`` (n, 3)."""
        return vertices[self.vertices].mean(axis=0)
