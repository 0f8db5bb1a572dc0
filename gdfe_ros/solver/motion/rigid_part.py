# SPDX-License-Identifier: Apache-2.0
"""Rigid part of the vertex vectors of rigid bodies."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.compiled import kernel


def rigid_part(positions: NDArray[np.float64], vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rigid field u + w x r closest to ``vectors`` (..., 4, 3) on vertices of equal mass.

    ``positions`` (..., 4, 3) [m] are those of the vertices. For velocities, the field has the same momentum and angular
    momentum. For forces divided by the mass of a vertex, it is the acceleration of the rigid body.
    """
    out = np.empty(vectors.shape)
    rigid_fields(positions.reshape(-1, 4, 3), vectors.reshape(-1, 4, 3), out.reshape(-1, 4, 3))
    return out


@kernel
def rigid_fields(positions, vectors, out):
    """Write the fields of `rigid_part` for bodies (b, 4, 3) to ``out``; w is found by Cramer's rule."""
    arms = np.empty((4, 3))
    for body in range(len(positions)):
        x, v = positions[body], vectors[body]
        m0, m1, m2, s00, s11, s22, s01, s02, s12 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for a in range(4):
            for i in range(3):
                arms[a, i] = x[a, i] - 0.25 * (x[0, i] + x[1, i] + x[2, i] + x[3, i])
            r0, r1, r2 = arms[a, 0], arms[a, 1], arms[a, 2]
            m0 += r1 * v[a, 2] - r2 * v[a, 1]
            m1 += r2 * v[a, 0] - r0 * v[a, 2]
            m2 += r0 * v[a, 1] - r1 * v[a, 0]
            s00, s11, s22 = s00 + r1 * r1 + r2 * r2, s11 + r0 * r0 + r2 * r2, s22 + r0 * r0 + r1 * r1
            s01, s02, s12 = s01 - r0 * r1, s02 - r0 * r2, s12 - r1 * r2
        c00, c01, c02 = s11 * s22 - s12 * s12, s02 * s12 - s01 * s22, s01 * s12 - s02 * s11
        c11, c12, c22 = s00 * s22 - s02 * s02, s01 * s02 - s00 * s12, s00 * s11 - s01 * s01
        det = s00 * c00 + s01 * c01 + s02 * c02
        w0 = (c00 * m0 + c01 * m1 + c02 * m2) / det
        w1 = (c01 * m0 + c11 * m1 + c12 * m2) / det
        w2 = (c02 * m0 + c12 * m1 + c22 * m2) / det
        for a in range(4):
            r0, r1, r2 = arms[a, 0], arms[a, 1], arms[a, 2]
            out[body, a, 0] = 0.25 * (v[0, 0] + v[1, 0] + v[2, 0] + v[3, 0]) + w1 * r2 - w2 * r1
            out[body, a, 1] = 0.25 * (v[0, 1] + v[1, 1] + v[2, 1] + v[3, 1]) + w2 * r0 - w0 * r2
            out[body, a, 2] = 0.25 * (v[0, 2] + v[1, 2] + v[2, 2] + v[3, 2]) + w0 * r1 - w1 * r0
