# SPDX-License-Identifier: Apache-2.0
"""Colour map of fields: viridis, from dark violet over green to yellow."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

VIRIDIS = np.array(
    [
        [0.267, 0.005, 0.329],
        [0.283, 0.141, 0.458],
        [0.254, 0.265, 0.530],
        [0.207, 0.372, 0.553],
        [0.164, 0.471, 0.558],
        [0.128, 0.567, 0.551],
        [0.135, 0.659, 0.518],
        [0.267, 0.749, 0.441],
        [0.478, 0.821, 0.318],
        [0.741, 0.873, 0.150],
        [0.993, 0.906, 0.144],
    ]
)
"""Red, green and blue (11, 3) in sRGB, from 0 to 1, at equally spaced values."""

NOISE = 1e-5
"""Least width of a colour range, for a field without a unit, or for lengths divided by the body's size. Smaller
differences are noise.
"""


def colour_range(low: float, high: float, *, noise: float = NOISE) -> tuple[float, float]:
    """Return the colour range from ``low`` to ``high``, widened to at least ``noise``."""
    return low, max(high, low + noise)


def colour(values: NDArray[np.float64], low: float | None = None, high: float | None = None) -> NDArray[np.float64]:
    """Return red, green and blue (m, 3), 0 to 1, of values (m,) in the range from ``low`` to ``high``.

    None means the least or the largest of the values.
    """
    low = values.min() if low is None else low
    span = (values.max() if high is None else high) - low
    place = np.clip((values - low) / span, 0.0, 1.0) if span > 0.0 else np.zeros_like(values)
    grid = np.linspace(0.0, 1.0, len(VIRIDIS))
    return np.stack([np.interp(place, grid, channel) for channel in VIRIDIS.T], axis=1)
