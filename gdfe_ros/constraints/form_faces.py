# SPDX-License-Identifier: Apache-2.0
"""The faces of rigid shapes, for pictures."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.constraints.form import Box, Capsule, Cylinder, Sphere, TriangleMesh

AROUND, ALONG = 32, 16
"""Number of faces of a drawn round shape around its axis, and number of faces from pole to pole."""


def form_faces(form: Sphere | Box | Capsule | Cylinder | TriangleMesh) -> NDArray[np.float64]:
    """Return the corners (f, k, 3) [m] of the faces of a shape, in the shape's frame."""
    match form:
        case Sphere(radius):
            return _turned(radius * np.sin(_polar()), radius * np.cos(_polar()))
        case Capsule(radius, length):
            polar = np.concatenate([_polar()[: ALONG // 2 + 1], _polar()[ALONG // 2 :]])
            ends = np.repeat([0.5 * length, -0.5 * length], ALONG // 2 + 1)
            return _turned(radius * np.sin(polar), radius * np.cos(polar) + ends)
        case Cylinder(radius, length):
            return _turned(np.array([0.0, radius, radius, 0.0]), 0.5 * length * np.array([1.0, 1.0, -1.0, -1.0]))
        case Box(size):
            square = np.array([[-1.0, -1.0, 1.0], [1.0, -1.0, 1.0], [1.0, 1.0, 1.0], [-1.0, 1.0, 1.0]])
            sides = [np.roll(side, axis, axis=1) for axis in range(3) for side in (square, -square[::-1])]
            return 0.5 * np.array(sides) * size
        case TriangleMesh(solid):
            return solid.vertices[solid.triangles]


def _polar() -> NDArray[np.float64]:
    return np.linspace(0.0, np.pi, ALONG + 1)


def _turned(radii: NDArray[np.float64], heights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the corners (q, 4, 3) [m] of the quads of a surface of revolution about z.

    Its profile has the ``radii`` at the ``heights`` [m].
    """
    turn = np.linspace(0.0, 2.0 * np.pi, AROUND + 1)
    rings = np.stack(
        [np.outer(radii, np.cos(turn)), np.outer(radii, np.sin(turn)), np.tile(heights[:, None], AROUND + 1)], axis=-1
    )
    corners = rings[:-1, :-1], rings[1:, :-1], rings[1:, 1:], rings[:-1, 1:]
    return np.stack(corners, axis=2).reshape(-1, 4, 3)
