# SPDX-License-Identifier: Apache-2.0
"""Contact results: the vertices that touch an obstacle, or another part of the body."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False, kw_only=True)
class Touch:
    """The vertices, or skin points, that touch an obstacle or another part of the body, with their forces.

    Attributes:
        vertices: (k,) int32; for skin points, the carrier with the largest weight.
        places: (k, 3) [m] positions.
        normals: (k, 3) unit normals out of the obstacle.
        gaps: (k,) [m] distance from each vertex to the obstacle. At a round obstacle the distances are slightly
            positive, because contact closes the mean gap of the faces.
        presses: (k,) [N] normal forces.
        shears: (k, 3) [N] friction forces on the body.
        slips: (k,) whether a vertex slips, or is free to slip.
        points: (k,) int32 index of each skin point among the mesh's skin points, -1 for a vertex; empty for a
            rigid body.
        others: (k,) int32 for self-contact, the partner of each vertex in the pair with the largest force; empty for
            contact with an obstacle.
    """

    vertices: NDArray[np.int32]
    places: NDArray[np.float64]
    normals: NDArray[np.float64]
    gaps: NDArray[np.float64]
    presses: NDArray[np.float64]
    shears: NDArray[np.float64]
    slips: NDArray[np.bool_]
    points: NDArray[np.int32] = field(default_factory=lambda: np.zeros(0, dtype=np.int32))
    others: NDArray[np.int32] = field(default_factory=lambda: np.zeros(0, dtype=np.int32))

    @property
    def forces(self) -> NDArray[np.float64]:
        """Contact force at each vertex (k, 3) [N]."""
        return self.presses[:, None] * self.normals + self.shears


NOTHING = Touch(
    vertices=np.zeros(0, dtype=np.int32),
    places=np.zeros((0, 3)),
    normals=np.zeros((0, 3)),
    gaps=np.zeros(0),
    presses=np.zeros(0),
    shears=np.zeros((0, 3)),
    slips=np.zeros(0, dtype=np.bool_),
)
"""The contact result of an obstacle that nothing touches."""


class Touches(Mapping[str, Touch]):
    """The contacts in a state, by name. Each contact is computed when it is first read.

    Args:
        found: dict from name to a function that returns the contact.
    """

    def __init__(self, found: Mapping[str, Callable[[], Touch]]) -> None:
        self._found: dict[str, Callable[[], Touch] | Touch] = dict(found)

    def __getitem__(self, name: str) -> Touch:
        found = self._found[name]
        if not isinstance(found, Touch):
            found = self._found[name] = found()
        return found

    def __iter__(self) -> Iterator[str]:
        return iter(self._found)

    def __len__(self) -> int:
        return len(self._found)

    def __reduce__(self) -> tuple[type, tuple[dict[str, Touch]]]:
        return dict, (dict(self),)
