# SPDX-License-Identifier: Apache-2.0
"""The surface of a body, as contact sees it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.actuators.load import GAUSS, corner_areas
from gdfe_ros.mesh.faces import boundary_faces
from gdfe_ros.solver.body import Body

SIGNS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
SHAPE = np.stack([0.25 * (1.0 + GAUSS * SIGNS * point).prod(axis=1) for point in SIGNS])
"""(4, 4) weights of a face's corners at each of its Gauss points."""


@dataclass(frozen=True, eq=False)
class Surface:
    """The boundary of a body without the faces that handles drive.

    Attributes:
        vertices: (k,) int32 that are not driven, sorted.
        areas: (k,) [m^2] at rest, each one's share of the surface.
        quads: (q, 4) int32 vertices of the faces.
        gauss: (q, 4) [m^2] at rest, the share of each Gauss point.
        spread: (n,) [m^2] at rest, of all the body's vertices.
    """

    vertices: NDArray[np.int32]
    areas: NDArray[np.float64]
    quads: NDArray[np.int32]
    gauss: NDArray[np.float64]
    spread: NDArray[np.float64]

    @classmethod
    def of(cls, body: Body) -> Surface:
        """Return the surface of a body."""
        quads = boundary_faces(body.cells).quads
        driven = np.zeros(len(body.rest), dtype=bool)
        for handle in body.handles:
            driven[handle.vertices] = not (handle.free or handle.turning)
        quads = quads[~driven[quads].all(axis=1)]
        shares = corner_areas(body.rest, quads)
        spread = np.bincount(quads.ravel(), weights=shares.ravel(), minlength=len(body.rest))
        vertices = np.flatnonzero((spread > 0.0) & ~driven).astype(np.int32)
        gauss = np.linalg.solve(SHAPE.T, shares.T).T
        return cls(vertices, spread[vertices], quads.astype(np.int32), gauss, spread)

    def about(self, vertices: NDArray[np.int32]) -> NDArray[np.int64]:
        """Return which faces have one of some vertices."""
        chosen = np.zeros(len(self.spread), dtype=bool)
        chosen[vertices] = True
        return np.flatnonzero(chosen[self.quads].any(axis=1))
