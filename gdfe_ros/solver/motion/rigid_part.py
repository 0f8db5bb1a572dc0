# SPDX-License-Identifier: Apache-2.0
"""The rigid part of what the vertices of rigid bodies do."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def rigid_part(positions: NDArray[np.float64], vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the nearest field u + w x r of vectors (..., 4, 3) on vertices of equal mass at ``positions`` [m].

    Of velocities it is the motion of the same momentum and angular momentum; of forces, over the mass of a vertex,
    it is how a body of such vertices is accelerated.
    """
    arms = positions - positions.mean(axis=-2, keepdims=True)
    mean = vectors.mean(axis=-2, keepdims=True)
    spread = np.einsum("...ai,...ai->...", arms, arms)[..., None, None] * np.eye(3)
    inertia = spread - np.einsum("...ai,...aj->...ij", arms, arms)
    moment = np.cross(arms, vectors).sum(axis=-2)
    spin = np.linalg.solve(inertia, moment[..., None])[..., 0]
    return mean + np.cross(spin[..., None, :], arms)
