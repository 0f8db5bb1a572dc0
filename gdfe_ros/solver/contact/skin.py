# SPDX-License-Identifier: Apache-2.0
"""The contact surface of a body with an embedded skin."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.solver.body import Body
from gdfe_ros.solver.contact.surface import ContactSurface, driven_vertices

HELD = 0.5
"""A skin point is driven, and left out of contact, if at least this fraction of its weights is on driven vertices."""


@dataclass(frozen=True, eq=False)
class Skin(ContactSurface):
    """Contact points of a body with a skin: the skin points, and the vertices of faces without a skin.

    Attributes:
        carriers: (k, 8) int32 corners of the cell that carries each point; for a vertex, eight times itself.
        weights: (k, 8) weights of the carriers; for a vertex, the first is one.
        areas: (k,) [m^2] undeformed area of the faces that belongs to each vertex. It is infinite for a skin point, so
            that integrals over faces have no effect on it.
        points: (k,) int32 index of each point among the mesh's skin points; -1 for a vertex.
        driven: (n,) bool, whether handles drive each vertex.
    """

    points: NDArray[np.int32]
    driven: NDArray[np.bool_]

    @classmethod
    def of(cls, body: Body) -> Skin:
        """Return the contact surface of a body with skin points, without the points that handles drive."""
        skin, driven, bare = body.skin, driven_vertices(body), ContactSurface.of(body)
        held = (np.abs(skin.weights) * driven[skin.corners]).sum(axis=1) / np.abs(skin.weights).sum(axis=1)
        kept = np.flatnonzero(held < HELD)
        count = len(bare.carriers)
        return cls(
            carriers=np.concatenate([np.repeat(bare.carriers, 8, axis=1), skin.corners[kept]]),
            weights=np.concatenate([np.eye(1, 8).repeat(count, axis=0), skin.weights[kept]]),
            areas=np.concatenate([bare.areas, np.full(len(kept), np.inf)]),
            quads=bare.quads,
            gauss=bare.gauss,
            spread=bare.spread,
            points=np.concatenate([np.full(count, -1), kept]).astype(np.int32),
            driven=driven,
        )

    @property
    def vertices(self) -> NDArray[np.int32]:
        """For each point (k,), its carrier with the largest weight."""
        most = np.abs(self.weights).argmax(axis=1)
        return self.carriers[np.arange(len(most)), most]

    @property
    def reach(self) -> float:
        """Upper bound of a point's displacement, divided by the largest displacement of its carriers.

        It exceeds 1 for points outside their cell.
        """
        return max(1.0, float(np.abs(self.weights).sum(axis=1).max(initial=0.0)))

    def at(self, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the positions (k, 3) [m] of the points for vertices at ``positions`` (n, 3) [m]."""
        return np.einsum("ka,kai->ki", self.weights, positions[self.carriers])

    def stiffness(self, diagonal: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the stiffness (k,) [N/m] of the points, from the constant matrix' diagonal (n,) [N/m].

        Together, the points with a common carrier are at most as stiff as this carrier.
        """
        return 1.0 / compliances(self.carriers, self.weights, self.driven, diagonal)

    def about(self, points: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the faces that have one of ``points`` as a corner; skin points are ignored."""
        return super().about(points[self.points[points] < 0])


def compliances(
    carriers: NDArray[np.int32],
    weights: NDArray[np.float64],
    driven: NDArray[np.bool_],
    diagonal: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the compliances (k,) [m/N] of points with carriers and weights (k, 8).

    A point's compliance is the sum of its free carriers' compliances times their squared weights. Points with a common
    carrier divide its stiffness. The compliance is 0 if all carriers are driven.

    Args:
        carriers: (k, 8) vertices that carry each point.
        weights: (k, 8) their weights.
        driven: (n,) whether handles drive each vertex.
        diagonal: (n,) [N/m] diagonal of the constant matrix.
    """
    squares = np.where(driven[carriers], 0.0, weights**2)
    alone = (squares / diagonal[carriers]).sum(axis=1)
    asked = np.zeros_like(diagonal)
    np.add.at(asked, carriers, squares / np.where(alone > 0.0, alone, np.inf)[:, None])
    crowd = np.where(squares > 0.0, (asked / diagonal)[carriers], 0.0).max(axis=1, initial=0.0)
    return alone * np.maximum(crowd, 1.0)
