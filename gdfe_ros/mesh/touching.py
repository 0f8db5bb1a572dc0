# SPDX-License-Identifier: Apache-2.0
"""Contact points of a skin, used instead of the vertices of the cells' faces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.mesh.outside import Outside


@dataclass(frozen=True, eq=False)
class Touching:
    """Contact points and surface of the meshes of a body that touch by their skins.

    Attributes:
        corners: (p, 8) int32 vertices of the cell that carries each contact point.
        weights: (p, 8) their weights, which sum to one.
        vertices: (v,) int32 vertices of the meshes with such a skin, whose faces do not touch.
        surface: the skins of these meshes.
    """

    corners: NDArray[np.int32]
    weights: NDArray[np.float64]
    vertices: NDArray[np.int32]
    surface: Outside

    @classmethod
    def joined(cls, parts: Sequence[tuple[Touching, int, int]]) -> Touching:
        """Return several of them as one; each comes with the indices of its mesh's first vertex and first cell."""
        each, vertices, cells = zip(*parts, strict=True)
        return cls(
            np.concatenate([one.corners + np.int32(first) for one, first in zip(each, vertices, strict=True)]),
            np.concatenate([one.weights for one in each]),
            np.concatenate([one.vertices + np.int32(first) for one, first in zip(each, vertices, strict=True)]),
            Outside.joined([one.surface for one in each], vertices, cells),
        )

    def at(self, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the positions (p, 3) [m] of the points for vertices at ``positions`` (n, 3) [m]."""
        return np.einsum("pa,pai->pi", self.weights, positions[self.corners])


def outline(
    quads: NDArray[np.int32], touching: Touching | None, positions: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Return the contact surface for vertices at ``positions`` (n, 3) [m]: points [m], and quads between them.

    ``quads`` (q, 4) are the faces of all cells; a triangle of a skin repeats its last corner.
    """
    if touching is None:
        return positions, quads
    bare = quads[~np.isin(quads[:, 0], touching.vertices)]
    lined = touching.surface.triangles[:, [0, 1, 2, 2]] + len(positions)
    return np.concatenate([positions, touching.surface.at(positions)]), np.concatenate([bare, lined]).astype(np.int32)
