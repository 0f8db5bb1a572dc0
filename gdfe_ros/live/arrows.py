# SPDX-License-Identifier: Apache-2.0
"""Forces as arrows in the picture."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import viser
from numpy.typing import NDArray

_LONGEST = 0.35
"""Of the body's size: the arrow of the largest force so far."""
_LEAST_SHARE = 0.01
"""Of the largest force so far: smaller ones have no arrow."""
_SHAFT, _HEAD, _HEAD_LENGTH = 0.008, 0.022, 0.05
"""Of the body's size: radii and length."""


class Arrows:
    """Arrows that end where a force acts; their length is to the largest force so far.

    Args:
        space: of the page.
        group: name of the node that they hang on.
        colours: red, green and blue of each kind, 0 to 255.
        size: of the body in the units of the picture.
        thin: over the usual thickness.

    Attributes:
        largest: the largest force so far [N].
    """

    def __init__(
        self,
        space: viser.SceneApi,
        group: str,
        colours: Mapping[str, tuple[int, int, int]],
        *,
        size: float,
        thin: float = 1.0,
    ) -> None:
        self._size, self.largest = size, 0.0
        self._nodes = {
            kind: space.add_arrows(
                f"{group}/{kind}",
                np.zeros((1, 2, 3), np.float32),
                colour,
                shaft_radius=thin * _SHAFT * size,
                head_radius=thin * _HEAD * size,
                head_length=thin * _HEAD_LENGTH * size,
                visible=False,
            )
            for kind, colour in colours.items()
        }

    def draw(self, forces: Mapping[str, tuple[NDArray[np.float64], NDArray[np.float64]]]) -> None:
        """Draw the forces of each kind: where they end (k, 3) in the units of the picture, and what they are [N]."""
        sizes = {kind: np.linalg.norm(vectors, axis=1) for kind, (_, vectors) in forces.items()}
        self.largest = max(self.largest, *(float(each.max(initial=0.0)) for each in sizes.values()))
        for kind, (ends, vectors) in forces.items():
            node, wanted = self._nodes[kind], sizes[kind] > _LEAST_SHARE * self.largest
            node.visible = bool(wanted.any())
            if node.visible:
                ways = vectors[wanted] * (_LONGEST * self._size / self.largest)
                node.points = np.stack([ends[wanted] - ways, ends[wanted]], axis=1).astype(np.float32)
