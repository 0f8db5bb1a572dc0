# SPDX-License-Identifier: Apache-2.0
"""Contact points of a skin: in contact, they replace the boundary vertices of the cells."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.mesh.cells.tetrahedra import flat_quads
from gdfe_ros.mesh.outside import Outside


@dataclass(frozen=True, eq=False)
class Touching:
    """Contact points and contact surface of the meshes of a body whose contact is on a skin, not on cell faces.

    Attributes:
        corners: (p, 8) int32 vertices of the cell that carries each contact point.
        weights: (p, 8) weights of these vertices, which sum to one for each point.
        faces: (f, 3) int32 closed surface of triangles of contact points, with which skins touch each other.
        vertices: (v,) int32 all vertices of these meshes.
        surface: the skins of these meshes.
    """

    corners: NDArray[np.int32]
    weights: NDArray[np.float64]
    faces: NDArray[np.int32]
    vertices: NDArray[np.int32]
    surface: Outside

    @classmethod
    def join(cls, parts: Sequence[tuple[Touching, int, int]]) -> Touching:
        """Return the contact points and surfaces of several meshes as one.

        Each item of ``parts`` has the contact points of one mesh, and the indices of this mesh's first vertex and first
        cell in the assembly.
        """
        each, vertices, cells = zip(*parts, strict=True)
        before = np.cumsum([0, *(len(one.corners) for one in each[:-1])])
        return cls(
            np.concatenate([one.corners + np.int32(first) for one, first in zip(each, vertices, strict=True)]),
            np.concatenate([one.weights for one in each]),
            np.concatenate([one.faces + np.int32(first) for one, first in zip(each, before, strict=True)]),
            np.concatenate([one.vertices + np.int32(first) for one, first in zip(each, vertices, strict=True)]),
            Outside.join([one.surface for one in each], vertices, cells),
        )

    def at(self, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the positions (p, 3) [m] of the contact points for vertices at ``positions`` (n, 3) [m]."""
        return np.einsum("pa,pai->pi", self.weights, positions[self.corners])

    def without(self, quads: NDArray[np.int32]) -> NDArray[np.int32]:
        """Return the boundary faces of the meshes without a skin; ``quads`` (q, c) are those of all meshes."""
        return quads[~np.isin(quads[:, 0], self.vertices)]


def outline(
    quads: NDArray[np.int32], touching: Touching | None, positions: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Return the contact surface for vertices at ``positions`` (n, 3) [m]: points (k, 3) [m], and quads of point ids.

    ``quads`` (q, 4) are the boundary faces of all meshes. A triangle of a skin becomes a quad whose last two corners
    are equal.
    """
    if touching is None:
        return positions, quads
    lined = flat_quads(touching.surface.triangles) + len(positions)
    points = np.concatenate([positions, touching.surface.at(positions)])
    return points, np.concatenate([touching.without(quads), lined]).astype(np.int32)
