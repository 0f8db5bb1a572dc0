# SPDX-License-Identifier: Apache-2.0
"""Forces as arrows in the 3-D view."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import viser
from numpy.typing import NDArray

_LONGEST = 0.35
"""Length of the arrow for the largest force so far, divided by the body's size."""
_LEAST_SHARE = 0.01
"""A force has no arrow if it is below this fraction of the largest force so far."""
_SHAFT, _HEAD, _HEAD_LENGTH = 0.008, 0.022, 0.05
"""Radii of an arrow's shaft and head, and length of its head, divided by the body's size."""


class Arrows:
    """Draws forces as arrows that end at the points of action; lengths are relative to the largest force so far.

    Args:
        space: 3-D space of the page.
        group: name of the parent scene node.
        colours: dict from a kind of forces to the colour of its arrows: red, green and blue, 0 to 255.
        size: size of the body in the units of the view.
        thin: factor on the default thickness of the arrows.

    Attributes:
        largest: largest of the forces that were drawn last [N].
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
        self._size, self.largest, self._so_far = size, 0.0, 0.0
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

    def draw(
        self, forces: Mapping[str, tuple[NDArray[np.float64], NDArray[np.float64]]], *, noise: float = 0.0
    ) -> None:
        """Draw the forces of each kind.

        Args:
            forces: dict from a kind to end points (k, 3) in the units of the view, and force vectors (k, 3) [N].
            noise: size [N] of forces that are errors of the solve; these have no arrow, and set no scale.
        """
        sizes = {kind: np.linalg.norm(vectors, axis=1) for kind, (_, vectors) in forces.items()}
        self.largest = max((float(each.max(initial=0.0)) for each in sizes.values()), default=0.0)
        if self.largest > noise:
            self._so_far = max(self._so_far, self.largest)
        for kind, (ends, vectors) in forces.items():
            node, wanted = self._nodes[kind], sizes[kind] > max(noise, _LEAST_SHARE * self._so_far)
            node.visible = bool(wanted.any())
            if node.visible:
                shafts = vectors[wanted] * (_LONGEST * self._size / self._so_far)
                node.points = np.stack([ends[wanted] - shafts, ends[wanted]], axis=1).astype(np.float32)
