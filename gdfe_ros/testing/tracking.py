# SPDX-License-Identifier: Apache-2.0
"""Distance between a controlled motion and its reference."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike


@dataclass(frozen=True)
class TrackingError:
    """Distances between actual and wanted positions.

    Attributes:
        largest: largest distance [m].
        rms: root mean square of the distances [m].
        last: distance at the end [m].
    """

    largest: float
    rms: float
    last: float


def tracking_error(actual: ArrayLike, wanted: ArrayLike) -> TrackingError:
    """Return largest, RMS and last distance between an actual and a wanted motion.

    Args:
        actual: (k, 3) positions [m].
        wanted: (k, 3), or one position (3,) for all [m].

    Raises:
        ValueError: the shapes do not fit, an array is empty, or a value is not finite.
    """
    actual, wanted = np.asarray(actual, dtype=np.float64), np.asarray(wanted, dtype=np.float64)
    if actual.ndim != 2 or actual.shape[1:] != (3,) or wanted.shape not in ((3,), actual.shape) or not len(actual):
        raise ValueError(f"actual must be (k, 3) and wanted (k, 3) or (3,), got {actual.shape} and {wanted.shape}")
    distances = np.linalg.norm(actual - wanted, axis=1)
    if not np.isfinite(distances).all():
        raise ValueError("positions must be finite numbers")
    return TrackingError(float(distances.max()), float(np.sqrt((distances**2).mean())), float(distances[-1]))
