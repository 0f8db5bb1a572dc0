# SPDX-License-Identifier: Apache-2.0
"""Rigid part of the vertex vectors of rigid bodies."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def rigid_part(positions: NDArray[np.float64], vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rigid field u + w x r closest to ``vectors`` (..., 4, 3) on vertices of equal mass.

    ``positions`` (..., 4, 3) [m] are those of the vertices. For velocities, the field has the same momentum and angular
    momentum. For forces divided by the mass of a vertex, it is the acceleration of the rigid body.
    """
    arms = positions - positions.mean(axis=-2, keepdims=True)
    mean = vectors.mean(axis=-2, keepdims=True)
    spread = np.einsum("...ai,...ai->...", arms, arms)[..., None, None] * np.eye(3)
    inertia = spread - np.einsum("...ai,...aj->...ij", arms, arms)
    moment = np.cross(arms, vectors).sum(axis=-2)
    spin = np.linalg.solve(inertia, moment[..., None])[..., 0]
    return mean + np.cross(spin[..., None, :], arms)
