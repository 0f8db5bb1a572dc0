# SPDX-License-Identifier: Apache-2.0
"""Surfaces of a mesh that cannot enter each other."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

NAME = "(self)"
"""Of what touches there, in `StepResult.contacts`; nothing in a scene can be called that."""


@dataclass(frozen=True, eq=False, kw_only=True)
class SelfContact:
    """Contact of a mesh with itself: of its parts with each other, and of each with itself.

    Attributes:
        quads: (q, 4) int32 boundary faces that take part.
        friction: Coulomb's coefficient.
        parts: number of the first vertex of each of several meshes, by name; empty where there is one.
        origin: (3,) [m] from which the solver counts positions.
    """

    quads: NDArray[np.int32]
    friction: float = 0.0
    parts: Mapping[str, int] = field(default_factory=dict)
    origin: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))

    def seen_from(self, origin: NDArray[np.float64]) -> SelfContact:
        """Return the same for a solver that counts positions from ``origin`` (3,) [m]."""
        return replace(self, origin=origin)

    def owner(self, vertex: int) -> str:
        """Name the mesh that a vertex belongs to."""
        names = [name for name, first in self.parts.items() if first <= vertex]
        return f"mesh {names[-1]!r}" if names else "the body"
