# SPDX-License-Identifier: Apache-2.0
"""Self-contact: surfaces of a mesh that cannot penetrate each other."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

NAME = "(self)"
"""Name of self-contact in `StepResult.contacts`; no item of a scene can have it."""


@dataclass(frozen=True, eq=False, kw_only=True)
class SelfContact:
    """Contact of a mesh with itself: of its parts with each other, and of each with itself.

    Attributes:
        quads: (q, 4) int32 boundary faces that take part.
        friction: Coulomb's coefficient.
        parts: index of the first vertex of each of several meshes, by name; empty for one mesh.
        origin: (3,) [m] of the solver's positions.
    """

    quads: NDArray[np.int32]
    friction: float = 0.0
    parts: Mapping[str, int] = field(default_factory=dict)
    origin: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))

    def seen_from(self, origin: NDArray[np.float64]) -> SelfContact:
        """Return this definition for positions relative to ``origin`` (3,) [m]."""
        return replace(self, origin=origin)

    def owner(self, vertex: int) -> str:
        """Return the name of the mesh to which a vertex belongs."""
        names = [name for name, first in self.parts.items() if first <= vertex]
        return f"mesh {names[-1]!r}" if names else "the body"
