# SPDX-License-Identifier: Apache-2.0
"""Self-contact: surfaces of a mesh that cannot penetrate each other."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

NAME = "(self)"
"""Name of self-contact in `StepResult.contacts`; no item of a scene can have this name."""


@dataclass(frozen=True, eq=False, kw_only=True)
class SelfContact:
    """Contact of a mesh with itself: of its parts with each other, and of each part with itself.

    Attributes:
        quads: (q, 4) int32 vertex ids of the boundary faces in contact; triangles repeat their last corner.
        triangles: (t, 3) int32 triangles of contact points of skins, which touch instead of faces of cells.
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
